"""Does a program make sense? Everything that can be wrong with a readable program, checked before it runs."""

import math
from dataclasses import dataclass, field

from ..quoting import quoted
from .errors import ProgramError
from .parsing import Source, is_name
from .program import AXES, BBOX, FACES, Attach, Block, Cuboid, Reflect, Squeeze, Statement, Translate

# Limits far above any furniture (the largest real program: 51 leaves, 3 levels, 2 attaches that move one cuboid).
# They keep a short text from asking for hours of work.
MAX_CUBOIDS = 10_000  # executed boxes
MAX_LEVELS = 100  # blocks within blocks
MAX_MOVES = 100  # attaches that move one cuboid
MAX_COPIED_MOVES = 100_000  # attaches that the copies of one block repeat

_PHASE = {Cuboid: 0, Attach: 1, Squeeze: 1, Reflect: 2, Translate: 2}
_NUMBERS = {Cuboid: 3, Attach: 6, Squeeze: 2, Reflect: 0, Translate: 1}


def check(blocks: tuple[Block, ...], source: Source | None = None) -> None:
    """Raise ProgramError for the first thing that is wrong with `blocks`; `source` tells where their text stands."""
    source = source or Source.printed(blocks)
    if not blocks:
        raise ProgramError("a program without blocks", expected="at least one block")
    names = {block.name for block in blocks}
    seen: set[str] = set()
    for number, block in enumerate(blocks):
        if not is_name(block.name):
            raise source.error(
                number, -1, "", f"{quoted(str(block.name))} is not a name", "one such as Program_0"
            )
        if block.name in seen:
            raise source.error(
                number, -1, block.name, f"block {quoted(block.name)} is defined twice", "a new name"
            )
        seen.add(block.name)
        _BlockCheck(number, block, source, names).run()
    _check_hierarchy(blocks, source)


def check_block(block: Block) -> None:
    """The same for one block by itself; whether other blocks fill its boxes is not asked."""
    if not isinstance(block, Block):
        raise ProgramError(f"found a {type(block).__name__}", expected="one block, such as program.blocks[0]")
    names = {statement.name for statement in block.statements if isinstance(statement, Cuboid)}
    _BlockCheck(0, block, Source.printed((block,)), names).run()


def clone_count(statement: Statement) -> int:
    """How many boxes a statement of the last part of a block adds."""
    return statement.count if isinstance(statement, Translate) else int(isinstance(statement, Reflect))


def is_finite(number: object) -> bool:
    """Is it a number that a float can hold?"""
    try:
        return isinstance(number, int | float) and math.isfinite(number)
    except OverflowError:  # a whole number beyond every float
        return False


