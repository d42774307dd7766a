"""What a CSGNet reads in a drawing, as a still picture: the drawing, the network's answer, and the refined one."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lib.interpreters.csg import Primitive, Program
from lib.interpreters.csg.packing import SIDE
from lib.models.csgnet import CSGNet
from lib.viewing.canvas import COLORS, GAP, INK, SOFT, image_of, outline, page, signed, stamp, write
from lib.viewing.draw_reading import BEAMS, Reading, finished, read

SCALE, LETTER = 3, 7.1  # dots a pixel; dots a letter of the programs is wide
PALE = "#d3d9e2"
LINE = 6  # pixels of the page from one line of text to the next
AISLE = 24  # pixels between two pictures: room for what is written below them


def show_reading(network: CSGNet, image, k: int = BEAMS) -> Figure:
    """A drawing (a picture, a program, its text, or image[y, x]) as the network reads it, and refined to the end.

    Raises DrawingError for a drawing without an outline, TypeError or ValueError for another network or no image.
    """
    return reading_figure(finished(read(network, image, k)))


def reading_figure(reading: Reading) -> Figure:
    """The drawing, what the network's program draws, and what the best one draws, with the outlines of its primitives.

    Below them the distances, px, and the programs; a token has the colour of its outline. Dashed is what is cut away.
    """
    cell, sweeps = SIDE + AISLE, f"{reading.sweeps} sweep{'s' * (reading.sweeps != 1)}"
    figure, ax = page(3 * cell - AISLE + GAP, SIDE + GAP + 7 * LINE, SCALE)
    places = [GAP / 2 + k * cell for k in range(3)]
    answers = (reading.programs[0], "the network's answer"), (reading.programs[-1], f"after {sweeps}")
    ends = reading.distances[0], reading.distances[-1]
    stamp(ax, reading.image.numpy(), places[0], GAP / 2, INK)
    write(ax, "the drawing", places[0] + SIDE / 2, SIDE + GAP / 2 + 1)
    for x, (program, title), distance in zip(places[1:], answers, ends):
        stamp(ax, image_of(program), x, GAP / 2, PALE)
        for primitive, cut in signed(program):
            outline(ax, primitive, cut, x, GAP / 2)
        write(ax, f"{title}: {distance:.2f} px", x + SIDE / 2, SIDE + GAP / 2 + 1)
    for line, (program, title) in enumerate(answers):
        top = SIDE + GAP / 2 + (2.2 + 2.2 * line) * LINE
        write(ax, f"{title}:", GAP / 2, top, 8.5, ha="left", color=SOFT)
        _colored(ax, program, GAP / 2, top + LINE)
    return figure


def _colored(ax: Axes, program: Program, x: float, y: float) -> None:
    """The program's text on one line, a token in the colour of its kind."""
    for statement in program.statements:
        color = COLORS[statement.kind] if isinstance(statement, Primitive) else "#1b1f27"
        write(ax, str(statement), x, y, 8.5, code=True, ha="left", color=color)
        x += (len(str(statement)) + 1) * LETTER / SCALE
