"""squeeze, reflect, translate and the hierarchy: what each stands for, worked out here a second time, and its quirks.

The box is 2 wide, so local (0, 1/2, 1) are world (-1, 0, 1). A test of a quirk fails if the quirk is mended.
"""

import numpy as np
import pytest
import torch

from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly import Shape, execute, expand, parse, trace
from lib.interpreters.shapeassembly.program import FACES, Block, Program
from tests.programs import block_text, program, run

EXACT = 1e-12  # a few float64 operations on numbers near 1
GUARDED = 1e-7  # divisors carry + 1e-8 where a cuboid was stretched, as the authors' do


def tensor(*numbers) -> torch.Tensor:
    return torch.tensor(numbers, dtype=torch.float64)


def check_same(found: Cuboids, wanted: Cuboids, tolerance: float = EXACT) -> None:
    for name in ("size", "center", "axes"):
        torch.testing.assert_close(getattr(found, name), getattr(wanted, name), rtol=0, atol=tolerance)


def point_set(corners: torch.Tensor) -> list[list[float]]:
    """Corners in an order of their own: a mirrored box has the same eight, numbered differently."""
    return sorted((corners.detach() / GUARDED).round().mul(GUARDED).round(decimals=5).tolist())


def center(shape: Shape, name: str) -> list[float]:
    """Center of the leaf with this path."""
    return shape.cuboids.center[shape.names.index(name)].tolist()


# squeeze

TWO = ["cube0 = Cuboid(0.6, 0.5, 0.7, True)", "cube1 = Cuboid(0.2, 0.3, 0.4, False)"]
GROUND = "attach(cube0, bbox, 0.5, 0.0, 0.5, 0.4, 0.1, 0.6)"


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize(
    "first, second", [("bbox", "bbox"), ("bbox", "cube0"), ("cube0", "bbox"), ("cube0", "cube0")]
)
def test_squeeze_is_two_attaches(face, first, second):
    """Paper, Appendix B: the face's center onto `first`, the opposite one's onto `second`, both at (u, v)."""
    axis = {"right": 0, "left": 0, "top": 1, "bot": 1, "front": 2, "back": 2}[face]
    side = 1.0 if face in ("right", "top", "front") else 0.0

    def attach(partner: str, end: float) -> str:
        point, place = [0.5, 0.5, 0.5], [0.3, 0.8]
        point[axis] = end
        place.insert(axis, end if partner == "bbox" else 1 - end)  # the bbox is met from inside
        return f"attach(cube1, {partner}, {', '.join(map(str, point + place))})"

    squeezed = run(*TWO, GROUND, f"squeeze(cube1, {first}, {second}, {face}, 0.3, 0.8)")
    attached = run(*TWO, GROUND, attach(first, side), attach(second, 1 - side))
    check_same(squeezed.cuboids, attached.cuboids, tolerance=0)


# reflect


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("seed", range(4))
def test_reflect_is_the_mirror_image_of_what_hangs_on_the_box(axis, seed):
    """Whatever way the source was turned. This fails, too, if a clone starts with its source's orientation."""
    foot, head = np.random.default_rng(seed).uniform(0.2, 0.8, (2, 3)).round(3)
    shape = run(
        "cube0 = Cuboid(0.3, 0.5, 0.2, False)",
        f"attach(cube0, bbox, 0.4, 0.0, 0.7, {foot[0]}, {foot[1]}, {foot[2]})",
        f"attach(cube0, bbox, 0.5, 1.0, 0.2, {head[0]}, {head[1]}, {head[2]})",
        f"reflect(cube0, {axis})",
    )
    source, clone = shape.cuboids.corners()
    mirror = torch.ones(3, dtype=torch.float64)
    mirror["XYZ".index(axis)] = -1
    assert point_set(clone) == point_set(source * mirror)
    assert point_set(clone) != point_set(source)


TOWER = ["cube0 = Cuboid(0.5, 0.5, 0.5, True)", "cube1 = Cuboid(0.2, 0.2, 0.2, True)"]
LEFT = [
    "attach(cube0, bbox, 0.5, 0.0, 0.5, 0.125, 0.0, 0.5)",
    "attach(cube1, cube0, 0.5, 0.0, 0.5, 0.5, 1.0, 0.5)",
]


