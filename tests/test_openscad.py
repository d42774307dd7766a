"""OpenSCAD files as texts: what is written is read back exactly, edits are read as edits, all else is refused."""

import re

import numpy as np
import pytest
import torch

from lib.interpreters import csg, shapeassembly, stump
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.openscad import Parts, ScadError, read, write
from lib.interpreters.openscad.parsing import parse
from lib.interpreters.openscad.printing import to_text
from lib.interpreters.stump import KINDS, Stump
from lib.interpreters.stump.poses import ANGLES

from .conftest import unchecked
from .csg_programs import chain, random_program

MUG = """F1 = cylinder(radius=0.3, height=0.6)
F2 = not cylinder(radius=0.25, height=0.6, translation=(0.0, 0.0, 0.1))
F3 = box(half=(0.05, 0.2, 0.2), translation=(0.0, 0.4, 0.0), rotation=(0.9, 0.1, 0.0, 0.2))
F4 = not cone(slope=0.5)
S1 = F1 & F2
S2 = F2 & F3
S3 = everything
T = S1 | S2
"""
FLAT = """F1 = square(half=(0.5, 0.3), rotation=0.3)
F2 = not circle(radius=0.2)
F3 = halfplane(translation=(0.1, 0.2), rotation=-1.0)
F4 = triangle(left=0.1, right=0.3, height=0.4)
S1 = F1 & F2
S2 = F3 & F4
T = S1 | S2
"""


def random_stump(rng: np.random.Generator, dimensions: int) -> Stump:
    """Any kinds, numbers and matrices; nodes and primitives may be unused, and nodes empty."""
    kinds = [kind for kind in KINDS.values() if kind.dimensions == dimensions]
    primitives = []
    for _ in range(rng.integers(1, 8)):
        kind = kinds[rng.integers(len(kinds))]
        endless = kind.dimensions == 3 and rng.random() < 0.5
        widths = {key: n for key, n in kind.counts.items() if not (endless and key == "height")}
        widths |= {"translation": dimensions, "rotation": ANGLES[dimensions]}
        given = {key: random_numbers(rng, n) for key, n in widths.items()}
        primitives.append(kind(**{key: v if len(v) > 1 else v[0] for key, v in given.items()}))
    nodes, share = rng.integers(0, 6), rng.random()
    return Stump(
        tuple(primitives),
        rng.random(len(primitives)) < 0.4,
        rng.random((len(primitives), nodes)) < share,
        rng.random(nodes) < 0.7,
    )


def random_numbers(rng: np.random.Generator, count: int) -> list[float]:
    """Mostly of size 1; now and then very small, very large, whole, or negative zero. Never all zero."""
    numbers = rng.normal(size=count) * 10.0 ** rng.choice([0, 0, 0, 0, -300, -9, 20], count)
    numbers = np.where(rng.random(count) < 0.1, rng.choice([-0.0, 0.0, 1.0, -2.0], count), numbers)
    return (numbers if numbers.any() else np.ones(count)).tolist()


def bits(parts: Parts) -> tuple[torch.Tensor, ...]:
    boxes = parts.cuboids
    return tuple(numbers.contiguous().view(torch.int64) for numbers in (boxes.size, boxes.center, boxes.axes))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_any_stump_is_read_back(dimensions, unchecked_shapes):
    rng = np.random.default_rng(dimensions)
    for _ in range(80):
        made = random_stump(rng, dimensions)
        text = made.to_openscad()
        assert read(text) == made
        assert write(read(text)) == text


def test_a_stump_in_single_precision_is_read_back():
    made = stump.parse(MUG).to(torch.float32)
    assert read(made.to_openscad()) == made


@pytest.mark.parametrize("dimensions", [2, 3])
def test_any_program_is_read_back(dimensions, unchecked_shapes):
    rng = np.random.default_rng(dimensions)
    programs = [random_program(rng, dimensions, length) for length in range(1, 40, 2) for _ in range(4)]
    for program in [*programs, csg.sample(rng, dimensions=dimensions)]:
        text = program.to_openscad()
        assert read(text) == program
        assert write(read(text)) == text


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_longest_program_is_read_back(side, unchecked_shapes):
    program = csg.parse(chain(1023, side))
    assert read(program.to_openscad()) == program


