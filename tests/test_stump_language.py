"""The text form of a stump: read back to the last bit, helpful where it is wrong, and never anything but ProgramError.

And programs of the sister languages as stumps: the same pixels, the same boxes."""

import random

import numpy as np
import pytest
import torch

from lib.datasets import examples
from lib.interpreters import csg, shapeassembly
from lib.interpreters import stump as language
from lib.interpreters.csg.geometry import occupancy as csg_occupancy
from lib.interpreters.stump import (
    Box,
    Circle,
    Cone,
    Cylinder,
    HalfPlane,
    ProgramError,
    Sphere,
    Square,
    Stump,
    Triangle,
    execute,
    parse,
    sample,
)
from lib.interpreters.stump.converting import EDGE, csg_tree, shapeassembly_tree
from tests.conftest import unchecked
from tests.csg_programs import mask, pixels_of, random_program
from tests.csg_programs import random_primitive as random_csg_primitive
from tests.stumps import random_primitive

PLATE = """# a plate with a hole
F1 = box(half=(0.5, 0.5, 0.1))
F2 = not cylinder(radius=0.2, translation=(0, 0, 1))
S1 = F1 & F2
T = S1
"""
F, S = "F1 = sphere(radius=0.5)\n", "S1 = F1\n"
BOX = "box(half=(·, ·, ·), [translation=(·, ·, ·)], [rotation=(·, ·, ·, ·)])"
BALL = "sphere(radius=·, [translation=(·, ·, ·)], [rotation=(·, ·, ·, ·)])"
KINDS = "one of box, sphere, cylinder, cone, square, circle, triangle, halfplane"
STATEMENT = "F1 = a primitive, S1 = F1 & … or T = S1 | …"
JOINED = "S is an intersection (&) of F, T a union (|) of S"
NUMBER = "a number such as 0.25 or -1e-3"
PIXELS = torch.tensor(np.stack(np.indices((64, 64))[::-1], -1).reshape(-1, 2)).double()
MUTANTS = 4000
JUNK = [
    *("", " ", "\n", "\t", "\0", "\ufeff", "\u2028", "\u3000", "é", "٣", "１", "−", "\ud800", "\\", "%s", "{0}", "#"),
    *("(", ")", "((", "))", "()", ",", ",,", "=", "==", "&", "|", "&&", "not", "not ", "not not ", "-", "nan", "inf"),
    *("F", "S", "T", "F1", "S1", "F0", "F01", "F-1", "T1", "everything", "nothing", "1e999", "1_0", "1e-400"),
    *("0", "1", "2", "5", "55", ".", "-1", " \n", "# "),
    *("box", "sphere", "circle(radius=1)", "half", "radius=", "height=1", "rotation=(0,0,0,0)", "9" * 50, "__class__"),
]  # fmt: skip


def test_by_hand():
    stump = parse(PLATE)
    assert [p.name for p in stump.primitives] == ["box", "cylinder"]
    assert stump.complement.tolist() == [False, True]
    assert stump.intersection.tolist() == [[True], [True]] and stump.union.tolist() == [True]
    assert stump.primitives[1].translation.tolist() == [0, 0, 1] and stump.primitives[1].height is None


@pytest.mark.parametrize(
    "text",
    [
        PLATE.replace("\n", "\r\n"),
        PLATE.replace(" = ", "\t=\t"),
        "\ufeff" + PLATE,
        PLATE.replace("\n", "   \n\n  "),
        PLATE.replace(" & ", "&").replace(", ", ",").replace(" = ", "="),
        PLATE.rstrip("\n"),
        PLATE.replace("T = S1", "T = S1  # all of it"),
        PLATE.replace("half=(", "half = ( ").replace("0.2", " +.2e0 "),
    ],
)
def test_spaces_and_line_ends_do_not_matter(text):
    assert parse(text) == parse(PLATE)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_written_and_read_to_the_last_bit(dimensions, unchecked_shapes):
    rng = np.random.default_rng(dimensions)
    for number in range(200):
        k, c = int(rng.integers(1, 8)), int(rng.integers(0, 6))
        primitives = [random_primitive(rng, dimensions) for _ in range(k)]
        stump = Stump(primitives, rng.random(k) < 0.5, rng.random((k, c)) < 0.3, rng.random(c) < 0.5)
        stump = stump.to(torch.float32) if number % 2 else stump
        back = parse(stump.to_text())
        assert back == stump and back.to_text() == stump.to_text()


