"""Draw a shape, and a CSGNet writes the program that draws it, while refinement makes its numbers better.

    widget = draw_a_shape(network)              the last line of a cell shows it
    widget = draw_a_shape(network, picture)     with something drawn already
    widget.draw(picture)                        what a stroke does: the network reads the drawing
    widget.improve()                            one sweep of refinement; the page asks for one after the other
    widget.program                              the best one so far

The page (`js/draw.js`, which loads nothing from elsewhere) has pen and eraser, and shows what it is sent. It asks for
the next sweep when the last one has come, so a new stroke ends the work on the old drawing, and other cells can run.
"""

from collections.abc import Sequence
from pathlib import Path

import anywidget
import numpy as np
import traitlets
from matplotlib.figure import Figure

from lib.interpreters.csg import KINDS, Primitive, Program, vocabulary_of
from lib.models.csgnet import CSGNet
from lib.viewing.canvas import image_of, rim_of, signed
from lib.viewing.draw_examples import example_drawings
from lib.viewing.draw_figures import reading_figure
from lib.viewing.draw_reading import (
    BEAMS,
    HINT,
    DrawingError,
    Reading,
    check_network,
    drawing_of,
    improved,
    read,
)

JS = Path(__file__).parent / "js"
BYTES = 512  # of a packed drawing


def draw_a_shape(network: CSGNet, image=None) -> "DrawWidget":
    """A canvas to draw on, which the network reads; see `DrawWidget`."""
    return DrawWidget(network, image)


class DrawWidget(anywidget.AnyWidget):
    """A drawing of 64 x 64 pixels, the program that a CSGNet of the plane writes for it, and its refinement.

    image    what is drawn at first: a picture, a program, its text, or an image[y, x]; None: nothing
    k        programs that beam search keeps
    reading  what was found for the present drawing, or None         program, distance (px)   of its best program
    message  what stands below the drawing where there is none
    Raises TypeError or ValueError for another network, and for an image that is none.
    """

    _esm = JS / "draw.js"
    _css = JS / "draw.css"
    view = traitlets.Dict().tag(sync=True)  # what the page says
    # The drawing, and where they are there, what the network's program draws, and the best one; 512 bytes each.
    pictures = traitlets.Bytes(bytes(BYTES)).tag(sync=True)
    names = traitlets.List(traitlets.Unicode()).tag(sync=True)  # of drawings to begin with
    examples = traitlets.Bytes(b"").tag(sync=True)  # 512 bytes each

    def __init__(self, network: CSGNet, image=None, k: int = BEAMS, **options):
        check_network(network)
        vocabulary_of(2).canvases()  # drawn and kept now, so that the first stroke need not wait for them
        self._network, self._k, self._number = network, k, 0
        self._image = np.zeros((64, 64), dtype=bool)
        self.reading: Reading | None = None
        self.message = HINT
        drawings = example_drawings()
        packed = b"".join(map(_packed, drawings.values()))
        super().__init__(names=list(drawings), examples=packed, **options)
        self.on_msg(self._on_message)
        self._show() if image is None else self.draw(image)

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"DrawWidget({str(self.program)!r})" if self.reading else "DrawWidget()"

    @property
    def program(self) -> Program | None:
        return self.reading.programs[-1] if self.reading else None

    @property
    def distance(self) -> float | None:
        return self.reading.distances[-1] if self.reading else None

    def draw(self, image) -> None:
        """Replace the drawing, and let the network read it; `message` says why it could not.

        Raises TypeError or ValueError for an image that is none.
        """
        self._read(drawing_of(image).numpy(), self._number + 1)

    def improve(self) -> bool:
        """One sweep of refinement: was there anything better? Raises DrawingError where nothing was read."""
        if self.reading is None:
            raise DrawingError(self.message)
        before = self.reading.sweeps
        self.reading = improved(self.reading)
        self._show()
        return self.reading.sweeps > before

    def figure(self) -> Figure:
        """The same as a still picture, for pages without a kernel. Raises DrawingError where nothing was read."""
        if self.reading is None:
            raise DrawingError(self.message)
        return reading_figure(self.reading)

    def _read(self, image: np.ndarray, number: int) -> None:
        self._image, self._number, self.reading, self.message = image, number, None, ""
        try:
            self.reading = read(self._network, image, self._k)
        except DrawingError as error:
            self.message = str(error)
        except Exception as error:  # whatever it is: a traceback would go to a log where nobody looks
            self.message = f"This drawing could not be read: {error}"
        self._show()

    def _show(self) -> None:
        """Tell the page everything, in one message. `number` says of which drawing it is."""
        found, pictures = self.reading, [self._image]
        view = {"number": self._number, "message": self.message, "hint": self.message == HINT}
        if found:
            pictures += [image_of(found.programs[0]), image_of(found.programs[-1])]
            view |= {"distances": found.distances, "done": found.done}
            view |= {"first": _tokens(found.programs[0]), "tokens": _tokens(found.programs[-1])}
        with self.hold_sync():
            self.pictures = b"".join(map(_packed, pictures))
            self.view = view

    def _on_message(self, _, message: dict, buffers: Sequence[bytes] = ()) -> None:
        """What the page asks for; anything else is not answered."""
        match message:
            case {"do": "read", "number": int(number)} if len(buffers) == 1 and len(buffers[0]) == BYTES:
                bits = np.unpackbits(np.frombuffer(buffers[0], np.uint8), bitorder="little")
                self._read(bits.reshape(64, 64).astype(bool), number)
            case {"do": "improve", "number": self._number, "sweeps": int(sweeps)}:
                # A second page that shows the same widget may have asked already.
                if self.reading and not self.reading.done and sweeps == self.reading.sweeps:
                    self._improve()

    def _improve(self) -> None:
        try:
            self.improve()
        except Exception as error:
            self.reading, self.message = None, f"This program could not be refined: {error}"
            self._show()


def _tokens(program: Program) -> list[dict]:
    """The program's tokens for the page: text, and of a primitive its kind, name, rim, and whether it is cut away."""
    primitives, tokens = iter(signed(program)), []
    for statement in program.statements:
        token = {"text": str(statement)}
        if isinstance(statement, Primitive):
            primitive, cut = next(primitives)
            rim = rim_of(primitive)
            token |= {"kind": statement.kind, "name": KINDS[statement.kind].name, "rim": rim, "cut": cut}
        tokens.append(token)
    return tokens


def _packed(image: np.ndarray) -> bytes:
    """512 bytes: bit k of byte b of a row is the pixel x = 8 b + k."""
    return np.packbits(image, axis=1, bitorder="little").tobytes()
