"""The continuous parameters of a ShapeAssembly program, for people: what each one is called, how far a slider for it
goes, and where its number stands in the text."""

import re
from dataclasses import dataclass

from lib.interpreters.shapeassembly import Program

SIDES = ("length", "height", "width")  # of a cuboid, along x, y, z
# A number that is a whole argument: after "(" or ",", before "," or ")". The 0 of `cube0` is none.
NUMBER = re.compile(r"(?<=[(,])\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?=[,)])")


@dataclass(frozen=True)
class Knob:
    """One continuous parameter: `name` as in `Program.parameter_names`, a `label` to read, its block and its range."""

    name: str
    label: str
    block: str
    value: float
    low: float
    high: float


def knobs(program: Program) -> list[Knob]:
    """A Knob for each parameter, in text order. Sizes go from 0.01 to at least 2, everything else from 0 to 1,
    and any range is widened to hold the value it starts from."""
    found = []
    for name, value in zip(program.parameter_names(), program.parameters().tolist(), strict=True):
        block, statement, command, index = name.split(":")
        line = next(b for b in program.blocks if b.name == block).statements[int(statement)]
        low, high = (0.01, max(2.0, 2 * value)) if command == "Cuboid" else (0.0, 1.0)
        found.append(Knob(name, label(line, int(index)), block, value, min(low, value), max(high, value)))
    return found


def label(statement, index: int) -> str:
    """What number `index` of a statement is, such as `cube0 length` or `attach cube1→cube0: y on cube0`."""
    match statement.command:
        case "Cuboid":
            return f"{statement.name} {SIDES[index]}"
        case "attach":
            on = statement.moved if index < 3 else statement.still
            return f"attach {statement.moved}→{statement.still}: {'xyz'[index % 3]} on {on}"
        case "squeeze":
            return f"squeeze {statement.moved}: {'uv'[index]}"
        case _:
            return f"translate {statement.source}: distance"


def places(text: str) -> list[tuple[int, int]]:
    """Where each continuous parameter stands in a program's text: (start, end) character offsets, in text order."""
    found, start = [], 0
    for line in text.splitlines(keepends=True):
        code = line.partition("#")[0]
        numbers = [(start + m.start(1), start + m.end(1)) for m in NUMBER.finditer(code)]
        found += numbers[1:] if re.match(r"\s*translate\b", code) else numbers  # its first number is a count
        start += len(line)
    return found


def write_number(text: str, index: int, value: float) -> str:
    """The same text, comments and spacing included, with another number (4 decimals) as its parameter `index`."""
    start, end = places(text)[index]
    return text[:start] + str(round(float(value), 4)) + text[end:]