@pytest.mark.parametrize("number", [1e-300, -0.0, 1e22, 5e-324, -1.5, 0.1 + 0.2, 1.7976931348623157e308])
def test_any_finite_number_comes_back(number):
    stump = Stump([Sphere(number, (number, 0.0, -number))], [0], [[1]], [1])
    assert parse(stump.to_text()) == stump


@pytest.mark.parametrize(
    "matrices", [([0], [[]], []), ([1], [[0]], [1]), ([0], [[1]], [0]), ([0], [[0, 1]], [0, 1])]
)
def test_unused_primitives_and_nodes_stay(matrices):
    stump = Stump(
        [Circle(1.0)], matrices[0], torch.tensor(matrices[1]).view(1, -1), torch.tensor(matrices[2])
    )
    assert parse(stump.to_text()) == stump


@pytest.mark.parametrize(
    "text, line, column, token, found, expected",
    [
        ("", 1, 1, "", "the text has no primitives", "F1 = sphere(radius=0.5), say"),
        ("# nothing\n\n", 3, 1, "", "the text has no primitives", "F1 = sphere(radius=0.5), say"),
        ("T = nothing", 2, 1, "", "the text has no primitives", "F1 = sphere(radius=0.5), say"),
        (F + S, 3, 1, "", "the text ends", "T = S1 | …, the union of nodes"),
        (F + "  hello", 2, 3, "hello", "'hello' is no statement", STATEMENT),
        (F + "T1 = S1", 2, 1, "T1 = S1", "'T1 = S1' is no statement", STATEMENT),
        (F + "S = F1", 2, 1, "S = F1", "'S = F1' is no statement", STATEMENT),
        ("F٣ = box()", 1, 1, "F٣ = box()", "'F٣ = box()' is no statement", STATEMENT),
        (" F2 = box()", 1, 2, "F2", "'F2' is out of order", "F1: numbers count from 1 without gaps"),
        (F + "S2 = F1", 2, 1, "S2", "'S2' is out of order", "S1: numbers count from 1 without gaps"),
        (F + S + "F2 = box()", 3, 1, "F2", "'F2' stands after the nodes", "all primitives first"),
        (F + S + "T = S1\nT = S1", 4, 1, "T = S1", "'T = S1' stands after T", "nothing after T"),
        ("F1 = ", 1, 5, "", "nothing is no primitive", KINDS),
        ("F1 = cube(side=1)", 1, 6, "cube", "'cube' is no primitive", KINDS),
        ("F1 = not  ball(1)", 1, 11, "ball", "'ball' is no primitive", KINDS),
        ("F1 = not not box()", 1, 10, "not", "'not' is no primitive", KINDS),
        ("F1 = 7", 1, 6, "7", "'7' is no primitive", KINDS),
        ("F1 = sphere", 1, 6, "sphere", "'sphere' has no arguments in round brackets", BALL),
        ("F1 = sphere(radius=1", 1, 6, "sphere(radius=1", "'sphere(radius=1' has no arguments in round brackets", BALL),
        ("F1 = sphere()", 1, 6, "sphere()", "'sphere()' has no radius", BALL),
        ("F1 = sphere(0.5)", 1, 13, "0.5", "'0.5' is no argument", BALL),
        ("F1 = sphere(radius=1,)", 1, 22, "", "nothing is no argument", BALL),
        ("F1 = sphere(size=1)", 1, 13, "size", "'size' is no argument of sphere", BALL),
        ("F1 = sphere(radius=1, radius=2)", 1, 23, "radius", "'radius' is given twice", BALL),
        ("F1 = sphere(radius=big)", 1, 20, "big", "'big' in radius is no finite number", NUMBER),
        ("F1 = sphere(radius=nan)", 1, 20, "nan", "'nan' in radius is no finite number", NUMBER),
        ("F1 = sphere(radius=1e999)", 1, 20, "1e999", "'1e999' in radius is no finite number", NUMBER),
        ("F1 = sphere(radius=１)", 1, 20, "１", "'１' in radius is no finite number", NUMBER),
        ("F1 = sphere(radius=)", 1, 20, "", "nothing in radius is no finite number", NUMBER),
        ("F1 = sphere(radius=(1, 2))", 1, 20, "(1, 2)", "'(1, 2)' has 2 numbers", "radius=·"),
        ("F1 = box(half=1)", 1, 15, "1", "'1' has 1 number", "half=(·, ·, ·)"),
        ("F1 = box(half=(1, x, 2))", 1, 19, "x", "'x' in half is no finite number", NUMBER),
        ("F1 = box(half=(1, 2))", 1, 15, "(1, 2)", "'(1, 2)' has 2 numbers", "half=(·, ·, ·)"),
        ("F1 = box(half=(1,1,1), rotation=(0,0,0,0))", 1, 33, "(0,0,0,0)", "'(0,0,0,0)' turns nothing",
         "a quaternion w, x, y, z that is not zero, such as (1, 0, 0, 0)"),
        (F + "F2 = circle(radius=1)", 2, 6, "circle(radius=1)", "'circle(radius=1)' has 2 dimensions, F1 has 3",
         "box, sphere, cylinder, cone"),
        (F + "S1 = F2", 2, 6, "F2", "'F2' is no primitive here", "F1, joined by &, or everything"),
        (F + "S1 = F1 & ", 2, 10, "", "nothing is no primitive here", "F1, joined by &, or everything"),
        (F + "S1 = F1 & F1", 2, 11, "F1", "'F1' stands twice", "each one once"),
        (F + "S1 = F1 | F2", 2, 6, "F1 | F2", "'F1 | F2' is joined by |", f"&: {JOINED}"),
        (F + "S1 = not F1", 2, 6, "not F1", "'not F1' is complemented here",
         "the complement where the primitive stands: F1 = not …"),
        (F + S + "S2 = F1\nT = S1 & S2", 4, 5, "S1 & S2", "'S1 & S2' is joined by &", f"|: {JOINED}"),
        (F + S + "T = F1", 3, 5, "F1", "'F1' is no node here", "S1, joined by |, or nothing"),
        (F + "T = S1", 2, 5, "S1", "'S1' is no node here", "nothing: there is no S1"),
        (F + S + "T = S999999999999", 3, 5, "S999999999999", "'S999999999999' is no node here",
         "S1, joined by |, or nothing"),
    ],
)  # fmt: skip
def test_errors_name_the_place_and_what_was_expected(text, line, column, token, found, expected):
    with pytest.raises(ProgramError) as error:
        parse(text)
    assert (error.value.line, error.value.column, error.value.token) == (line, column, token)
    assert error.value.expected == expected
    assert str(error.value) == f"line {line}, column {column}: {found}; expected {expected}"