def test_boxes_are_read_back_bit_for_bit(programs, unchecked_shapes):
    for program in programs:
        shape = shapeassembly.execute(program)
        text = program.to_openscad()
        parts = read(text)
        assert parts == Parts(tuple(shape.names), shape.cuboids)
        assert all(map(torch.equal, bits(parts), bits(Parts(tuple(shape.names), shape.cuboids))))
        assert parts.to_openscad() == write(parts) == text


def test_names_that_openscad_has_or_that_collide_stay_apart():
    names = ("cube", "cuboid", "for", "a/b_c", "a_b/c", "a", "module/union")
    boxes = Cuboids(torch.ones(7, 3), torch.arange(21).view(7, 3).float(), torch.eye(3).expand(7, 3, 3))
    parts = Parts(names, boxes)
    assert read(write(parts)) == parts
    nothing = Parts((), Cuboids(torch.zeros(0, 3), torch.zeros(0, 3), torch.zeros(0, 3, 3)))
    assert read(write(nothing)) == nothing


def test_documents_are_read_as_they_are_printed():
    texts = [stump.parse(MUG), stump.parse(FLAT), csg.parse("c(9,9,9)t(9,9,9)-"), csg.parse("sp(9,9,9,9)")]
    for text in [shape.to_openscad() for shape in texts]:
        document = parse(text)
        assert parse(to_text(document)) == document
        without_comments = [
            line.split("  //")[0] for line in text.split("\n") if line and not line.startswith("//")
        ]
        assert to_text(document).splitlines() == without_comments


def test_brackets_are_printed_where_they_are_needed():
    for text in [
        "1 - (2 - 3)",
        "(1 - 2) * -3",
        "-(1 + 2)",
        "1 / (2 / 3)",
        "(a + b)[0]",
        "-a[0][1]",
        "1 - 2 - 3",
    ]:
        printed = to_text(parse(f"x = {text};"))
        assert parse(printed) == parse(f"x = {text};")
        assert printed.strip() == f"x = {text};"


@pytest.mark.parametrize(
    "old, new, wanted",
    [
        ("F1_radius = 0.3;", "F1_radius = 2*0.2;", ("radius=0.3", "radius=0.4")),
        ("F1_radius = 0.3;", "thick=.1/* mm */; F1_radius\n=\n(thick+1)/2;", ("radius=0.3", "radius=0.55")),
        ("F1_radius = 0.3;", "r = [7, [-0.5]]; F1_radius = -r[1][0]; // half", ("radius=0.3", "radius=0.5")),
        ("F3_half = [0.05, 0.2, 0.2]", "F3_half=[1,F1_radius,- -2]", ("0.05, 0.2, 0.2", "1, 0.3, 2")),
        ("F2_translation = [0.0, 0.0, 0.1]", "F2_translation = F1_translation", ("0.0, 0.0, 0.1", "0, 0, 0")),
        ("cylinder_of(F1_radius, F1_height)", "cylinder_of(F1_radius, F1_height / 2)", ("0.6", "0.3")),
        ("{ F1(); F2(); }", "{ intersection() { F1(); F3(); } F2(); }", ("S1 = F1 & F2", "S1 = F1 & F2 & F3")),
        ("union() { S1(); S2(); }", "S3();", ("T = S1 | S2", "T = S3")),
        ("\n", "\r\n\t", ("", "")),
    ],
)  # fmt: skip
def test_an_edit_is_read_as_an_edit(old, new, wanted):
    text = stump.parse(MUG).to_openscad()
    assert old in text
    assert read(text.replace(old, new)) == stump.parse(MUG.replace(*wanted, 1))


def test_edits_of_programs_and_boxes():
    text = csg.parse("c(32,32,28)s(32,20,12)-").to_openscad()
    assert read(text.replace("square_2_radius = 12", "square_2_radius = circle_1_radius / 4")).to_text() == (
        "c(32,32,28)s(32,20,7)-"
    )
    three = text.replace("{ circle_1(); square_2(); }", "{ circle_1(); square_2(); square_2(); }")
    assert read(three).to_text() == "c(32,32,28)s(32,20,12)-s(32,20,12)-"

    boxes = Cuboids(torch.ones(2, 3), torch.zeros(2, 3), torch.eye(3).expand(2, 3, 3))
    text = write(Parts(("table/top", "table/leg"), boxes))
    edited = read(text.replace("table_leg_center = [0.0", "table_leg_center = [0.5 - 2"))
    assert edited.cuboids.center.tolist() == [[0, 0, 0], [-1.5, 0, 0]]
    assert read(text.replace("  table_top();\n", "")).names == ("table/leg",)


