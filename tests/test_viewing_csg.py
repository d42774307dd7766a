"""Figures of CSG programs say what is there; the trace obeys its laws; the playground works without a browser."""

import re

import numpy as np
import pytest
import torch
from matplotlib.backends.backend_agg import FigureCanvasAgg

from lib.interpreters.csg import (
    Primitive,
    Program,
    ProgramError,
    execute,
    execute_many,
    parse,
    trace,
    vocabulary_of,
)
from lib.interpreters.csg.tracing import missing, parse_start
from lib.viewing.canvas import (
    COLOR_A,
    COLOR_B,
    COLORS,
    image_of,
    overlap,
    show_difference,
    show_pictures,
    show_primitives,
)  # fmt: skip
from lib.viewing.playground import Playground
from lib.viewing.running import show_stack, show_tree
from lib.viewing.voxels import exact_mesh, show_solids, voxel_mesh

RING = "c(32,32,28)c(32,32,20)-"
HOUSE = "s(32,40,24)t(32,16,16)+s(32,48,8)-c(48,32,8)-"
DEEP = "c(16,16,8)s(16,16,8)t(32,32,16)c(40,40,8)s(48,48,8)+-*+"
CUP = "cu(32,32,32,32)sp(32,32,48,16)-"


def pixels(figure) -> np.ndarray:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3]


def has_color(figure, color: str) -> bool:
    rgb = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    return bool((np.abs(pixels(figure).astype(int) - rgb).max(axis=-1) < 12).any())  # 12: smoothing of edges


def stamps(figure) -> int:
    """How many pictures are on the page."""
    return len(figure.axes[0].images)


# The trace


@pytest.mark.parametrize("text", [RING, HOUSE, DEEP, CUP, "c(3,4,5)"])
def test_the_last_stack_holds_what_the_program_makes(text):
    steps = trace(parse(text))
    (last,) = steps[-1].stack
    assert len(steps) == len(parse(text))
    assert last.program == parse(text) and torch.equal(last.words, execute(parse(text)).words)


@pytest.mark.parametrize("text", [RING, HOUSE, DEEP, CUP])
def test_every_entry_is_what_its_own_tokens_make(text):
    program, depth = parse(text), 0
    for place, step in enumerate(trace(program)):
        taken = len(step.taken)
        depth += 1 - taken
        assert taken == (0 if isinstance(step.token, Primitive) else 2)
        assert len(step.stack) == depth
        written = [statement for entry in step.stack for statement in entry.program.statements]
        assert written == list(program.statements[: place + 1])
        for entry in step.stack:
            assert torch.equal(entry.words, execute(entry.program).words)


def test_operands_are_what_stood_on_the_stack():
    steps = trace(parse(HOUSE))
    for before, step in zip(steps, steps[1:]):
        assert step.taken == before.stack[len(before.stack) - len(step.taken) :]
    assert [str(shape.program) for shape in steps[2].taken] == ["s(32,40,24)", "t(32,16,16)"]


def test_half_written_programs_have_a_trace_too():
    start = parse_start(HOUSE[:33])  # two primitives of three are waiting for their operation
    assert len(trace(start)[-1].stack) == 2 and missing(start) == 1
    assert trace(()) == [] and missing(()) == 0 and missing(parse(RING).statements) == 0


@pytest.mark.parametrize("text", ["", " ", "$c(", "c(1,2,3) c(4,5,6)$+", RING, "c(+3,4,5)c(4,5,6)c(7,8,9)"])
def test_the_start_of_a_program_is_read(text):
    tokens = "".join(map(str, parse_start(text)))
    assert tokens == text.partition("$")[0].replace(" ", "").replace("+3", "3")


@pytest.mark.parametrize(
    "text, column", [("c(1,2,3)+", 9), ("c(1,2,3) c(4", 10), ("c(1,2,3)q", 9), ("c(99,2,3)", 1)]
)
def test_what_begins_no_program_says_where(text, column):
    with pytest.raises(ProgramError) as error:
        parse_start(text)
    assert error.value.column == column


def test_a_trace_of_no_program_is_refused():
    with pytest.raises(ProgramError, match="finds 1 shape"):
        trace(parse(RING).statements[::2])
    with pytest.raises(ProgramError, match="in the plane"):
        trace([*parse(CUP).statements, *parse(RING).statements])


# Figures in the plane


def test_whatever_makes_a_picture_may_be_given():
    shape = execute(parse(RING))
    for given in (
        RING,
        parse(RING),
        shape,
        shape.image,
        shape.image.numpy(),
        shape.image.numpy().astype(float),
    ):
        assert np.array_equal(image_of(given), shape.image.numpy())