def test_what_is_no_text():
    with unchecked():
        for given in (None, 1, b"F1 = sphere(radius=1)", ["F1"]):
            with pytest.raises(ProgramError, match="expected a text"):
                parse(given)


def test_long_texts_end_soon(time_limit, unchecked_shapes):
    for text in (
        "F1 = a" + " " * 1_000_000 + "b",
        "F1 = sphere(radius=" + " " * 1_000_000 + "x)",
        "F1 = box(" + "(" * 1_000_000,
        F + "S1 = " + "F1 &" * 1_000_000,
        F + "T = " + " " * 1_000_000 + "|",
        "#" * 5_000_000,
        "x" * 10_000_001,
    ):
        with time_limit(5), pytest.raises(ProgramError) as error:
            parse(text)
        assert len(str(error.value)) < 400


def test_a_text_of_too_many_connections_is_refused_before_they_are_made(time_limit, unchecked_shapes):
    lines = [f"F{k} = sphere(radius=1)" for k in range(1, 5001)]
    lines += [f"S{c} = everything" for c in range(1, 15001)]
    with time_limit(30), pytest.raises(ProgramError, match="at most 67108864"):
        parse("\n".join(lines))


def test_mutants_are_read_or_refused(unchecked_shapes):
    draw, rng = random.Random(4000), np.random.default_rng(4000)
    texts = [PLATE, *(sample(rng, dimensions).to_text() for dimensions in (2, 3, 3) for _ in range(4))]
    read = 0
    for number in range(MUTANTS):
        text = draw.choice(texts)
        for _ in range(draw.choice([1, 1, 2, 4])):
            start = draw.randrange(len(text) + 1)
            stop = start + draw.choice([0, 0, 1, 2, 8])
            text = text[:start] + draw.choice([*JUNK, text[start:stop] * 2]) + text[stop:]
        try:
            stump = parse(text)
        except ProgramError as error:
            assert error.line and error.column and error.expected and len(str(error)) < 400, text
        except Exception as error:
            pytest.fail(f"mutant {number}: {type(error).__name__}: {error}\n{text!r}")
        else:
            assert parse(stump.to_text()) == stump
            read += 1
    assert MUTANTS / 40 < read < MUTANTS / 2