def test_quirk_a_mirror_image_clings_to_its_sources_partner():
    """cube1 stands on cube0, far left. Its image belongs far right, where cube0 is not: it is clamped onto cube0."""
    shape = run(*TOWER, *LEFT, "reflect(cube0, X)", "reflect(cube1, X)")
    assert shape.names == [f"Program_0/cube{i}" for i in range(4)]
    torch.testing.assert_close(
        shape.cuboids.center,
        tensor([-0.75, -0.75, 0], [-0.75, -0.4, 0], [0.75, -0.75, 0], [-0.5, -0.4, 0]),
        rtol=0,
        atol=EXACT,
    )


def test_a_copy_has_the_size_and_place_that_its_source_has_in_the_end():
    """cube0 grows from 0.5 to 1.2 after it was placed by its middle; the place recorded then is stale."""
    shape = run(
        "cube0 = Cuboid(0.3, 0.5, 0.3, True)",
        "cube1 = Cuboid(2, 0.3, 1, True)",
        "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.25, 0.125, 0.5)",  # from -1 to -0.5
        "attach(cube1, bbox, 0.5, 0.0, 0.5, 0.5, 0.6, 0.5)",  # a shelf at 0.2
        "attach(cube0, cube1, 0.5, 1.0, 0.5, 0.25, 0.0, 0.5)",
        "reflect(cube0, X)",
    )
    torch.testing.assert_close(shape.cuboids.size[[0, 2], 1], tensor(1.2, 1.2), rtol=0, atol=EXACT)
    torch.testing.assert_close(
        shape.cuboids.center[2] * tensor(-1, 1, 1), shape.cuboids.center[0], rtol=0, atol=EXACT
    )


# translate


@pytest.mark.parametrize("axis", "XYZ")
@pytest.mark.parametrize("count", [1, 3])
def test_translate_adds_equally_spaced_copies(axis, count):
    shape = run(
        "cube0 = Cuboid(0.1, 0.2, 0.3, True)",
        "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.3, 0.2, 0.1)",
        f"translate(cube0, {axis}, {count}, 0.6)",
        bbox="1, 2, 3",
    )
    assert len(shape.cuboids) == 1 + count  # count is how many are added
    length = 0.6 * {"X": 1, "Y": 2, "Z": 3}[axis]
    direction = tensor(*(float(axis == other) for other in "XYZ"))
    for step in range(count + 1):
        wanted = shape.cuboids.center[0] + direction * length * step / count
        torch.testing.assert_close(shape.cuboids.center[step], wanted, rtol=0, atol=EXACT)
    assert (shape.cuboids.size == shape.cuboids.size[0]).all()


def test_quirk_copies_stop_at_the_edge_of_their_partner():
    shape = run(
        *TOWER, *LEFT, "translate(cube1, X, 2, 0.4)"
    )  # 0.4 and 0.8 to the right of -0.75; the edge is -0.5
    assert shape.cuboids.center[2:, 0].tolist() == pytest.approx([-0.5, -0.5], abs=EXACT)


# all of them as Cuboid and attach


def test_expand_leaves_only_cuboids_and_attaches_and_the_same_result(sampled):
    for each in sampled:
        for block in each.blocks:
            plain = expand(block)
            assert {statement.command for statement in plain.statements} <= {"Cuboid", "attach"}
            before = trace(block)[-1].cuboids
            after = trace(Block(plain.name, plain.statements))[-1].cuboids
            check_same(after, before, tolerance=1e-9)  # a copy's places went to local coordinates and back


def test_trace_ends_with_the_whole_block():
    flat = program(*TOWER, *LEFT, "reflect(cube0, X)", "translate(cube1, Z, 2, 0.2)")
    states = trace(flat.blocks[0])
    assert [len(state.cuboids) for state in states] == [0, 1, 2, 2, 2, 3, 5]
    check_same(states[-1].cuboids, execute(flat).cuboids, tolerance=0)
    assert states[2].cuboids.center.eq(0).all()  # declared, not attached yet


# hierarchy


def nested(*blocks: str) -> Shape:
    return execute(parse("".join(blocks)))


def test_what_fills_its_box_takes_its_place():
    """A block of one cuboid as large as its bbox: the leaf is the box, stretched and turned as that is."""
    shape = nested(
        block_text(
            "Program_1 = Cuboid(0.3, 0.5, 0.2, False)",
            "attach(Program_1, bbox, 0.5, 0.0, 0.5, 0.3, 0.1, 0.4)",
            "attach(Program_1, bbox, 0.5, 1.0, 0.5, 0.7, 0.8, 0.2)",
            "reflect(Program_1, X)",
        ),
        block_text(
            "cube0 = Cuboid(0.3, 0.5, 0.2, True)",
            "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)",
            bbox="0.3, 0.5, 0.2",
            name="Program_1",
        ),
    )
    assert shape.names == ["Program_0/Program_1/cube0", "Program_0/cube1/cube0"]
    boxes = shape.boxes[[1, 2]]
    assert (boxes.axes[0] != torch.eye(3)).any() and (boxes.size[0] != tensor(0.3, 0.5, 0.2)).any()
    assert list(map(point_set, shape.cuboids.corners())) == list(map(point_set, boxes.corners()))