@dataclass
class _BlockCheck:
    """One block, read from top to bottom: what is declared, what stands on something, how often each was moved."""

    number: int
    block: Block
    source: Source
    block_names: set[str]
    declared: dict[str, int] = field(default_factory=dict)  # name -> statement
    grounded: set[str] = field(default_factory=lambda: {BBOX})
    moves: dict[str, int] = field(default_factory=dict)
    phase: int = 0

    def run(self) -> None:
        """Raise ProgramError for the first thing that is wrong with the block."""
        first = self.block.statements[0] if self.block.statements else None
        if not isinstance(first, Cuboid) or first.name != BBOX:
            at, expected = (0 if first else -1), "'bbox = Cuboid(…)' as its first statement"
            raise self.error(at, "", f"block {quoted(self.block.name)} has no bounding box", expected)
        for at, statement in enumerate(self.block.statements):
            self.order(at, statement)
            self.form(at, statement)
            if isinstance(statement, Cuboid):
                self.cuboid(at, statement)
            elif isinstance(statement, Attach | Squeeze):
                self.attachment(at, statement)
            else:
                self.copy(at, statement)
        self.clone_names()

    def error(self, at: int, token: str, message: str, expected: str) -> ProgramError:
        return self.source.error(self.number, at, token, message, expected)

    def order(self, at: int, statement: Statement) -> None:
        if _PHASE[type(statement)] < self.phase:
            expected = "first Cuboid, then attach and squeeze, then reflect and translate"
            raise self.error(at, statement.command, f"{statement.command} out of order", expected)
        self.phase = _PHASE[type(statement)]

    def form(self, at: int, statement: Statement) -> None:
        """Arguments of the right number and range: of what is parsed only the numbers can be wrong here."""
        command = statement.command
        if len(statement.numbers) != _NUMBERS[type(statement)]:
            found = f"{command} with {len(statement.numbers)} numbers"
            raise self.error(at, command, found, f"{_NUMBERS[type(statement)]}")
        for number in statement.numbers:
            if not is_finite(number):
                raise self.error(at, str(number), f"{str(number)[:40]} is not finite", "a finite number")
            if isinstance(statement, Cuboid) and number <= 0:
                found = f"{quoted(statement.name)} has a side of {number}"
                raise self.error(at, str(number), found, "a size above 0")
        if isinstance(statement, Squeeze) and statement.face not in FACES:
            raise self.error(
                at, statement.face, f"{quoted(statement.face)} is not a face", " or ".join(FACES)
            )
        if isinstance(statement, Reflect | Translate) and statement.axis not in AXES:
            raise self.error(
                at, statement.axis, f"{quoted(statement.axis)} is not an axis", " or ".join(AXES)
            )
        if isinstance(statement, Translate) and not (
            isinstance(statement.count, int) and statement.count >= 1
        ):
            raise self.error(
                at, str(statement.count), f"{statement.count} copies", "a whole number, at least 1"
            )

    def cuboid(self, at: int, cuboid: Cuboid) -> None:
        """A new name, and a block behind it where it promises one."""
        name = cuboid.name
        if not is_name(name):
            raise self.error(at, "", f"{quoted(str(name))} is not a name", "one such as cube0")
        if name in self.declared:
            raise self.error(at, name, f"{quoted(name)} is declared twice in this block", "a new name")
        if name.startswith("Program_") and name not in self.block_names:
            raise self.error(at, name, f"no block fills {quoted(name)}", f"'Assembly {name} {{'")
        if len(self.declared) > MAX_CUBOIDS:
            raise self.error(at, name, "too many cuboids", f"at most {MAX_CUBOIDS}")
        self.declared[name] = at

    def attachment(self, at: int, statement: Attach | Squeeze) -> None:
        """Partners that stand on something; what is moved stands on them from then on."""
        moved = statement.moved
        if moved == BBOX:
            raise self.error(at, BBOX, "the bounding box cannot be moved", "another cuboid")
        partners = (
            (statement.still,) if isinstance(statement, Attach) else (statement.first, statement.second)
        )
        for name in (moved, *partners):
            self.known(at, name)
        for name in partners:
            if name == moved:
                raise self.error(at, name, f"{quoted(name)} is attached to itself", "another cuboid")
            self.standing(at, name)
        self.grounded.add(moved)
        self.moves[moved] = self.moves.get(moved, 0) + len(partners)
        if self.moves[moved] > MAX_MOVES:
            raise self.error(at, moved, f"too many attaches move {quoted(moved)}", f"at most {MAX_MOVES}")

    def copy(self, at: int, statement: Reflect | Translate) -> None:
        if statement.source == BBOX:
            raise self.error(at, BBOX, "the bounding box cannot be copied", "another cuboid")
        self.known(at, statement.source)
        self.standing(at, statement.source)

    def known(self, at: int, name: str) -> None:
        if name not in self.declared:
            raise self.error(at, name, f"unknown cuboid {quoted(name)}", "a cuboid declared in this block")

    def standing(self, at: int, name: str) -> None:
        if name not in self.grounded:
            expected = "a cuboid that is connected to the bounding box"
            raise self.error(at, name, f"{quoted(name)} is not attached to anything yet", expected)

    def clone_names(self) -> None:
        """Clones are called cube<number of cuboids so far>: no declared cuboid may bear such a name already."""
        count, repeated = len(self.declared) - 1, 0
        for at, statement in enumerate(self.block.statements):
            if not (copies := clone_count(statement)):
                continue
            repeated += copies * self.moves[statement.source]
            if count + copies > MAX_CUBOIDS:
                found = f"{copies} copies make too many cuboids"
                raise self.error(at, str(copies), found, f"at most {MAX_CUBOIDS}")
            if repeated > MAX_COPIED_MOVES:
                found = f"the copies repeat {repeated} attaches"
                raise self.error(at, statement.command, found, f"at most {MAX_COPIED_MOVES}")
            for name in (f"cube{number}" for number in range(count, count + copies)):
                if name in self.declared:
                    found = f"{name} is the name the copies of {quoted(statement.source)} will take"
                    raise self.error(self.declared[name], name, found, "names cube0, cube1, … in order")
            count += copies


def _check_hierarchy(blocks: tuple[Block, ...], source: Source) -> None:
    """The root reaches every block, no block contains itself, and the whole stays below the limits."""
    index = {block.name: number for number, block in enumerate(blocks)}
    children = [_children(block, index) for block in blocks]
    boxes: dict[int, int] = {}  # finished block -> executed boxes inside it
    path = [0]  # from the root to the block that is being counted
    waiting = [list(children[0])]
    while path:
        if not waiting[-1]:
            _count_boxes(path[-1], blocks, children, boxes, source)
            path.pop()
            waiting.pop()
            continue
        at, child, _ = waiting[-1].pop(0)
        name = blocks[child].name
        if child in path:
            raise source.error(path[-1], at, name, f"block {quoted(name)} contains itself", "no recursion")
        if len(path) >= MAX_LEVELS:
            raise source.error(
                path[-1], at, name, "too many blocks within blocks", f"at most {MAX_LEVELS} levels"
            )
        if child not in boxes:
            path.append(child)
            waiting.append(list(children[child]))
    for number, block in enumerate(blocks):
        if number not in boxes:
            found = f"block {quoted(block.name)} is never used"
            raise source.error(number, -1, block.name, found, "a cuboid of that name")


def _count_boxes(number: int, blocks, children, boxes: dict[int, int], source: Source) -> None:
    block = blocks[number]
    declared = sum(isinstance(statement, Cuboid) for statement in block.statements) - 1
    own = declared + sum(map(clone_count, block.statements))
    boxes[number] = own + sum(copies * boxes[child] for _, child, copies in children[number])
    if boxes[number] > MAX_CUBOIDS:
        found = f"block {quoted(block.name)} makes {boxes[number]} cuboids"
        raise source.error(number, -1, block.name, found, f"at most {MAX_CUBOIDS}")


def _children(block: Block, index: dict[str, int]) -> list[tuple[int, int, int]]:
    """(statement, block, number of boxes it fills) of every cuboid of `block` that another block fills."""
    filled = {
        s.name: at for at, s in enumerate(block.statements) if isinstance(s, Cuboid) and s.name in index
    }
    copies = dict.fromkeys(filled, 1)
    for statement in block.statements:
        if isinstance(statement, Reflect | Translate) and statement.source in copies:
            copies[statement.source] += clone_count(statement)
    return [(at, index[name], copies[name]) for name, at in filled.items()]