# What stumps are built of.


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: Sphere(None), "a sphere has no radius"),
        (lambda: Triangle(0.1, None, 0.3), "a triangle has no right"),
        (lambda: Triangle(0.1, 0.2, None), "a triangle has no height"),
        (lambda: Cone(None, 1.0), "a cone has no slope"),
        (lambda: Box(None), "a box has no half"),
        (lambda: Square(None), "a square has no half"),
        (lambda: Sphere(torch.tensor(1j)), "expected real numbers"),
        (lambda: Sphere(np.array(1j)), "expected real numbers"),
        (lambda: Sphere(torch.ones(1).to_sparse()), "expected real numbers, not sparse"),
        (lambda: Sphere(10**400), "a number that is too large"),
        (lambda: Sphere(10**5000), "a number that is too large"),
        (lambda: Sphere("a"), "found 'a'; expected numbers"),
        (
            lambda: Cylinder(torch.ones(2), torch.ones(3)),
            r"height of a cylinder is a batch of shape \(3,\).* \(2,\)",
        ),
        (lambda: Sphere(torch.ones(2), torch.ones(3, 3)), "translation of a sphere is a batch"),
        (lambda: Circle(torch.ones(5), rotation=torch.ones(4)), "rotation of a circle is a batch"),
        (lambda: Box(0.5), r"half of a box has the shape \(\); expected 3 numbers"),
        (lambda: Box.from_paper(torch.rand(8)), "for a box; expected 10: rotation, translation, half"),
        (lambda: Box.from_paper(torch.rand(9)), "for a box; expected 10"),
        (lambda: Sphere.from_paper(torch.rand(7)), "for a sphere; expected 8"),
        (
            lambda: Cone.from_paper(torch.rand(10)),
            "for a cone; expected 9: rotation, translation, slope, height",
        ),
        (
            lambda: Sphere(0.5).with_numbers(torch.rand(7)),
            "for a sphere; expected 8: radius, translation, rotation",
        ),
    ],
)
def test_what_is_no_primitive(make, words):
    with unchecked(), pytest.raises(ProgramError, match=words):
        make()


@pytest.mark.parametrize(
    "number", [torch.tensor(2), torch.tensor(True), np.float32(2), np.array([4, 2])[::-1]]
)
def test_whole_numbers_become_floats(number):
    with unchecked():
        sphere = Sphere(number)
    assert all(getattr(sphere, key).dtype == torch.float64 for key in sphere.written)
    assert sphere.distance(torch.zeros(1, 3)).flatten()[0] == -float(sphere.radius.flatten()[0])


def test_floating_tensors_keep_their_type_and_their_gradient():
    radius = torch.tensor(0.5, dtype=torch.float32, requires_grad=True)
    assert Sphere(radius).radius is radius and Sphere(radius).rotation.dtype == torch.float32


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_numbers_follow_the_tensors_beside_them(dtype):
    for sphere in (Sphere(0.1, torch.zeros(3, dtype=dtype)), Sphere(torch.ones(2, dtype=dtype), [0.1, 0, 0])):
        assert all(getattr(sphere, key).dtype == dtype for key in sphere.written)
        assert sphere.distance(torch.zeros(1, 3)).dtype == dtype


