"""Tokens and edits counted by hand; laws of a distance."""

import pytest
import torch

from lib.interpreters.shapeassembly import Program, parse
from lib.metrics.program_distance import (
    block_tokens,
    nearest_programs,
    program_distance,
    program_distances,
    tokens,
)

from .programs import block_text, program

LEG = ("leg = Cuboid(0.2, 1, 0.2, True)", "squeeze(leg, bbox, bbox, top, 0.1, 0.5)", "reflect(leg, X)")


def nested(outer: str = "Program_1", *more: str) -> Program:
    """A box that a block fills, and what else stands in that block."""
    return parse(
        block_text(f"{outer} = Cuboid(1, 1, 1, False)", f"attach({outer}, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)")
        + block_text(*LEG, *more, name=outer)
    )


def test_the_tokens_of_a_flat_program():
    found = tokens(program(*LEG, "translate(leg, Z, 3, 0.5)"))
    assert found == (
        *("Cuboid", "aligned", "squeeze", "cube0", "bbox", "bbox", "top"),
        *("reflect", "cube0", "X", "translate", "cube0", "Z", "3"),
    )


def test_a_block_stands_inside_the_cuboid_that_it_fills():
    inner = ("Cuboid", "aligned", "squeeze", "cube0", "bbox", "bbox", "top", "reflect", "cube0", "X")
    assert tokens(nested()) == ("Cuboid", "free", "{", *inner, "}", "attach", "cube0", "bbox")
    assert block_tokens(nested()) == [("Cuboid", "free", "{", "}", "attach", "cube0", "bbox"), inner]


@pytest.mark.parametrize(
    "lines, edits",
    [
        (
            ("leg = Cuboid(0.3, 1.5, 0.2, True)", "squeeze(leg, bbox, bbox, top, 0.4, 0.4)", LEG[2]),
            0,
        ),  # numbers
        (
            (
                "cube0 = Cuboid(0.2, 1, 0.2, True)",
                "squeeze(cube0, bbox, bbox, top, 0, 0)",
                "reflect(cube0, X)",
            ),
            0,
        ),
        ((LEG[0], LEG[1], "reflect(leg, Z)"), 1),  # another axis
        (("leg = Cuboid(0.2, 1, 0.2, False)", *LEG[1:]), 1),  # not aligned
        (LEG[:2], 3),  # no reflect: three tokens fewer
        ((LEG[0], "squeeze(leg, bbox, bbox, bot, 0.1, 0.5)"), 4),  # and another face
        ((*LEG[:2], "translate(leg, X, 2, 0.5)"), 2),  # another command, and a count
    ],
)
def test_edits_counted_by_hand(lines, edits):
    assert program_distance(program(*LEG), program(*lines)) == edits


def test_filling_a_box_costs_the_block_and_its_braces():
    box = program("box = Cuboid(1, 1, 1, False)", "attach(box, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)")
    assert program_distance(box, nested()) == 10 + 2
    assert program_distance(nested(), nested("Seat")) == 0
    assert program_distance(nested(), nested("Program_1", "translate(leg, Z, 1, 0.5)")) == 4


def test_it_is_a_distance(programs):
    some = programs[:12]
    found = program_distances(some, some)
    assert torch.equal(found, found.T) and not found.diagonal().any()
    through = (found.unsqueeze(2) + found.unsqueeze(0)).amin(1)  # the best way by way of a third program
    assert (found <= through).all()
    expected = [[program_distance(a, b) for b in some] for a in some]
    assert found.tolist() == expected


def test_numbers_do_not_count(programs):
    for each in programs[:12]:
        assert program_distance(each, each.with_parameters(each.parameters() * 0.9)) == 0


def test_the_nearest_program():
    far, near, same = nested(), program(*LEG[:2]), program(*LEG)
    found = nearest_programs([program(*LEG)], [far, near, same, same])
    assert (found.index.tolist(), found.distance.tolist()) == ([2], [0])  # the first of two
    others = nearest_programs([far, near, same])
    assert others.index.tolist() == [2, 2, 1]
    assert others.distance.tolist() == [program_distance(far, same), 3, 3]


@pytest.mark.parametrize("queries, others", [(1, 0), (1, None), (0, None)])
def test_somebody_must_be_there_to_be_near(queries, others):
    with pytest.raises(ValueError, match="expected another one"):
        nearest_programs([program(*LEG)] * queries, None if others is None else [])