@pytest.mark.parametrize(
    "given, problem",
    [
        (3, TypeError),
        (np.zeros((2, 2, 2)), ValueError),
        (np.full((4, 4), 0.5), ValueError),
        (execute(parse(CUP)), TypeError),
    ],
)
def test_what_makes_no_picture_is_named(given, problem):
    with pytest.raises(problem, match="image"):
        image_of(given)


@pytest.mark.parametrize("show", [show_tree, show_stack, show_pictures, show_primitives, image_of])
def test_programs_of_space_are_sent_to_show_solids(show):
    for given in (CUP, parse(CUP)):
        with pytest.raises(TypeError, match="found a Program in space; .*show_solids of lib.viewing.voxels"):
            show(given)


def test_shapes_of_space_are_sent_to_show_solids():
    for given, found in ((execute(parse(CUP)), "a Solid"), (execute_many([parse(CUP)]), "Shapes")):
        with pytest.raises(TypeError, match=f"found {found} in space; .*show_solids"):
            show_pictures(given)
    with pytest.raises(TypeError, match="found a Primitive in space; .*show_solids"):
        show_stack(parse(CUP).statements)


def test_a_sheet_has_every_picture_pixel_for_pixel():
    figure = show_pictures([RING, HOUSE], ["ring", "house"], scale=1)
    assert stamps(figure) == 2 and [text.get_text() for text in figure.axes[0].texts] == ["ring", "house"]
    dark = (pixels(figure) < 80).all(axis=-1)
    assert np.array_equal(dark[5:67, 5:67], image_of(RING)[1:63, 1:63])  # without the frame


def test_a_sheet_of_shapes_crosses_out_what_was_no_program():
    tokens = torch.tensor([[0, 1, 396], [0, 396, 1], [5, 399, 399]])
    shapes = execute_many(tokens)
    assert shapes.valid.tolist() == [True, False, True]
    figure = show_pictures(shapes)
    assert stamps(figure) == 3 and len(figure.axes[0].lines) == 1


@pytest.mark.parametrize("count", [0, 1, 7, 60])
def test_a_sheet_fits_the_page(count):
    figure = show_pictures(torch.ones(count, 64, 64, dtype=torch.bool))
    assert stamps(figure) == count and figure.get_figwidth() <= 8


def test_titles_must_be_as_many_as_the_pictures():
    for show in (show_pictures, show_primitives):
        with pytest.raises(ValueError, match="1 titles for 2"):
            show([RING, HOUSE], ["one"])


def test_long_titles_break_after_a_token():
    figure = show_pictures([HOUSE] * 6, [HOUSE] * 6)
    assert figure.axes[0].texts[0].get_text() == "s(32,40,24)\nt(32,16,16)+\ns(32,48,8)-\nc(48,32,8)-"


@pytest.mark.parametrize("title", ["c(32,32,8)$$", "$", r"$\frac{$", "$x$ and $y$"])
def test_dollars_in_titles_are_letters(title):
    figures = [
        show_pictures([RING], [title]),
        show_difference(RING, HOUSE, (title, title)),
        show_primitives([RING], [title]),
        show_solids([CUP], [title], size=1),
    ]
    for figure in figures:
        pixels(figure)
        ax = figure.axes[0]
        texts = [*ax.texts, ax.xaxis.label, *(ax.get_legend().get_texts() if ax.get_legend() else ())]
        assert any(title in text.get_text() for text in texts)
        assert not any(text.get_parse_math() for text in texts if text.get_text())


def test_a_difference_counts_its_three_parts():
    figure = show_difference(RING, "c(32,32,24)", ("target", "found"))
    a, b = image_of(RING), image_of("c(32,32,24)")
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    expected = [("only target", a & ~b), ("both", a & b), ("only found", b & ~a)]
    assert labels == [f"{name} {part.sum():,}" for name, part in expected]
    assert has_color(figure, COLOR_A) and has_color(figure, COLOR_B)
    assert overlap(a, a) == 1 == overlap(a & ~a, b & ~b) and overlap(a, ~a) == 0
    with pytest.raises(ValueError, match="same size"):
        show_difference(a, np.zeros((8, 8)))


