"""The ten solids: closed, of one size, in the middle, made of all kinds of primitives."""

import pytest
import torch

from lib.datasets import SOLIDS, DataError, solid
from lib.datasets.solids import bounds
from lib.interpreters.csg import Tree
from lib.interpreters.stump import KINDS, Box, Sphere, Stump, execute


def leaves(tree) -> list:
    return [*leaves(tree.left), *leaves(tree.right)] if isinstance(tree, Tree) else [tree]


def inside(tree, points):
    """Straight from the tree: what the stumps are compared with."""
    if not isinstance(tree, Tree):
        return tree.distance(points) <= 0
    left, right = inside(tree.left, points), inside(tree.right, points)
    return {"union": left | right, "intersect": left & right, "subtract": left & ~right}[tree.operation.name]


def test_there_are_ten_with_the_names_that_were_asked_for():
    assert len(SOLIDS) == 10 and {"bracket", "bolt", "mug", "hinge", "table", "chair"} <= {*SOLIDS}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_has_diagonal_one_around_the_origin(name):
    low, high = bounds(solid(name))
    assert (high - low).norm() == pytest.approx(1) and (low + high).norm() < 1e-12


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_a_stump_with_a_closed_surface_that_fills_its_bounds(name, unchecked_shapes):
    stump = Stump.from_tree(solid(name))
    mesh = execute(stump).mesh()
    assert mesh.is_watertight
    # 2 %: a mesh of 64 corners lies a little inside of round walls or outside
    assert mesh.bounds == pytest.approx(bounds(solid(name)).numpy(), abs=0.02)
    points = torch.rand(2000, 3, generator=torch.manual_seed(0), dtype=torch.float64) - 0.5
    assert torch.equal(execute(stump).occupancy(points), inside(solid(name), points))


def test_all_kinds_of_primitives_and_operations_occur_and_some_are_turned():
    every = [leaf for name in SOLIDS for leaf in leaves(solid(name))]
    assert {type(leaf) for leaf in every} == {kind for kind in KINDS.values() if kind.dimensions == 3}
    assert any(leaf.rotation[1:].abs().max() > 0.1 for leaf in every if isinstance(leaf, Box))
    assert all(torch.isfinite(leaf.sizes).all() for leaf in every)
    assert sum(isinstance(leaf, Sphere) for leaf in every) >= 3


def test_the_mug_holds_water_and_the_bolt_is_full():
    middle = torch.tensor([[-0.1, 0.0, 0.0]], dtype=torch.float64)
    assert not inside(solid("mug"), middle).any()
    assert inside(solid("bolt"), 0 * middle).all()


def test_another_name_is_told_the_names():
    with pytest.raises(DataError, match="no solid 'teapot'; expected one of bracket, bolt"):
        solid("teapot")