@pytest.mark.parametrize(
    "make, batch",
    [
        (lambda: Sphere(0.5, translation=[[0, 0, 0]]), (1,)),
        (lambda: Sphere([0.5, 0.6], [0, 0, 0]), (2,)),
        (lambda: Cylinder([0.5, 0.4], 1.0), (2,)),
        (lambda: Cylinder([[0.5], [0.4]], [1.0, 2.0, 3.0]), (2, 3)),
        (lambda: HalfPlane([[1, 2], [3, 4]], 0.1), (2,)),
        (lambda: HalfPlane(rotation=[0.1, 0.2, 0.3]), (3,)),
        (lambda: HalfPlane([1, 2], [0.1]), ()),
        (lambda: Circle([0.5, 0.6], rotation=[[0.1], [0.2]]), (2,)),
        (lambda: Circle(0.5, rotation=torch.tensor(0.1)), ()),
        (lambda: Circle([0.5], rotation=[0.1]), (1,)),
    ],
)
def test_what_is_shared_by_a_batch(make, batch):
    """All fields get the same batch, and each single one of it is what one would write by hand."""
    with unchecked():
        made = make()
        assert made.numbers.shape == (*batch, sum(made.widths[key] for key in made.written))
        assert made.translation.shape == (*batch, made.dimensions)
        again = type(made)(**{key: getattr(made, key) for key in made.written})
        assert again == made and again.rotation.shape == made.rotation.shape
        assert made.with_numbers(made.numbers) == made
        points = torch.rand(4, made.dimensions, dtype=torch.float64)
        assert made.distance(points).shape == (*batch, 4)


@pytest.mark.parametrize("name", language.KINDS)
def test_the_paper_s_order_has_all_numbers(name, unchecked_shapes):
    kind = language.KINDS[name]
    width = kind.dimensions + (4 if kind.dimensions == 3 else 1) + sum(kind.counts.values())
    made = kind.from_paper(torch.rand(5, width, generator=torch.Generator().manual_seed(0)))
    assert made.numbers.shape == (5, width)
    if name in ("cylinder", "cone"):
        assert kind.from_paper(torch.rand(5, width - 1)).height is None


@pytest.mark.parametrize(
    "given",
    [
        torch.tensor([0, 1]).to_sparse(),
        torch.zeros(2, device="meta"),
        np.array([0, None]),
        [10**400, 0],
        [0.5, 1],
        None,
    ],
    ids=str,
)
def test_what_is_no_matrix(given):
    with unchecked(), pytest.raises(ProgramError, match=r"complement .*expected \(2\) of 0 and 1"):
        Stump([Sphere(0.5), Sphere(0.4)], given, [[1], [1]], [1])


def test_matrices_of_any_layout_and_byte_order():
    for given in (np.array([0, 1])[::-1], np.array([1, 0], dtype=">i4")):
        stump = Stump([Sphere(0.5), Sphere(0.4)], given, [[1], [1]], [1])
        assert stump.complement.tolist() == [True, False]


def test_a_stump_keeps_matrices_of_its_own():
    given = torch.tensor([True]), np.array([[True]]), torch.tensor([True])
    stump = Stump([Sphere(0.5)], *given)
    text = stump.to_text()
    for matrix in given:
        matrix[:] = False
    assert stump.to_text() == text


def test_what_is_no_stump():
    with unchecked():
        for given in (None, 7):
            with pytest.raises(ProgramError, match="expected a sequence of them"):
                Stump(given, [0], [[1]], [1])
        stump = Stump([Sphere(0.5)], [0], [[1]], [1])
        for given in ("a", None, [1.0] * 7, torch.ones(8) * 1j):
            with pytest.raises(ProgramError):
                stump.with_parameters(given)
        assert stump.with_parameters(torch.ones(8, dtype=torch.int64)).primitives[0].radius == 1


# Programs of the sister languages.


def stump_pixels(stump: Stump) -> np.ndarray:
    """[row y, column x], as pictures are."""
    return execute(stump).occupancy(PIXELS.to(stump.primitives[0].translation)).view(64, 64).numpy()


