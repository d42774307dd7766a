"""What is left of a decided answer: few nodes, nearly the same points."""

from dataclasses import replace

import pytest
import torch

from lib.interpreters.stump import Box, Sphere
from lib.models.simplifying import cover, simplified
from lib.models.soft_stump import SoftStump
from tests.conftest import unchecked

CROWD = torch.rand(1, 4000, 3, generator=torch.Generator().manual_seed(0)) - 0.5


def rows(*texts: str) -> torch.Tensor:
    return torch.tensor([[letter == "x" for letter in text] for text in texts])


def test_the_most_important_come_first():
    inside = rows("xx......", "..xxxx..", "....xxx.", "........")
    assert cover(inside, 1.0).tolist() == [1, 0, 2]
    assert cover(inside, 6 / 7).tolist() == [1, 0]
    assert cover(inside[:0], 1.0).tolist() == []
    assert cover(inside, 0.0).tolist() == [] == cover(rows("....", "...."), 1.0).tolist()


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99, 1.0])
def test_the_share_is_held(share):
    inside = torch.rand(20, 500, generator=torch.Generator().manual_seed(1)) < 0.15
    kept = cover(inside, share)
    assert inside[kept].any(0).sum() >= share * inside.any(0).sum()
    assert inside[kept[:-1]].any(0).sum() < share * inside.any(0).sum()


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_other_shares_are_refused(share):
    with pytest.raises(ValueError, match="expected 0 to 1"):
        cover(rows("x"), share)


def test_hidden_and_empty_nodes_go():
    """Node 0 a box, node 1 a ball within it, node 2 a ball elsewhere, node 3 where box and far ball meet: nowhere."""
    boxes = Box(torch.tensor([[[0.2, 0.2, 0.2]]]), torch.zeros(1, 1, 3))
    balls = Sphere(torch.tensor([[0.1, 0.1]]), torch.tensor([[[0, 0, 0], [0.4, 0.3, 0.3]]]))
    yes, no = 3.0, -3.0
    selects = torch.tensor([[[yes, no, no, yes], [no, yes, no, no], [no, no, yes, yes]]])
    said = SoftStump((boxes, balls), torch.full((1, 3), no), selects, torch.full((1, 4), yes))
    less = simplified(said, CROWD, 1.0)
    assert (less.union > 0).tolist() == [[True, False, True, False]]
    distances = said.distances(CROWD)
    assert torch.equal(less.inside(distances), said.inside(distances))
    assert (simplified(said, CROWD, 0.5).union > 0).tolist() == [[True, False, False, False]]
    assert (said.union > 0).all()
    with pytest.raises(ValueError, match="found points that are not finite"):
        simplified(said, CROWD * torch.nan)
    with unchecked():
        for points in (CROWD[0], CROWD[:, :0], CROWD[:0], CROWD.repeat(2, 1, 1), CROWD[..., :2]):
            with pytest.raises(ValueError, match=r"expected \(1, m, 3\), a row for each answer"):
                simplified(said, points)
    spoilt = replace(said, intersection=torch.full_like(said.intersection, torch.nan))
    for ask in (lambda: simplified(spoilt, CROWD), spoilt.stumps, lambda: spoilt.signed(distances)):
        with pytest.raises(ValueError, match="found connections that are no numbers"):
            ask()