def test_primitives_are_outlined_in_the_colours_of_their_kinds():
    figure = show_primitives(HOUSE)
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels == ["circle", "square", "triangle", "cut away"]
    assert all(has_color(figure, color) for color in COLORS.values())
    dashed = [patch for patch in figure.axes[0].patches if patch.get_linestyle() not in ("-", "solid")]
    assert len(dashed) == 2
    # Cut away from what is cut away: it is there.
    twice = show_primitives("c(32,32,28)c(32,32,20)c(32,32,8)--")
    assert sum(patch.get_linestyle() not in ("-", "solid") for patch in twice.axes[0].patches) == 1


@pytest.mark.parametrize("title", ["", "one", "one\ntwo", "one\ntwo\nthree"])
def test_titles_and_the_legend_have_room(title):
    figure = show_primitives([HOUSE, RING], [title, "short"] if title else None)
    FigureCanvasAgg(figure).draw()
    legend = figure.axes[0].get_legend().get_window_extent()
    assert legend.y0 >= 0
    for text in figure.axes[0].texts:
        assert not text.get_text() or text.get_window_extent().y0 >= legend.y1 - 1  # dots


# The program as it runs


@pytest.mark.parametrize("text", [RING, HOUSE, DEEP])
def test_the_strip_shows_every_entry_of_every_stack(text):
    figure, steps = show_stack(text), trace(parse(text))
    assert stamps(figure) == sum(len(step.stack) for step in steps)
    written = [text.get_text() for text in figure.axes[0].texts]
    assert [word for word in written if word in map(str, parse(text).statements)] == [
        str(s.token) for s in steps
    ]
    assert written.count("A") == written.count("B") == sum(bool(step.taken) for step in steps)
    assert has_color(figure, COLOR_A) and has_color(figure, COLOR_B)
    assert figure.get_figwidth() <= 8


def test_the_strip_of_a_long_or_half_written_program():
    assert show_stack(DEEP, columns=4).get_figheight() > show_stack(DEEP, columns=9).get_figheight()
    assert stamps(show_stack(parse_start("c(32,32,28)c(32,32,20)"))) == 3
    assert stamps(show_stack(())) == 0


@pytest.mark.parametrize("text", ["c(32,32,8)", RING, HOUSE, DEEP])
def test_the_tree_has_a_picture_for_every_token(text):
    figure = show_tree(text)
    assert stamps(figure) == len(parse(text)) and len(figure.axes[0].lines) == len(parse(text)) - 1
    corners = {tuple(image.get_extent()) for image in figure.axes[0].images}
    assert len(corners) == len(parse(text)), "two pictures lie on one another"


# Solids


def test_voxels_make_a_watertight_mesh_of_their_own_volume():
    shape, mesh = execute(parse(CUP)), voxel_mesh(CUP)
    assert mesh.is_watertight and mesh.volume == pytest.approx(shape.on)
    # 31 voxels from 17 to 47, z up:
    assert np.allclose(mesh.bounds, [[16.5, 16.5, -47.5], [47.5, 47.5, -16.5]])


def test_up_is_up_and_the_exact_surface_lies_on_the_voxels():
    post = "cy(16,24,40,4,16)"
    for mesh in (voxel_mesh(post), exact_mesh(post)):
        assert mesh.bounds.mean(axis=0) == pytest.approx([16, 40, -24], abs=0.6)  # x, z up, y to the back
    # 5%: the rim of the bowl.
    assert exact_mesh(CUP).volume == pytest.approx(voxel_mesh(CUP).volume, rel=0.05)


def test_solids_stand_side_by_side():
    figure = show_solids([CUP, CUP], ["voxels", "exact"], exact=[False, True], size=1)
    assert len(figure.axes) == 2 and pixels(figure).min() < 150
    assert len(show_solids(torch.zeros(64, 64, 64, dtype=torch.bool), size=1).axes) == 1
    with pytest.raises(ValueError, match="one for all"):
        show_solids([CUP], exact=[True, False])
    with pytest.raises(TypeError, match="Picture"):
        show_solids(RING)
    with pytest.raises(ValueError, match="expected grid"):
        voxel_mesh(np.zeros((2, 2)))


@pytest.mark.parametrize(
    "kind", [torch.bool, torch.uint8, torch.int64, torch.float32, torch.bfloat16], ids=str
)
def test_grids_of_any_numbers_are_booleans(kind):
    row = torch.tensor([1, 2, 0]).view(3, 1, 1).to(kind)
    assert voxel_mesh(row).volume == pytest.approx(2) and len(voxel_mesh(row).faces) == 20
    array = np.array([1, 2, 0]).reshape(3, 1, 1)
    assert np.array_equal(voxel_mesh(row).vertices, voxel_mesh(array).vertices)
    assert len(show_solids(torch.ones(4, 4, 4, dtype=kind), size=1).axes) == 1


