"""Ways to hold a cuboid: the misfit that is predicted is the one that a program has, and squeezes are two attaches."""

import pytest
import torch

from lib.extractor import RejectedError
from lib.extractor.contacts import BOTTOM, INSIDE, TOP
from lib.extractor.placing import APART, DIGITS, bounding_box, judge, squeeze_points, ways_to_place
from lib.extractor.writing import attach_statements
from lib.interpreters.shapeassembly import Attach, Block, Cuboid, Program, Squeeze, execute_many, expand
from lib.interpreters.shapeassembly.program import FACES

from .conftest import unchecked
from .graphs import CATEGORIES, blocks, extracted, facts_of, leaf, tensor, turn

NAMES = {BOTTOM: "bbox", TOP: "bbox", INSIDE: "bbox"}


def program_of(block, way) -> Program:
    """The upright partners of a way put exactly where they belong, then the way itself."""
    names = NAMES | {i: f"cube{i}" for i in range(len(block.parts))}
    partners = sorted({partner for partner in way.partners if partner >= 0})
    lines = [Cuboid("bbox", tuple(block.size.tolist()), True)]
    lines += [
        Cuboid(names[i], tuple(block.boxes.size[i].tolist()), bool(block.aligned[i]))
        for i in (*partners, way.cuboid)
    ]
    for i in partners:
        place = bounding_box(block.size).local(block.boxes.center[i]).tolist()
        lines.append(Attach(names[i], "bbox", (0.5, 0.5, 0.5, *place)))
    return Program((Block("Program_0", (*lines, *attach_statements(way, names))),))


