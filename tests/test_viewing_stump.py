"""Pictures of a stump's layers obey the paper's equations, and figures show what they were given."""

import numpy as np
import pytest
import torch
import trimesh
from matplotlib.backends.backend_agg import FigureCanvasAgg

from lib.interpreters.stump import Circle, HalfPlane, Sphere, Stump, execute, parse
from lib.viewing.canvas import INK
from lib.viewing.stump_figures import MOST, layers_figure, matrices_figure, soft_figure
from lib.viewing.stump_pictures import REACH, picture_points, picture_window, pictures_of
from lib.viewing.stump_search import search_figure
from lib.viewing.stump_solids import cloud_figure, nearest_primitive, solid_figure, solid_mesh

PLATE = parse("""F1 = square(half=(0.5, 0.3))
F2 = not circle(radius=0.15, translation=(-0.2, 0))
F3 = triangle(left=0.3, right=0.3, height=0.4, translation=(0.1, 0.2))
S1 = F1 & F2
S2 = F3
T = S1 | S2
""")
BLOCK = parse("""F1 = box(half=(0.5, 0.4, 0.1))
F2 = not cylinder(radius=0.15, translation=(-0.2, 0, 0))
S1 = F1 & F2
T = S1
""")
NOTHING = parse("F1 = circle(radius=1)\nT = nothing\n")
EVERYTHING = parse("F1 = circle(radius=1)\nS1 = everything\nT = S1\n")


def texts(figure) -> list[str]:
    return [text.get_text() for ax in figure.axes for text in ax.texts]


def test_pictures_follow_the_paper():
    pictures = pictures_of(PLATE, 64)
    first, second, third = pictures.primitives
    assert (pictures.complements == [first, ~second, third]).all()
    assert (pictures.nodes == [first & ~second, third]).all()
    assert (pictures.shape == first & ~second | third).all()


def test_pictures_agree_with_the_shape():
    inside = execute(PLATE).occupancy(picture_points(PLATE, 50)).view(50, 50).numpy()
    assert (pictures_of(PLATE, 50).shape == inside).all()


def test_up_is_up_and_right_is_right():
    """A half-plane holds what is below its line; a circle at the upper right is in that quarter."""
    low = pictures_of(Stump([HalfPlane()], [0], [[1]], [1]), 8).shape
    assert not low[:4].any() and low[4:].all()
    corner = Stump([Circle(0.1, (0.3, 0.3))], [0], [[1]], [1])
    picture = pictures_of(corner, 20, [[-0.5, -0.5], [0.5, 0.5]]).shape
    assert picture.any() and not picture[10:].any() and not picture[:, :10].any()


def test_edges_of_the_layers():
    assert not pictures_of(NOTHING, 8).shape.any()
    assert pictures_of(EVERYTHING, 8).shape.all()


def test_the_window_holds_all_primitives_whatever_the_matrices_say():
    window = picture_window(PLATE)
    assert torch.equal(window, picture_window(Stump(PLATE.primitives, [1, 1, 1], torch.zeros(3, 0), [])))
    (left, bottom), (right, top) = window.tolist()
    assert right - left == pytest.approx(top - bottom) == pytest.approx(1.3)  # 1 wide, and 15 % at each side
    assert left < -0.5 and bottom < -0.3 and top > 0.6
    boundless = picture_window(Stump([HalfPlane()], [0], [[1]], [1]))
    assert boundless[1].min() > REACH and torch.equal(boundless[0], -boundless[1])
    beside = Stump([HalfPlane(), Circle(0.1, (3.0, 0.0))], [0, 0], [[1], [1]], [1])
    assert picture_window(beside)[0, 0] > 2.8


def test_a_solid_is_cut_by_a_plane():
    above = pictures_of(BLOCK, 40).shape
    beside = pictures_of(BLOCK, 40, plane="xz").shape
    off = pictures_of(BLOCK, 40, plane="xz", at=0.3).shape
    assert above.sum() > beside.sum() and beside.any(0).sum() < off.any(0).sum()  # the hole, and no hole
    assert not pictures_of(BLOCK, 40, at=0.2).shape.any()
    with pytest.raises(ValueError, match="two axes of x, y, z"):
        pictures_of(BLOCK, 40, plane="xx")
    with pytest.raises(ValueError, match="'xz'.*two axes of x, y"):
        pictures_of(PLATE, 40, plane="xz")