# The playground without a browser


@pytest.fixture
def playground() -> Playground:
    return Playground()


def click(playground, action: str, *arguments) -> None:
    """What the browser sends for a click."""
    playground._on_message(playground, {"do": action, "with": list(arguments)}, [])


def test_clicks_build_a_program(playground):
    assert playground.program is None and playground.text == "" and "Empty" in playground.view["status"]
    click(playground, "push", "c(32,32,28)")
    click(playground, "push", "c(32,32,20)")
    assert playground.program is None
    assert "2 shapes on the stack: one more operation" in playground.view["status"]
    assert playground.view["entries"] == ["c(32,32,20)", "c(32,32,28)"], "the top comes first"
    click(playground, "push", "-")
    assert playground.program == parse(RING) and playground.text == RING and playground.view["valid"]
    assert playground.tokens == ["c(32,32,28)", "c(32,32,20)", "-"]
    assert playground.view["entries"] == ["c(32,32,28) - c(32,32,20)"]


def test_the_browser_is_sent_the_bits_of_the_stack():
    playground = Playground("c(32,32,28)c(24,32,8)")
    sent = np.unpackbits(np.frombuffer(playground.pictures, np.uint8), bitorder="little").reshape(-1, 64, 64)
    assert np.array_equal(sent, [image_of("c(24,32,8)"), image_of("c(32,32,28)")])
    playground.kind, playground.size = "t", 12
    sent = np.unpackbits(np.frombuffer(playground.stencils, np.uint8), bitorder="little").reshape(
        7, 7, 64, 64
    )
    assert np.array_equal(sent[2, 4], image_of("t(40,24,12)"))  # row y, column x


def test_the_grid_says_where_the_networks_have_no_word(playground):
    for kind in "cst":
        for size in range(8, 33, 4):
            playground.kind, playground.size = kind, size
            words = [f"{kind}({x},{y},{size})" for y in range(8, 57, 8) for x in range(8, 57, 8)]
            known = [word in vocabulary_of(2).texts for word in words]
            assert [not reason for reason in playground.refused] == known


@pytest.mark.parametrize(
    "token, reason",
    [
        ("+", "'+' combines two shapes, the stack holds 1 shape"),
        ("c(8,8,32)", "the circle would stick out of the canvas"),
        ("c(10,8,8)", "networks: centers are 8, 16, … 56, sizes 8, 12, … 32"),
        ("c(99,8,8)", "off the canvas"),
        ("sp(32,32,32,8)", "it is in space"),
        ("c(32,32,8)c(32,32,8)", "2 tokens in"),
        (
            "$",
            "'$' ends what a network writes; here a program ends with its last token; expected a primitive",
        ),
        ("", "0 tokens in"),
        ("q", "is no token"),
    ],
)
def test_what_cannot_be_pushed_is_refused_with_the_reason(token, reason):
    playground = Playground("c(32,32,28)")
    with pytest.raises(ProgramError, match=re.escape(reason)):
        playground.push(token)
    click(playground, "push", token)
    assert reason in playground.view["error"]["message"] and playground.text == "c(32,32,28)"
    click(playground, "push", "c(32,32,8)")
    assert playground.view["error"] is None


def test_operations_wait_for_two_shapes(playground):
    assert all("no shape" in reason for reason in playground.view["operations"].values())
    playground.load("c(32,32,28)c(32,32,20)")
    assert not any(playground.view["operations"].values())


def test_undo_and_redo_travel_through_all_changes(playground):
    for token in ("c(32,32,28)", "c(32,32,20)", "-"):
        playground.push(token)
    playground.clear()
    playground.load(HOUSE)
    seen = []
    while playground.view["undo"]:
        seen.append(playground.text)
        click(playground, "undo")
    assert seen == [HOUSE, "", RING, RING[:-1], "c(32,32,28)"] and playground.text == ""
    while playground.view["redo"]:
        playground.redo()
    assert playground.text == HOUSE
    playground.undo()
    playground.push("c(32,32,8)")
    assert not playground.view["redo"], "a new change forgets what was undone"
    with pytest.raises(ProgramError, match="nothing to redo"):
        playground.redo()
    with pytest.raises(ProgramError, match="nothing to undo"):
        Playground(RING).undo()


def test_looking_back_shows_the_stack_of_then(playground):
    playground.load(HOUSE)
    for place, step in enumerate(trace(parse(HOUSE))):
        click(playground, "look", place)
        assert playground.view["shown"] == place and len(playground.pictures) == 512 * len(step.stack)
    click(playground, "look", 99)
    assert "no token 99" in playground.view["error"]["message"]
    playground.look()
    assert playground.view["shown"] == 6 and playground.program == parse(HOUSE)