def stump_voxels(stump: Stump) -> np.ndarray:
    """[x, y, z]."""
    points = torch.tensor(np.stack(np.indices((64, 64, 64)), -1).reshape(-1, 3)).double()
    return execute(stump).occupancy(points).view(64, 64, 64).numpy()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_every_primitive_of_the_plane_has_its_pixels(dtype, unchecked_shapes):
    rng = np.random.default_rng(0)
    given = [*csg.vocabulary_of(2).primitives, *(random_csg_primitive(rng, 2) for _ in range(200))]
    given += [csg.Primitive("t", (x, y, r)) for x, y in ((0, 0), (1, 0), (31, 33)) for r in range(1, 65, 3)]
    for primitive in given:
        stump = Stump.from_csg(csg.Program((primitive,))).to(dtype)
        assert np.array_equal(stump_pixels(stump), mask(primitive)), primitive


@pytest.mark.parametrize("kind", ["sp", "cu", "cy"])
def test_primitives_of_space_have_their_voxels(kind, unchecked_shapes):
    rng = np.random.default_rng(1)
    words = [p for p in csg.vocabulary_of(3).primitives if p.kind == kind]
    given = [words[k] for k in rng.permutation(len(words))[:6]]
    given += [csg.Primitive(kind, (3, 60, 31, r, 5)[: 5 if kind == "cy" else 4]) for r in (1, 2, 6, 33, 64)][
        :5
    ]
    for primitive in given:
        assert np.array_equal(stump_voxels(Stump.from_csg(csg.Program((primitive,)))), mask(primitive)), (
            primitive
        )


@pytest.mark.parametrize("dimensions, count", [(2, 200), (3, 12)])
def test_csg_programs_have_their_pixels(dimensions, count, unchecked_shapes):
    rng = np.random.default_rng(2)
    look = stump_pixels if dimensions == 2 else stump_voxels
    for number in range(count):
        program = random_program(rng, dimensions, (1, 3, 5, 7, 9)[number % (5 if dimensions == 2 else 4)])
        assert np.array_equal(look(Stump.from_csg(program)), pixels_of(program)), program.to_text()


@pytest.mark.parametrize("dimensions", [2, 3])
def test_between_the_pixels_too(dimensions, unchecked_shapes):
    """Points nearer to an edge than it was moved are left out."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        program = random_program(rng, dimensions, 7)
        stump = Stump.from_csg(program)
        points = torch.from_numpy(rng.uniform(-3, 67, (1000, dimensions)))
        clear = points[(stump.distances(points).abs() > 2 * EDGE).all(0)]
        assert len(clear) > 900
        assert torch.equal(execute(stump).occupancy(clear), csg_occupancy(program, clear))


def test_a_triangle_by_hand():
    """t(32,32,2): rows 30 to 33, and a half-plane that cuts the tip off half a pixel above the first."""
    tree = csg_tree(csg.parse("t(32,32,2)"))
    assert tree.operation.symbol == "*" and isinstance(tree.right, HalfPlane)
    assert tree.right.translation[1] == 29.5 and tree.left.translation[1] == 33.5


def test_shapeassembly_programs_have_their_boxes(sampled, unchecked_shapes):
    """Points nearer than 1e-9 to a face are left out: there, rounding decides."""
    generator = torch.Generator().manual_seed(0)
    for program in [*sampled[:40], *examples().values()]:
        shape, stump = shapeassembly.execute(program), Stump.from_shapeassembly(program)
        low, high = shape.bounds()
        points = torch.rand(500, 3, generator=generator, dtype=torch.float64) * (high - low) * 1.1 + low
        points = torch.cat([points, shape.surface_points(200).double() * (1 - 1e-7)])
        clear = points[(stump.distances(points).abs() > 1e-9).all(0)]
        assert torch.equal(execute(stump).occupancy(clear), shape.occupancy(clear))
        assert stump.intersection.shape[1] <= len(shape.cuboids)


def test_other_programs_do_not_convert():
    program = csg.parse("c(32,32,8)")
    with unchecked():
        for given in (None, "c(32,32,8)", program.tree()):
            with pytest.raises(ProgramError, match="expected a csg.Program"):
                csg_tree(given)
        with pytest.raises(ProgramError, match="expected a shapeassembly.Program"):
            shapeassembly_tree(program)