def refused(text: str) -> ScadError:
    with pytest.raises(ScadError) as caught:
        read(text)
    return caught.value


@pytest.mark.parametrize(
    "old, new, found, expected",
    [
        ("T();", "hull() T();", "'hull', a part of OpenSCAD that is not read here", "call"),
        ("T();", "for (i = [0:3]) T();", "'for', a part of OpenSCAD", "call"),
        ("T();", "if (true) T();", "'if', a part of OpenSCAD", "call"),
        ("T();", "#T();", "'#', a part of OpenSCAD", "call"),
        ("T();", "rotate(3) T();", "'rotate'", "T();"),
        ("T();", "T(); S1();", "2 things are drawn", "only T();"),
        ("F1_radius = 0.3", "F1_radius = 0.3 > 0 ? 1 : 2", "'>', a part of OpenSCAD", "';'"),
        ("F1_radius = 0.3", "F1_radius = sqrt(2)", "the function 'sqrt'", "numbers, parameters"),
        ("F1_radius = 0.3", "F1_radius = 1 / (3 - 3)", "1 / 0 has no finite result", "a finite number"),
        ("F1_radius = 0.3", "F1_radius = 1e999", "'1e999' is too large", "a finite number"),
        ("F1_radius = 0.3", "F1_radius = [0.3]", "a vector of 1", "a number"),
        ("F1_radius = 0.3", 'F1_radius = "0.3"', "the text '0.3'", "a number"),
        ("F1_radius = 0.3", "F1_radius = F2_radius", "'F2_radius' is not set before", "from above"),
        ("F1_radius = 0.3", "F1_radius = 0.3; F1_radius = 0.4", "'F1_radius' stands twice", "once"),
        ("F1_radius = 0.3;", "F1_radius = 0.3", "found 'F1_height'", "';'"),
        ("F1_radius = 0.3", "F1_radius = 0.3 m", "found 'm'", "';'"),
        ("F1_radius = 0.3", "F1_radius = " + "1+" * 40 + "1", "more than 20 numbers", "a parameter"),
        ("F1_radius = 0.3", "F1_radius = " + "(" * 40 + "1", "nested too deep", "less"),
        ("F3_half = [0.05, 0.2, 0.2]", "F3_half = [0.05, 0.2]", "a vector of 2", "a vector of 3 numbers"),
        ("F3_rotation = [0.9, 0.1, 0.0, 0.2]", "F3_rotation = [0, 0, 0, 0]", "rotation is zero", "quaternion"),
        ("{ F1(); F2(); }", "{ F2(); F1(); }", "is kept here, and not in another node|cut out", "the same"),
        ("{ F1(); F2(); }", "{ F1(); F1(); }", "F1 stands twice", "each once"),
        ("{ F1(); F2(); }", "{ F1(); F9(); }", "'F9'", "F1 to F4"),
        ("{ F1(); F2(); }", "{ F1(); F2() F3(); }", "'F3' after F2()", "';'"),
        ("module F1()", "module F9()", "found F9", "module F1 too"),
        ("module F1()", "module F1(x)", "the function or the parameters of 'F1'", "without parameters"),
        ("module F1()", "module G()", "module 'G'", "F1, F2"),
        ("module F1()", "module union()", "'union' is OpenSCAD's own", "another name"),
        ("F1_height =", "PI =", "'PI' is OpenSCAD's own", "another name"),
        ("module placed(translation", "module placed(shift", "'placed' is not as we write it", "unchanged"),
        ("2 * abs(half[0])", "abs(half[0])", "'box_of' is not as we write it", "unchanged"),
        ("box_of(F3_half)", "square_of(F3_half)", "'square_of' has no definition", "helper"),
        ("box_of(F3_half)", "box_of(half = F3_half)", "box_of with 'half'", "1 arguments without names"),
        ("box_of(F3_half)", "cube(F3_half)", "'cube'", "box_of or sphere_of"),
        ('"CSG-Stump"', '"Python"', "the text 'Python'", "CSG-Stump"),
        ("// F1: cylinder", "/* F1", "a comment is never closed", "'*/'"),
        ('"CSG-Stump"', '"CSG-Stump', "is never closed", "in one line"),
        ("// F1: cylinder", "é", "found 'é'", "a name"),
    ],
)  # fmt: skip
def test_what_is_not_in_the_subset_is_refused_by_name_and_place(old, new, found, expected):
    text = stump.parse(MUG).to_openscad()
    assert old in text
    changed = text.replace(old, new) if old != "T();" else text.replace("\nT();", f"\n{new}")
    error = refused(changed)
    assert any(part in str(error) for part in found.split("|")), str(error)
    assert expected in error.expected
    assert error.line and error.column, str(error)