def test_a_bad_text_is_marked_and_the_program_stays():
    playground = Playground(RING)
    click(playground, "load", "c(32,32,28) c(32,99,20) -")
    error = playground.view["error"]
    line, mark = error["excerpt"].splitlines()
    assert line[mark.index("^") : mark.rindex("^") + 1] == "c(32,99,20)"
    assert (error["start"], error["end"]) == (12, 23) and "column 13" in error["message"]
    assert playground.text == RING and playground.program is not None
    long = "c(32,32,8)" * 20 + "c(1,2)" + "+" * 19
    click(playground, "load", long)
    line, mark = playground.view["error"]["excerpt"].splitlines()
    assert line.startswith("…") and line[mark.index("^") : mark.rindex("^") + 1] == "c(1,2)"


def test_texts_may_have_any_numbers_but_only_in_the_plane(playground):
    playground.load("c(10,20,5) s(33,31,7) +")
    assert playground.program == Program(parse("c(10,20,5)s(33,31,7)+").statements)
    for make in (playground.load, Playground):
        with pytest.raises(ProgramError, match="in space"):
            make(CUP)


def test_it_may_start_from_a_program(playground):
    assert Playground(parse(RING)).text == RING
    playground.load(parse(RING))
    assert playground.program == parse(RING)
    with pytest.raises(ProgramError, match="in space"):
        Playground(parse(CUP))


def test_a_target_is_compared_with_the_top_of_the_stack():
    playground = Playground("c(32,32,28)", target=RING)
    assert playground.iou == pytest.approx(overlap(image_of("c(32,32,28)"), image_of(RING)))
    for token in ("c(32,32,20)", "-"):
        playground.push(token)
    assert playground.iou == 1 and "to the pixel" in playground.view["status"]
    assert Playground(RING).iou is None and Playground(target=RING).iou is None
    with pytest.raises(ValueError, match="expected"):
        Playground(target=np.zeros((8, 8)))


@pytest.mark.parametrize(
    "message, reason",
    [
        ({"do": "push", "with": [5]}, "the token is a int; expected a primitive such as c(32,32,8)"),
        ({"do": "push", "with": [[]]}, "the token is a list"),
        ({"do": "push", "with": []}, "push came with 0 values; expected 1"),
        ({"do": "push"}, "push came with 0 values"),
        ({"do": "push", "with": None}, "push came with a NoneType; expected a list of values"),
        ({"do": "push", "with": "+"}, "push came with a str"),
        ({"do": "load"}, "load came with 0 values; expected 1"),
        ({"do": "load", "with": [None]}, "the program is a NoneType; expected a text"),
        ({"do": "undo", "with": [1]}, "undo came with 1 values; expected 0"),
        ({"do": "look", "with": [0, 1]}, "look came with 2 values; expected 0 or 1"),
        ({"do": "look", "with": [-1]}, "there is no token -1; expected a place from 0 to 2"),
        ({"do": "look", "with": [1.5]}, "there is no token 1.5"),
        ({"do": "look", "with": ["a"]}, "there is no token 'a'"),
    ],
    ids=str,
)
def test_a_message_that_makes_no_sense_is_answered_on_the_page(unchecked_shapes, message, reason):
    playground = Playground(RING)
    playground._on_message(playground, message, [])
    assert reason in playground.view["error"]["message"] and playground.text == RING


def test_messages_that_ask_for_nothing_change_nothing(unchecked_shapes):
    playground = Playground(RING)
    for message in (None, 5, [], {}, {"do": None}, {"do": []}, {"with": ["+"]}):
        playground._on_message(playground, message, [])
    assert playground.text == RING and playground.view["error"] is None


def test_an_empty_playground_has_nothing_to_look_at(unchecked_shapes, playground):
    with pytest.raises(ProgramError, match="there is no token 0; expected no place: the program is empty"):
        playground.look(0)
    playground.look()
    for make in (Playground, playground.load):
        with pytest.raises(ProgramError, match="the program is a NoneType; expected a text"):
            make(None)


def test_the_browser_may_ask_for_nothing_else():
    playground = Playground(RING)
    click(playground, "close")
    click(playground, "_become", ())
    assert playground.text == RING and playground.view["error"] is None


def test_pages_without_a_kernel_have_a_text_and_a_still_picture():
    assert repr(Playground(RING)) == f"Playground('{RING}')"
    assert stamps(Playground(RING).figure()) == 4