def dots(figure) -> list[str]:
    """The colours of the dots on the wires, in the order of the matrices' cells."""
    return [line.get_color() for line in figure.axes[0].lines if line.get_marker() == "o"]


def test_the_layers_have_a_dot_for_each_one():
    figure = layers_figure(PLATE, 32)
    cells = [*PLATE.intersection.flatten().tolist(), *PLATE.union.tolist()]
    assert [color == INK for color in dots(figure)] == cells
    shown = texts(figure)
    assert shown.count("not") == 1 and {"O3 triangle", "F3", "S2", "T, the shape"} <= set(shown)
    assert len(figure.axes[0].images) == 3 + 3 + 2 + 1


@pytest.mark.parametrize("stump", [NOTHING, EVERYTHING, BLOCK], ids=["nothing", "everything", "space"])
def test_unusual_layers_are_drawn(stump):
    layers_figure(stump, 16).canvas.draw()
    matrices_figure(stump).canvas.draw()


def test_labels_of_the_layers_do_not_overlap():
    rows, columns = 6, MOST
    wide = Stump([HalfPlane()] * rows, [1] * rows, torch.ones(rows, columns), [1] * columns)
    figure = layers_figure(wide, 16)
    assert figure.get_figwidth() * figure.dpi <= 900
    assert_apart(figure)