def with_parameter(text: str, name: str, value: str) -> str:
    """The text, a parameter's line changed."""
    changed, count = re.subn(rf"(?m)^{re.escape(name)} = .*$", lambda _: value, text)
    assert count == 1
    return changed


@pytest.mark.parametrize("name", ["language", "$fn", "window_low", "F1_radius", "F3_half", "F4_rotation"])
def test_a_small_text_of_a_huge_value_is_refused_at_once(name, time_limit):
    """Each vector holds the one above it twice; whoever looks at all of the last one never ends."""
    huge = "a0 = [1];" + "".join(f"a{k + 1} = [a{k}, a{k}];" for k in range(60))
    with unchecked(), time_limit(5):
        error = refused(with_parameter(stump.parse(MUG).to_openscad(), name, f"{huge} {name} = a60;"))
    assert "a vector of 2" in str(error) and error.line


def test_long_files_take_time_in_proportion(unchecked_shapes, time_limit):
    with time_limit(30):  # copying the rest of the file for every statement took ten times that
        assert len(parse("a = 1;" * 100_000).statements) == 100_000


@pytest.mark.parametrize("value", ["", "$fn = 0;", '$fn = "a";', "$fn = 2;", "$fn = 4.5;", "$fn = [9];"])
def test_corners_of_circles_are_a_whole_number(value):
    for shape in (stump.parse(MUG), csg.parse("c(9,9,9)")):
        error = refused(with_parameter(shape.to_openscad(), "$fn", value))
        assert "$fn" in str(error) and "a whole number, at least 3" in error.expected


@pytest.mark.parametrize(
    "name, value, found",
    [
        ("window_low", "", "no parameter 'window_low'"),
        ("window_high", "", "no parameter 'window_high'"),
        ("window_low", "window_low = 3;", "the number 3"),
        ("window_low", "window_low = [-9, 9, -9];", "window_low is 9 in y"),
        ("height", "", "no parameter 'height'"),
        ("height", "height = 0;", "height is the number 0"),
    ],
)  # fmt: skip
def test_windows_and_plates_have_a_size(name, value, found):
    shape = stump.parse(FLAT if name == "height" else MUG)
    assert found in str(refused(with_parameter(shape.to_openscad(), name, value)))


def test_endless_names_all_that_the_shape_has(unchecked_shapes):
    text = stump.parse(MUG).to_openscad()
    start = text.index("function endless")
    head, tail = text[:start], text[start:]
    assert read(head + tail.replace("F4_translation", "F4_translation, 3 * 4", 1)) == stump.parse(MUG)
    for old, new in [
        ("F3_half, ", ""),
        ("2 * norm", "norm"),
        ("norm", "sqrt"),
        ("F3_half", "$fn, language"),
    ]:
        error = refused(head + tail.replace(old, new, 1))
        assert "endless()" in str(error) and error.line
    assert "no function 'endless'" in str(refused(re.sub("function endless[^;]*;", "", text)))
    wide = stump.parse("F1 = cone(slope=1e200, height=1e200)\nF2 = cylinder(radius=1)\nS1 = F1 & F2\nT = S1")
    with pytest.raises(ScadError, match="farther than any number"):
        write(wide)


def test_a_helper_that_another_one_needs_is_missed():
    text = stump.parse(MUG).to_openscad()
    assert "'swollen' has no definition" in str(refused(re.sub("function swollen.*", "", text)))


