"""Which programs have the same structure: they differ in continuous parameters and names, and in nothing else.

What the structure is, `program_distance.tokens` says: two programs have the same one if their distance is 0. Whether a
cuboid is aligned, how often a translate copies, and the order of statements all belong to it.
"""

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence

from ..interpreters.shapeassembly import Program
from .program_distance import block_tokens, tokens


def same_structure(a: Program, b: Program) -> bool:
    """Are the two equal up to continuous parameters and names?"""
    return tokens(a) == tokens(b)


def is_novel(generated: Sequence[Program], train: Sequence[Program]) -> list[bool]:
    """For each generated program: does no training program have its structure?"""
    known = {tokens(program) for program in train}
    return [tokens(program) not in known for program in generated]


def novel_share(generated: Sequence[Program], train: Sequence[Program]) -> float:
    """Share, 0 to 1, of the generated programs whose structure no training program has (paper, section 7.1.3).

    Raises ValueError for no generated programs.
    """
    if not len(generated):
        raise ValueError("no generated programs to compare with the training programs")
    return sum(is_novel(generated, train)) / len(generated)


def clusters(programs: Sequence[Program]) -> list[list[int]]:
    """Which programs have the same structure, as lists of their places in `programs` (paper, Figure 10, whole shapes).

    The largest first, of equally large ones the one that begins first. Each program is in exactly one.
    """
    return _grouped((tokens(program), place) for place, program in enumerate(programs))


def block_clusters(programs: Sequence[Program]) -> list[list[tuple[int, int]]]:
    """The same for every block by itself, as (program, block) places (paper, Figure 10, by intermediate parts).

    That a cuboid is filled by a block belongs to the structure of the block it is in; what fills it does not.
    """
    return _grouped(
        (words, (place, block))
        for place, program in enumerate(programs)
        for block, words in enumerate(block_tokens(program))
    )


def share_in_largest(found: Sequence[Sequence], count: int) -> float:
    """Share, 0 to 1, of everything clustered that lies in the `count` largest clusters. ValueError for none at all."""
    total = sum(map(len, found))
    if not total:
        raise ValueError("no clusters: nothing was clustered")
    return sum(sorted(map(len, found), reverse=True)[:count]) / total


def _grouped(structures: Iterable[tuple[Hashable, object]]) -> list[list]:
    """Things of equal structure together, the largest group first; Python's sort keeps the order of equals."""
    groups = defaultdict(list)
    for structure, thing in structures:
        groups[structure].append(thing)
    return sorted(groups.values(), key=len, reverse=True)