def cases() -> list:
    """Some ways of each furniture block whose partners can be placed exactly: those that are upright."""
    found = []
    for category in CATEGORIES:
        for extraction in extracted(category, 20):
            for block in blocks(extraction.facts) if extraction.facts else []:
                ways = [
                    way
                    for i, upright in enumerate(block.aligned.tolist())
                    for way in ways_to_place(i, block.contacts, block.boxes, block.size, not upright)
                    if all(p < 0 or block.aligned[p] for p in way.partners)
                ]
                found += [(block, way) for way in ways[:: max(1, len(ways) // 8)]]
    return found


def test_misfits_are_those_of_the_program():
    """1e-9: the same arithmetic in another order, on blocks of about 1; amplified where an attach stretches."""
    with unchecked():
        chosen = cases()
        shapes = execute_many([program_of(block, way) for block, way in chosen])
        kinds = set()
        for number, (block, way) in enumerate(chosen):
            predicted = judge([way], block.boxes, block.aligned, block.size).item()
            made = shapes[number].cuboids[-1:].corners()
            misfit = (made - block.boxes[way.cuboid : way.cuboid + 1].corners()).norm(dim=-1).max().item()
            assert predicted == pytest.approx(misfit, abs=1e-9), (way, block.parts)
            kinds.add((bool(block.aligned[way.cuboid]), len(way.partners), bool(way.face)))
    assert len(chosen) > 400
    assert kinds >= {
        (True, 1, False),
        (True, 2, False),
        (True, 2, True),
        (False, 1, False),
        (False, 2, False),
    }


def test_judging_many_is_judging_each():
    block = facts_of(leaf((2, 0.2, 2), (0, 0.9, 0)), leaf((0.2, 1.8, 0.2), (0.5, -0.1, 0.5)))
    together = judge(list(block.ways), block.boxes, block.aligned, block.size)
    alone = [judge([way], block.boxes, block.aligned, block.size).item() for way in block.ways]
    assert together.tolist() == alone and len(alone) > 5
    assert len(judge([], block.boxes, block.aligned, block.size)) == 0


def test_squeezes_are_two_attaches():
    """What the language makes of a squeeze is what was judged."""
    with unchecked():
        squeezes = [(block, way) for block, way in cases() if way.face]
        assert {way.face for _, way in squeezes} >= {"bot", "top", "left", "right"}
        for block, way in squeezes:
            *_, first, second = expand(program_of(block, way).blocks[0]).statements
            wanted = [(*on, *at) for on, at in way.points]
            assert [list(s.numbers) for s in (first, second)] == [pytest.approx(w, abs=1e-9) for w in wanted]


@pytest.mark.parametrize("face", FACES)
def test_every_face_can_be_squeezed(face):
    """Between two cuboids, and against the bounding box, which holds from outside."""
    for partners, names in (((0, 1), ("a", "b")), ((BOTTOM, TOP), ("bbox", "bbox"))):
        (on, at), (opposite, other) = squeeze_points(face, *partners, (0.2, 0.3, 0.4))
        text = [Cuboid("bbox", (4, 4, 4), True), *(Cuboid(n, (1, 1, 1), True) for n in ("a", "b", "c"))]
        text += [Attach("a", "bbox", (0.5,) * 3 + (0.1,) * 3), Attach("b", "bbox", (0.5,) * 3 + (0.9,) * 3)]
        axis = next(k for k in range(3) if on[k] != 0.5)
        u, v = ([0.2, 0.3, 0.4][k] for k in range(3) if k != axis)
        *_, first, second = expand(Block("Program_0", (*text, Squeeze("c", *names, face, (u, v))))).statements
        assert first.numbers == pytest.approx((*on, *at)) and second.numbers == pytest.approx(
            (*opposite, *other)
        )


def test_places_have_three_digits_and_are_apart():
    block = facts_of(leaf((2, 0.2, 2), (0, 0.9, 0)), leaf((0.2, 1.81234, 0.2), (0.512345, -0.1, 0.5)))
    assert DIGITS == 3
    for way in block.ways:
        assert all(x == round(x, 3) and 0 <= x <= 1 for pair in way.points for point in pair for x in point)
        if len(way.points) == 2:
            (p, _), (q, _) = way.points
            assert sum(abs(a - b) for a, b in zip(p, q)) >= APART


def test_a_leg_between_floor_and_seat_is_squeezed():
    block = facts_of(leaf((2, 0.2, 2), (0, 0.9, 0), "seat"), leaf((0.2, 1.8, 0.2), (0.5, -0.1, 0.5), "leg"))
    leg = [part.label for part in block.parts].index("leg")
    best = next(way for way in block.ways if way.cuboid == leg)
    assert (best.face, best.partners) == (
        "bot",
        (BOTTOM, 1 - leg),
    ) and best.misfit < 0.002  # three digits of 2
    assert not any(
        way.face for way in ways_to_place(leg, block.contacts, block.boxes, block.size, False, False)
    )


@pytest.mark.parametrize("degrees", [10, 25, 40])
@pytest.mark.parametrize("axis", [0, 2])
def test_a_tilted_leg_is_turned_right(degrees, axis):
    """Between a floor and a seat; 0.02: three digits of local coordinates, twice, over a length of 2."""
    size, axes = tensor([0.1, 1.7, 0.1]), turn(degrees, axis)
    reach = (size[:, None] * axes).abs().sum(0)
    height = reach[1].item() + 0.2
    center = (0, -height / 2 + reach[1].item() / 2, 0)
    leg = leaf(size.tolist(), center, "leg", axes)
    block = facts_of(leg, leaf((3, 0.2, 3), (0, height / 2 - 0.1, 0), "seat"), size=(3, height, 3))
    number = [part.label for part in block.parts].index("leg")
    best = next(way for way in block.ways if way.cuboid == number)
    assert not block.aligned[number] and len(best.partners) == 2 and best.misfit < 0.02


def test_what_cannot_be_computed_is_the_worst():
    """A partner whose numbers are none: the way is there, and nobody takes it."""
    block = facts_of(leaf((2, 0.2, 2), (0, 0.9, 0)), leaf((0.2, 1.8, 0.2), (0.5, -0.1, 0.5)))
    boxes = block.boxes
    broken = type(boxes)(boxes.size * torch.nan, boxes.center, boxes.axes)
    assert (judge(list(block.ways), broken, block.aligned, block.size) == torch.inf).all()


def test_what_touches_nothing_is_named():
    with pytest.raises(RejectedError, match="no chain of contacts holds lamp"):
        facts_of(leaf((0.1, 0.1, 0.1), label="lamp"))