def assert_apart(figure) -> None:
    """No two texts of a figure overlap, and none leaves the page."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    boxes = [text.get_window_extent(renderer) for ax in figure.axes for text in ax.texts if text.get_text()]
    for k, box in enumerate(boxes):
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[k + 1 :])


@pytest.mark.parametrize(
    "stump", [PLATE, BLOCK, NOTHING, EVERYTHING], ids=["plate", "block", "nothing", "everything"]
)
def test_texts_are_apart(stump):
    assert_apart(layers_figure(stump, 16))
    assert_apart(matrices_figure(stump))
    if stump.dimensions == 2:
        assert_apart(soft_figure(stump, (5, 150)))


def test_too_many_layers_are_refused():
    many = Stump([HalfPlane()] * (MOST + 1), [0] * (MOST + 1), torch.zeros(MOST + 1, 1), [0])
    with pytest.raises(ValueError, match=f"found {MOST + 1} primitives and 1 nodes; expected at most {MOST}"):
        layers_figure(many)


def test_matrices_are_drawn_as_they_are():
    w_c, w_i, w_u = (
        np.asarray(image.get_array())[..., 0] < 0.5 for image in matrices_figure(PLATE).axes[0].images
    )
    assert (w_c == PLATE.complement[:, None].numpy()).all()
    assert (w_i == PLATE.intersection.numpy()).all()
    assert (w_u == PLATE.union[None].numpy()).all()


def test_rows_of_matrices_have_names():
    assert {"F1 square", "F2 circle"} < set(texts(matrices_figure(PLATE)))


def test_large_matrices_have_labels_that_fit():
    generator = torch.Generator().manual_seed(0)
    for rows, columns in ((64, 20), (256, 256), (3, 200), (100, 2)):
        matrices = [
            torch.rand(shape, generator=generator) < 0.1 for shape in ((rows,), (rows, columns), (columns,))
        ]
        figure = matrices_figure(Stump([Sphere(0.1)] * rows, *matrices))
        assert_apart(figure)
        assert figure.get_figwidth() * figure.dpi <= 850


def test_soft_pictures_come_nearer_to_the_hard_one():
    figure = soft_figure(PLATE, (5, 20, 150))
    errors = [float(text.rsplit(" ", 1)[1]) for text in texts(figure) if "error" in text]
    assert (
        len(errors) == 3 and errors == sorted(errors, reverse=True) and errors[0] > 0.1 and errors[2] < 0.05
    )
    assert len(figure.axes[0].collections) == 3  # a line at 0.5 in each
    assert "mean error 0.000" in "".join(texts(soft_figure(EVERYTHING, (5,))))


def test_a_solid_has_the_colours_of_its_primitives():
    mesh = solid_mesh(BLOCK)
    assert len(np.unique(mesh.visual.face_colors, axis=0)) == 2
    assert len(np.unique(solid_mesh(BLOCK, colored=False).visual.face_colors, axis=0)) == 1
    assert mesh.extents == pytest.approx([1.0, 0.2, 0.8])  # z is up in pictures' y
    points = np.array([[0.5, 0.0, 0.0], [-0.05, 0.0, 0.0]])
    assert nearest_primitive(BLOCK, points).tolist() == [0, 1]
    unused = Stump([Sphere(0.5), *BLOCK.primitives], [0, 0, 1], [[0], [1], [1]], [1])
    assert nearest_primitive(unused, points).tolist() == [1, 2]


def test_solids_are_drawn_side_by_side():
    figure = solid_figure(
        [BLOCK, BLOCK.to_text(), execute(BLOCK), trimesh.creation.box()], list("abcd"), size=1
    )
    assert [ax.get_xlabel() for ax in figure.axes] == list("abcd")
    assert figure.axes[0].get_xlim() == figure.axes[3].get_xlim()
    other = solid_figure([BLOCK, trimesh.creation.box((9, 9, 9))], same_scale=False, size=1)
    assert other.axes[0].get_xlim() != other.axes[1].get_xlim()


@pytest.mark.parametrize("wrong, said", [(PLATE, "a stump of the plane"), (3, "an? int"), (None, "NoneType")])
def test_what_is_no_solid_is_named(wrong, said):
    with pytest.raises(TypeError, match=f"cannot draw .*{said}|cannot draw a {said}"):
        solid_figure(wrong)


@pytest.mark.usefixtures("unchecked_shapes")
def test_a_cloud_has_a_legend_with_counts():
    points, labels = np.random.default_rng(0).normal(size=(30, 3)), np.repeat([0, 1, -1], 10)
    figure = cloud_figure(points, labels, ["plane", "cone"])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "plane: 10",
        "cone: 10",
        "none: 10",
    ]
    colors = figure.axes[0].collections[0].get_facecolors()
    assert len(colors) == 30
    half = cloud_figure(points, labels, normals=points)
    assert 0 < len(half.axes[0].collections[0].get_offsets()) < 30
    assert [t.get_text() for t in cloud_figure(points).legends[0].get_texts()] == ["none: 30"]
    cloud_figure(np.zeros((0, 3))).canvas.draw()
    with pytest.raises(ValueError, match="29 labels for 30 points"):
        cloud_figure(points, labels[1:])
    with pytest.raises(ValueError, match="1 names, but a point has the label 1"):
        cloud_figure(points, labels, ["plane"])


@pytest.mark.usefixtures("unchecked_shapes")
def test_twelve_surfaces_of_a_cloud_are_told_apart():
    figure = cloud_figure(np.zeros((13, 3)), np.arange(-1, 12))
    keys = {tuple(handle.get_color()) for handle in figure.legends[0].legend_handles}
    assert len(keys) == 13


def test_a_search_has_a_curve_a_method():
    rows = [
        {"primitives": k, "search": search, "wrong_percent": 10 / k, "bound_percent": 0.0, "seconds": k / 10}
        for search in ("layers", "solve", "greedy")
        for k in (16, 4, 8)
    ]
    wrong, slow = search_figure({"rows": rows, "limit_seconds": 2.0}).axes
    assert wrong.lines[0].get_xdata().tolist() == [4, 8, 16]
    assert wrong.lines[0].get_ydata() == pytest.approx([2.5, 1.25, 0.625])
    names = [text.get_text() for text in wrong.get_legend().get_texts()]
    assert names == ["paper's program", "our search", "not proven", "greedy cover"]
    assert (
        len(wrong.collections) == 1
        and slow.get_yscale() == "log"
        and "time limit" in slow.texts[0].get_text()
    )
    with pytest.raises(ValueError, match="found no rows"):
        search_figure({"rows": [], "limit_seconds": 2.0})
