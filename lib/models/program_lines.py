"""A line of a ShapeAssembly program as 63 numbers, and back (ShapeAssembly paper, section 6.1).

    field      width  holds                                              used by
    command      7    one-hot of COMMANDS                                every line
    first       11    one-hot: the cuboid declared, moved or copied      every command but start and end
    second      11    one-hot: the cuboid it is attached to              attach, squeeze
    third       11    one-hot: the other partner                         squeeze
    size         3    length, height, width, world units                 Cuboid
    point        3    where on the moved cuboid, 0 … 1                   attach
    place        3    where on the partner, 0 … 1                        attach
    axis         3    one-hot of X, Y, Z                                 reflect, translate
    count        1    number of copies                                   translate
    distance     1    how far the last copy is, in bbox sides            translate
    face         6    one-hot of FACES                                   squeeze
    uv           2    where on the partners' faces, 0 … 1                squeeze
    aligned      1    1: attachments never turn it                       Cuboid

Cuboids are numbered as they are declared: 0 is the bbox, 1 is cube0, … Fields that a command does not use are 0. The
paper names the fields in another order; this one is that of the authors' program.
"""

from jaxtyping import Float
from torch import Tensor

from ..interpreters.shapeassembly import (
    Attach,
    Block,
    Cuboid,
    ProgramError,
    Reflect,
    Squeeze,
    Translate,
)
from ..interpreters.shapeassembly.program import AXES, BBOX, FACES, Statement

COMMANDS = ("start", "Cuboid", "attach", "reflect", "translate", "squeeze", "end")
COMMAND = {name: number for number, name in enumerate(COMMANDS)}
MAX_CUBOIDS = 11  # of a block, the bbox included: the width of an index one-hot
WIDTHS = {
    "command": len(COMMANDS), "first": MAX_CUBOIDS, "second": MAX_CUBOIDS, "third": MAX_CUBOIDS,
    "size": 3, "point": 3, "place": 3, "axis": len(AXES), "count": 1, "distance": 1,
    "face": len(FACES), "uv": 2, "aligned": 1,
}  # fmt: skip
WIDTH = sum(WIDTHS.values())  # 63
DECIMALS = 6  # of a number read back from float32


def _slices() -> dict[str, slice]:
    found, start = {}, 0
    for name, width in WIDTHS.items():
        found[name] = slice(start, start + width)
        start += width
    return found


FIELD = _slices()  # name -> where in a line


def line_of(statement: Statement, number: dict[str, int]) -> list[float]:
    """A statement as 63 numbers; `number` has the cuboids of its block, 0 for the bbox."""
    line = [0.0] * WIDTH

    def put(field: str, *values: float) -> None:
        line[FIELD[field]] = values

    def mark(field: str, index: int) -> None:
        line[FIELD[field].start + index] = 1.0

    mark("command", COMMAND[statement.command])
    match statement:
        case Cuboid():
            mark("first", number[statement.name])
            put("size", *statement.numbers)
            put("aligned", float(statement.aligned))
        case Attach():
            mark("first", number[statement.moved])
            mark("second", number[statement.still])
            put("point", *statement.numbers[:3])
            put("place", *statement.numbers[3:])
        case Squeeze():
            mark("first", number[statement.moved])
            mark("second", number[statement.first])
            mark("third", number[statement.second])
            mark("face", FACES.index(statement.face))
            put("uv", *statement.numbers)
        case Reflect() | Translate():
            mark("first", number[statement.source])
            mark("axis", AXES.index(statement.axis))
            if isinstance(statement, Translate):
                put("count", float(statement.count))
                put("distance", *statement.numbers)
    return line


def statement_of(line: Float[Tensor, "63"] | list[float], names: list[str]) -> Statement:
    """The statement that a line says; names[i] is cuboid i of its block. Numbers are rounded to 6 decimals.

    One-hots are read as their largest entry. Raises ProgramError for start and end, and for a cuboid without a name.
    """
    line = line.tolist() if isinstance(line, Tensor) else line

    def marked(field: str) -> int:
        values = line[FIELD[field]]
        return values.index(max(values))

    def name(field: str) -> str:
        if (index := marked(field)) >= len(names):
            raise ProgramError(
                f"a line names cuboid {index}", expected=f"one of the {len(names)} cuboids of its block"
            )
        return names[index]

    def numbers(*fields: str) -> tuple[float, ...]:
        return tuple(round(value, DECIMALS) for field in fields for value in line[FIELD[field]])

    match COMMANDS[marked("command")]:
        case "Cuboid":
            return Cuboid(name("first"), numbers("size"), line[FIELD["aligned"]][0] > 0.5)
        case "attach":
            return Attach(name("first"), name("second"), numbers("point", "place"))
        case "squeeze":
            face = FACES[marked("face")]
            return Squeeze(name("first"), name("second"), name("third"), face, numbers("uv"))
        case "reflect":
            return Reflect(name("first"), AXES[marked("axis")])
        case "translate":
            count = max(1, round(line[FIELD["count"]][0]))
            return Translate(name("first"), AXES[marked("axis")], count, numbers("distance"))
        case other:
            raise ProgramError(f"a line says {other!r}", expected="a statement of the language")


def block_lines(block: Block) -> list[list[float]]:
    """(statements, 63): every line of a block, without start and end. Raises ProgramError for too many cuboids."""
    declared = [s.name for s in block.statements if isinstance(s, Cuboid)]
    if len(declared) > MAX_CUBOIDS:
        raise ProgramError(
            f"block {block.name!r} declares {len(declared)} cuboids",
            expected=f"at most {MAX_CUBOIDS}, {BBOX} included: a line has no room for more",
        )
    number = {name: index for index, name in enumerate(declared)}
    return [line_of(statement, number) for statement in block.statements]