def test_marks_of_other_systems():
    text = stump.parse(MUG).to_openscad()
    assert read("\ufeff" + text) == read(text.replace("\n", "\r\n")) == stump.parse(MUG)
    assert "a carriage return alone" in str(refused(text.replace("\n", "\r")))


def test_an_error_points_at_the_number_that_is_wrong():
    text = csg.parse("c(32,32,28)").to_openscad()
    error = refused(text.replace("circle_1_radius = 28", "circle_1_radius =   2.5"))
    row = text[: text.index("circle_1_radius = 28")].count("\n") + 1
    assert (error.line, error.column) == (row, len("circle_1_radius =   ") + 1)
    assert "r is '2.5'" in str(error) and error.expected == "a whole number"
    assert refused(text.replace("[32, 32]", "[32, 99]")).line == row - 1


@pytest.mark.parametrize(
    "text, found",
    [
        ("", "no parameter 'language'"),
        ('language = "CSG";', "no module 'shape'"),
        ('language = "CSG-Stump";', "no primitive"),
        ('language = "CSG"; module shape() union();', "an empty union"),
        ('language = "CSG"; module shape() cube(3);', "'cube'"),
        ('language = "ShapeAssembly"; module a() { a(); } a();', "'a' is drawn twice"),
        ('language = "ShapeAssembly"; rotate([0, 90, 0]) a();', "another rotation"),
        (
            'language = "ShapeAssembly"; module part(path) children(); module a() part(3) b(); a();',
            "found no name",
        ),
        ("x = 1; module module() {}", "found 'module'"),
        ("a() " * 2000 + ";", "1024 calls are nested"),
        ("a() {", "the text ends"),
        ("x = [1, 2", "the text ends"),
        ("a(", "the text ends"),
        ("x", "the text ends"),
        ("x = a[0][0][0];", "a third index"),
        (" " * 10_000_001, "10000001 characters"),
    ],
)
def test_texts_that_are_no_files_of_ours(text, found):
    assert found in str(refused(text))


@pytest.mark.parametrize(
    "names, found",
    [
        (("a",), "1 names for boxes"),
        (("a", "a"), "two boxes are named 'a'"),
        (("a", 'b"'), "found the name"),
        (("a", "b"), "not finite"),
    ],
)
def test_parts_that_no_file_can_hold(names, found):
    size = torch.tensor([[1.0, 1.0, 1.0], [1.0, 1.0, torch.nan if names == ("a", "b") else 1.0]])
    with pytest.raises(ScadError, match=found):
        Parts(names, Cuboids(size, torch.zeros(2, 3), torch.eye(3).expand(2, 3, 3)))


def test_what_is_no_text_and_no_shape(unchecked_shapes):
    for names in (None, ("a",)):
        with pytest.raises(ScadError, match="and a NoneType"):
            Parts(names, None)
    for call in (read, write):
        with pytest.raises(ScadError, match="found a int"):
            call(3)


def test_damaged_files_are_refused_or_read(time_limit):
    """Letters, words and lines are removed, doubled, exchanged: nothing but ScadError, and no other surprise."""
    rng = np.random.default_rng(0)
    boxes = shapeassembly.sample(np.random.default_rng(3))
    texts = [stump.parse(MUG), stump.parse(FLAT), csg.parse("c(32,32,28)s(32,20,12)-t(9,9,9)+"), boxes]
    texts = [shape.to_openscad() for shape in texts]
    refusals = 0
    with unchecked(), time_limit(60):
        for _ in range(400):
            text = damaged(rng, texts[rng.integers(len(texts))])
            try:
                shape = read(text)
            except ScadError:
                refusals += 1
                continue
            assert read(write(shape)) == shape
    assert 150 < refusals < 400  # damage to comments and numbers can be harmless


def damaged(rng: np.random.Generator, text: str) -> str:
    for _ in range(rng.integers(1, 4)):
        place, length = rng.integers(len(text)), rng.integers(0, 12)
        other = rng.integers(len(text))
        inserted = rng.choice(
            ["", text[other : other + length], *'{}()[];=,+-*/."9eF$\x00é%#', "for", "T()", "1e308"]
        )
        text = text[:place] + inserted + text[place + length :]
    return text
