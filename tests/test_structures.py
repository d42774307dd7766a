"""Structures compared by hand."""

import pytest

from lib.metrics.structures import (
    block_clusters,
    clusters,
    is_novel,
    novel_share,
    same_structure,
    share_in_largest,
)

from .programs import program
from .test_program_distance import LEG, nested

A = program(*LEG)
A_AGAIN = program(
    "box = Cuboid(0.4, 1, 0.3, True)", "squeeze(box, bbox, bbox, top, 0.3, 0.2)", "reflect(box, X)"
)
B = program(*LEG[:2])


def test_numbers_and_names_are_no_structure():
    assert same_structure(A, A_AGAIN)
    assert same_structure(nested(), nested("Seat"))
    assert not same_structure(A, B)
    assert not same_structure(A, nested())


def test_names_cannot_hide_another_structure():
    """Two cuboids that change places are two different programs, although the same words occur."""
    two = ("a = Cuboid(1, 1, 1, True)", "b = Cuboid(1, 1, 1, True)")
    first = program(*two, "squeeze(a, bbox, bbox, top, 0.5, 0.5)", "squeeze(b, bbox, a, top, 0.5, 0.5)")
    swapped = program(*two, "squeeze(b, bbox, bbox, top, 0.5, 0.5)", "squeeze(a, bbox, b, top, 0.5, 0.5)")
    assert not same_structure(first, swapped)


def test_the_novel_share_by_hand():
    assert is_novel([A_AGAIN, B, nested(), B], [A]) == [False, True, True, True]
    assert novel_share([A_AGAIN, B, nested(), B], [A]) == 0.75
    assert novel_share([A, B], [A_AGAIN, B]) == 0
    assert novel_share([A, B], []) == 1


def test_other_sizes_are_never_novel(programs):
    resized = [each.with_parameters(each.parameters() * 0.9) for each in programs]
    assert novel_share(resized, programs) == 0


def test_clusters_of_whole_programs():
    assert clusters([B, A, nested(), A_AGAIN]) == [[1, 3], [0], [2]]
    assert clusters([]) == []


def test_clusters_of_blocks():
    """The leg block is the same at the root of A and inside `nested`."""
    found = block_clusters([A, nested(), nested("Seat"), B])
    assert found == [[(0, 0), (1, 1), (2, 1)], [(1, 0), (2, 0)], [(3, 0)]]


def test_every_program_and_block_is_in_one_cluster(programs):
    whole, blocks = clusters(programs), block_clusters(programs)
    assert sorted(sum(whole, [])) == list(range(len(programs)))
    assert sorted(sum(blocks, [])) == [(i, j) for i, p in enumerate(programs) for j in range(len(p.blocks))]
    for found in (whole, blocks):
        assert [len(one) for one in found] == sorted(map(len, found), reverse=True)


def test_the_share_in_the_largest_clusters():
    assert share_in_largest([[1, 2, 3], [4], [5, 6]], 2) == pytest.approx(5 / 6)
    assert share_in_largest([[1]], 10) == 1


def test_nothing_has_no_share():
    with pytest.raises(ValueError, match="no generated programs"):
        novel_share([], [A])
    with pytest.raises(ValueError, match="nothing was clustered"):
        share_in_largest([], 3)


@pytest.mark.parametrize("category, whole, blocks", [("storage", 1319, 1573)])
def test_clusters_of_the_real_programs(category, whole, blocks, real_texts, unchecked_shapes):
    """Blocks repeat more than whole programs do (Figure 10). Counted with this definition; a change of it shows."""
    from lib.interpreters.shapeassembly import parse

    real = [parse(text) for text in real_texts[category].values()]
    assert len(real) == 1551
    assert (len(clusters(real)), len(block_clusters(real))) == (whole, blocks)
    assert sum(len(each.blocks) for each in real) / blocks > 1.9 * len(real) / whole
