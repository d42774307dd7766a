"""Small programs for tests: a block from its lines, without the ceremony around them."""

from lib.interpreters.shapeassembly import Program, Shape, execute, parse


def block_text(*lines: str, bbox: str = "2, 2, 2", name: str = "Program_0") -> str:
    """The text of one block. The default box is 2 wide: local 0, 1/2, 1 are world -1, 0, 1."""
    return "\n".join(
        [f"Assembly {name} {{", f"\tbbox = Cuboid({bbox}, True)", *(f"\t{line}" for line in lines), "}", ""]
    )


def program(*lines: str, bbox: str = "2, 2, 2") -> Program:
    """A program of one block."""
    return parse(block_text(*lines, bbox=bbox))


def run(*lines: str, bbox: str = "2, 2, 2") -> Shape:
    """A block, executed: `run(…).cuboids[0]` is the first cuboid after the bbox."""
    return execute(program(*lines, bbox=bbox))
