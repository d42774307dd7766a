"""Does a program make sense? Everything that can be wrong with a readable program, checked before it runs."""

import math

from .parsing import Source
from .program import BBOX, Attach, Block, Cuboid, Reflect, Squeeze, Translate

MAX_CUBOIDS = 10_000  # executed boxes; far above any furniture (the largest real program has 51 leaves)
_PHASE = {Cuboid: 0, Attach: 1, Squeeze: 1, Reflect: 2, Translate: 2}


def check(blocks: tuple[Block, ...], source: Source | None = None) -> None:
    """Raise ProgramError for the first thing that is wrong with `blocks`."""
    source = source or Source.printed(blocks)
    names = [block.name for block in blocks]
    for b, block in enumerate(blocks):
        if names.index(block.name) != b:
            raise source.error(b, -1, block.name, f"block {block.name!r} is defined twice", "a new name")
        _check_block(b, block, source, set(names))
    _check_hierarchy(blocks, source)


def _check_block(b: int, block: Block, source: Source, block_names: set[str]) -> None:
    declared: dict[str, int] = {}
    grounded = {BBOX}
    phase = 0
    if not block.statements or getattr(block.statements[0], "name", None) != BBOX:
        raise source.error(b, 0 if block.statements else -1, "", f"block {block.name!r} has no bounding box",
                           "'bbox = Cuboid(…)' as its first statement")  # fmt: skip
    for s, statement in enumerate(block.statements):
        if _PHASE[type(statement)] < phase:
            raise source.error(b, s, statement.command, f"{statement.command} out of order",
                               "first Cuboid, then attach and squeeze, then reflect and translate")  # fmt: skip
        phase = _PHASE[type(statement)]
        _check_numbers(b, s, statement, source)
        if phase == 0:
            _check_cuboid(b, s, statement, source, declared, block_names)
            declared[statement.name] = s
        else:
            _check_names(b, s, statement, source, declared, grounded)
        if phase == 1:
            grounded.add(statement.moved)
    _check_clone_names(b, block, source, declared)


def _check_numbers(b, s, statement, source) -> None:
    for number in statement.numbers:
        if not math.isfinite(number):
            raise source.error(b, s, str(number), f"{number} is not finite", "a finite number")
        if isinstance(statement, Cuboid) and number <= 0:
            raise source.error(
                b, s, str(number), f"{statement.name} has a side of {number}", "a size above 0"
            )


def _check_cuboid(b, s, cuboid, source, declared, block_names) -> None:
    if cuboid.name in declared:
        raise source.error(
            b, s, cuboid.name, f"{cuboid.name!r} is declared twice in this block", "a new name"
        )
    if cuboid.name.startswith("Program_") and cuboid.name not in block_names:
        raise source.error(
            b, s, cuboid.name, f"no block fills {cuboid.name!r}", f"'Assembly {cuboid.name} {{'"
        )
    if len(declared) >= MAX_CUBOIDS:
        raise source.error(b, s, cuboid.name, "too many cuboids", f"at most {MAX_CUBOIDS}")


def _check_names(b, s, statement, source, declared, grounded) -> None:
    """Every cuboid named must be declared; all but the one being moved must already stand on something."""
    moving = isinstance(statement, Attach | Squeeze)
    if moving and statement.moved == BBOX:
        raise source.error(b, s, BBOX, "the bounding box cannot be moved", "another cuboid")
    partners = _partners(statement)
    for name in (statement.moved, *partners) if moving else partners:
        if name not in declared:
            raise source.error(b, s, name, f"unknown cuboid {name!r}", "a cuboid declared in this block")
    for name in partners:
        if name not in grounded or (moving and name == statement.moved):
            what = (
                "attached to itself" if moving and name == statement.moved else "not attached to anything yet"
            )
            raise source.error(
                b, s, name, f"{name!r} is {what}", "a cuboid that is connected to the bounding box"
            )
    if not moving and statement.source == BBOX:
        raise source.error(b, s, BBOX, "the bounding box cannot be copied", "another cuboid")


def _partners(statement) -> tuple[str, ...]:
    if isinstance(statement, Attach):
        return (statement.still,)
    if isinstance(statement, Squeeze):
        return (statement.first, statement.second)
    return (statement.source,)


def clone_count(statement) -> int:
    """How many boxes a statement of the last part of a block adds."""
    return statement.count if isinstance(statement, Translate) else int(isinstance(statement, Reflect))


def _check_clone_names(b, block, source, declared) -> None:
    """Clones are called cube<number of cuboids so far>; no declared cuboid may bear such a name already."""
    count = len(declared) - 1
    for s, statement in enumerate(block.statements):
        copies = clone_count(statement)
        if count + copies > MAX_CUBOIDS:
            raise source.error(
                b, s, str(copies), f"{copies} copies make too many cuboids", f"at most {MAX_CUBOIDS}"
            )
        for number in range(count, count + copies):
            if f"cube{number}" in declared:
                raise source.error(b, declared[f"cube{number}"], f"cube{number}",
                                   f"cube{number} is the name the copies of {statement.source!r} will take",
                                   "names cube0, cube1, … in order")  # fmt: skip
        count += copies


def _check_hierarchy(blocks: tuple[Block, ...], source: Source) -> None:
    """The root reaches every block, no block contains itself, and the whole stays below MAX_CUBOIDS boxes."""
    index = {block.name: b for b, block in enumerate(blocks)}
    boxes: dict[str, int] = {}  # executed boxes inside each finished block
    open_blocks: list[tuple[str, list[tuple[int, str, int]]]] = [
        (blocks[0].name, _children(blocks[0], index))
    ]
    path = [blocks[0].name]
    while open_blocks:
        name, waiting = open_blocks[-1]
        if waiting:
            s, child, _ = waiting.pop()
            if child in path:
                raise source.error(index[name], s, child, f"block {child!r} contains itself", "no recursion")
            if child not in boxes:
                open_blocks.append((child, _children(blocks[index[child]], index)))
                path.append(child)
            continue
        block = blocks[index[name]]
        inside = _children(block, index)
        own = len(_cuboids(block)) - 1 + sum(map(clone_count, block.statements))
        boxes[name] = own + sum(copies * boxes[child] for _, child, copies in inside)
        if boxes[name] > MAX_CUBOIDS:
            raise source.error(
                index[name], -1, name, f"block {name!r} makes {boxes[name]} cuboids", f"at most {MAX_CUBOIDS}"
            )
        open_blocks.pop()
        path.pop()
    for b, block in enumerate(blocks):
        if block.name not in boxes:
            raise source.error(
                b, -1, block.name, f"block {block.name!r} is never used", "a cuboid of that name"
            )


def _cuboids(block: Block) -> list[Cuboid]:
    return [s for s in block.statements if isinstance(s, Cuboid)]


def _children(block: Block, index: dict[str, int]) -> list[tuple[int, str, int]]:
    """(statement, name, number of copies) of every cuboid of `block` that another block fills."""
    copies = {cuboid.name: 1 for cuboid in _cuboids(block)}
    for statement in block.statements:
        if clones := clone_count(statement):
            copies[statement.source] += clones
    return [(s, c.name, copies[c.name]) for s, c in enumerate(_cuboids(block)) if c.name in index]