CHILD = block_text(  # off the center of its box in every direction
    "cube0 = Cuboid(0.1, 0.1, 0.1, True)",
    "attach(cube0, bbox, 0.5, 0.5, 0.5, 0.6, 0.7, 0.8)",
    bbox="1, 1, 1",
    name="Program_2",
)


def test_quirk_contents_are_scaled_but_not_their_positions():
    """The box is twice as large as its block says: contents double, their offset from the center stays."""
    shape = nested(
        block_text(
            "Program_2 = Cuboid(2, 2, 2, True)", "attach(Program_2, bbox, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5)"
        ),
        CHILD,
    )
    torch.testing.assert_close(shape.cuboids.size[0], tensor(0.2, 0.2, 0.2), rtol=0, atol=EXACT)
    torch.testing.assert_close(shape.cuboids.center[0], tensor(0.1, 0.2, 0.3), rtol=0, atol=EXACT)


BOX_ON_THE_LEFT = ("{0} = Cuboid(1, 1, 1, True)", "attach({0}, bbox, 0.5, 0.5, 0.5, 0.25, 0.5, 0.5)")


def left_box(name: str, *lines: str) -> tuple[str, ...]:
    return (*(line.format(name) for line in BOX_ON_THE_LEFT), *lines)


def test_reflect_mirrors_the_contents_of_a_box():
    shape = nested(block_text(*left_box("Program_2", "reflect(Program_2, X)")), CHILD)
    assert center(shape, "Program_0/Program_2/cube0") == pytest.approx([-0.4, 0.2, 0.3], abs=EXACT)
    assert center(shape, "Program_0/cube1/cube0") == pytest.approx([0.4, 0.2, 0.3], abs=EXACT)


def test_translate_repeats_the_contents_of_a_box():
    shape = nested(block_text(*left_box("Program_2", "translate(Program_2, X, 1, 0.5)")), CHILD)
    assert center(shape, "Program_0/cube1/cube0") == pytest.approx([0.6, 0.2, 0.3], abs=EXACT)


def test_quirk_a_box_within_a_mirrored_box_is_turned_not_mirrored():
    """One level further down, (0.1, 0.2, 0.3) becomes (0.1, -0.2, -0.3): half a turn about x, no mirror image."""
    shape = nested(
        block_text(*left_box("Program_1", "reflect(Program_1, X)")),
        block_text(
            "Program_2 = Cuboid(1, 1, 1, True)",
            "attach(Program_2, bbox, 0.5, 0.5, 0.5, 0.6, 0.5, 0.5)",
            bbox="1, 1, 1",
            name="Program_1",
        ),
        CHILD,
    )
    assert center(shape, "Program_0/Program_1/Program_2/cube0") == pytest.approx([-0.3, 0.2, 0.3], abs=EXACT)
    assert center(shape, "Program_0/cube1/Program_2/cube0") == pytest.approx([0.5, -0.2, -0.3], abs=EXACT)


def test_names_parents_and_leaves_agree(sampled):
    for each in sampled:
        shape = execute(each)
        names, parents = shape.box_names, shape.parents
        assert names[0] == "Program_0" and parents[0] == -1 and len(set(names)) == len(names)
        for name, parent in zip(names[1:], parents[1:], strict=True):
            assert name.rpartition("/")[0] == names[parent]
        assert parents[1:] == sorted(parents[1:])  # breadth-first
        leaves = [i for i, leaf in enumerate(shape.is_leaf) if leaf]
        assert set(leaves).isdisjoint(parents) and shape.names == [names[i] for i in leaves]
        check_same(shape.cuboids, shape.boxes[leaves], tolerance=0)


def test_leaves_are_in_the_order_of_declaration_then_copies(sampled):
    for each in sampled:
        shape = execute(Program((each.blocks[0],))) if len(each.blocks) == 1 else execute(each)
        inside = [n.split("/")[1] for n, p in zip(shape.box_names, shape.parents, strict=True) if p == 0]
        declared = [s.name for s in each.blocks[0].statements if s.command == "Cuboid"][1:]
        assert inside[: len(declared)] == declared
        assert inside[len(declared) :] == [f"cube{i}" for i in range(len(declared), len(inside))]
