"""What a network writes, as figures: samples with their neighbours, variants, ways between two shapes, directions.

    contact_sheet(programs)                        all of them, with the number of their lines
    neighbour_figure(programs, training)           each between its two nearest training programs (paper, Figure 7)
    variant_figure(programs)                       each with other numbers (paper, Figure 8)
    interpolation_figure(programs)                 from one to another as a film strip (paper, Figure 12)
    direction_figure(network, directions)          what a step along each main direction does

All take programs (or what makes some), and return a matplotlib figure that pyplot has closed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.shapeassembly import Program, Shape, execute_many
from lib.metrics.chamfer import POINTS
from lib.metrics.cloud_search import nearest_clouds
from lib.metrics.clouds import surface_points_many
from lib.metrics.program_distance import nearest_programs, program_distance
from lib.models.exploring import Directions
from lib.models.program_vae import ProgramVAE
from lib.models.writing import write
from lib.viewing.figure import show
from lib.viewing.variants import Amounts, variants

STOPS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # standard deviations
ROW_NAMES = ("nearest by geometry", "written by the network", "nearest by program")
NAME_WIDTH = 0.3  # inches, left of the pictures


def line_count(program: Program) -> int:
    """Lines of a program, those of its bounding boxes included."""
    return sum(len(block.statements) for block in program.blocks)


def contact_sheet(programs: Sequence[Program], columns: int = 6, size: float = 1.8, **options) -> Figure:
    """All shapes in order, numbered from 1, each with the number of its lines; options are those of `show`."""
    titles = [f"{number}: {line_count(program)} lines" for number, program in enumerate(programs, start=1)]
    return show(list(execute_many(programs)), titles, columns=columns, size=size, **options)


@dataclass(frozen=True)
class Neighbours:
    """The training programs nearest to some programs, as numbers in the training set, and how far away they are.

    geometric, distance  by the Chamfer distance of 1,024 points on each surface, world units
    program, edits       by the edit distance of tokens
    """

    geometric: Int[Tensor, " programs"]
    distance: Float[Tensor, " programs"]
    program: Int[Tensor, " programs"]
    edits: Int[Tensor, " programs"]


def neighbours(programs: Sequence[Program], training: Sequence[Program], seed: int = 0) -> Neighbours:
    """The nearest of `training` to each program, twice; `seed` is that of the points on the surfaces.

    The points of a program and of its neighbour are drawn anew: even a copy is some 0.08 away from its original.
    Raises ValueError for an empty training set, and for shapes without a surface.
    """
    if not len(training):
        raise ValueError("found no training programs; expected at least one, to be the nearest")
    clouds = [
        surface_points_many(execute_many(each), POINTS, 2 * seed + i)
        for i, each in enumerate((programs, training))
    ]
    by_geometry, by_program = nearest_clouds(*clouds), nearest_programs(programs, training)
    return Neighbours(by_geometry.index, by_geometry.distance, by_program.index, by_program.distance)


def neighbour_figure(
    programs: Sequence[Program], training: Sequence[Program], seed: int = 0, size: float = 1.9, **options
) -> Figure:
    """Three rows: the training shape nearest by geometry, the program's own, the training program nearest by edits.

    Titles have the distances. Raises as `neighbours` does.
    """
    found = neighbours(programs, training, seed)
    rows = [[training[i] for i in index.tolist()] for index in (found.geometric, found.program)]
    shapes = list(execute_many([*rows[0], *programs, *rows[1]]))
    titles = [
        *(f"distance {distance:.3f}" for distance in found.distance.tolist()),
        *(f"{line_count(program)} lines" for program in programs),
        *(f"{edits} edit{'s' if edits != 1 else ''}" for edits in found.edits.tolist()),
    ]
    figure = show(shapes, titles, columns=len(programs), size=size, **options)
    return with_row_names(figure, ROW_NAMES)


def variant_figure(
    programs: Sequence[Program],
    count: int = 5,
    seed: int = 0,
    amounts: Amounts | None = None,
    size: float = 1.7,
    **options,
) -> Figure:
    """A row a program: itself, then `count` variants, which differ from it in numbers only. Raises as `variants`."""
    rows = [
        [program, *variants(program, count, seed + number, amounts)]
        for number, program in enumerate(programs)
    ]
    titles = ["as written" if not column else "" for _ in rows for column in range(count + 1)]
    shapes = list(execute_many([program for row in rows for program in row]))
    return show(shapes, titles, columns=count + 1, size=size, **options)


def interpolation_figure(
    programs: Sequence[Program], columns: int | None = None, size: float = 1.8, **options
) -> Figure:
    """The programs in order, seen by one camera; under each its lines, and how many edits it is from the one before."""
    titles = [
        f"{line_count(program)} lines" + (f"\n{program_distance(before, program)} edits" if before else "\n")
        for before, program in zip([None, *programs], programs)
    ]
    shapes = list(execute_many(programs))
    return show(shapes, titles, columns=columns or min(8, len(shapes)), size=size, same_scale=True, **options)


def direction_figure(
    network: ProgramVAE,
    directions: Directions,
    base: Float[Tensor, " latent"] | None = None,
    count: int = 4,
    size: float = 1.6,
    **options,
) -> Figure:
    """A row for each of the first directions: shapes at STOPS standard deviations σ from the mean, or from `base`."""
    count = min(count, len(directions))
    weights = torch.zeros(count, len(STOPS), len(directions))
    for row in range(count):
        weights[row, :, row] = torch.tensor(STOPS)
    codes = directions.code(weights.flatten(0, 1), base)
    titles = [
        f"direction {row + 1}: {stop:+g} σ" if stop else "start" for row in range(count) for stop in STOPS
    ]
    shapes = shapes_of(write(network, codes, "skip").programs)
    return show(shapes, titles, columns=len(STOPS), size=size, same_scale=True, **options)


def shapes_of(programs: Sequence[Program | None]) -> list[Shape | None]:
    """The shapes of programs, run as one batch; None, which is drawn as an empty picture, for None."""
    shapes = iter(execute_many([program for program in programs if program is not None]))
    return [None if program is None else next(shapes) for program in programs]


def with_row_names(figure: Figure, names: Sequence[str]) -> Figure:
    """A name left of each row of pictures, which make room for it."""
    columns, before = len(figure.axes) // len(names), figure.get_figwidth()
    figure.set_figwidth(before + NAME_WIDTH)
    shrunk, margin = before / (before + NAME_WIDTH), NAME_WIDTH / (before + NAME_WIDTH)
    for ax in figure.axes:  # each as large as it was
        left, bottom, width, height = ax.get_position().bounds
        ax.set_position([margin + shrunk * left, bottom, shrunk * width, height])
    for row, name in enumerate(names):
        box = figure.axes[row * columns].get_position()
        middle = (box.y0 + box.y1) / 2
        figure.text(
            margin / 2, middle, name, rotation=90, va="center", ha="center", fontsize=9, color="#3b4252"
        )
    return figure
