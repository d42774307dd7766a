"""OpenSCAD itself opens our files and makes the solids that we make. Skipped where it is not installed."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import torch
import trimesh
from trimesh.boolean import intersection, union

from lib.datasets import examples
from lib.interpreters import csg, shapeassembly, stump
from lib.interpreters.csg.primitives import square_corners, triangle_corners
from lib.interpreters.openscad import read

OPENSCAD = shutil.which("openscad")
pytestmark = pytest.mark.skipif(
    OPENSCAD is None, reason="OpenSCAD is not installed (apt-get install openscad)"
)
Y_UP_TO_Z_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

STUMPS = {
    "a plate with a turned hole, the paper's endless cylinder": """
        F1 = box(half=(0.5, 0.3, 0.1), rotation=(0.9, 0.1, 0.2, 0.3))
        F2 = not cylinder(radius=0.2, translation=(0.05, 0.0, 0.0), rotation=(1.0, 0.2, 0.0, 0.0))
        S1 = F1 & F2
        T = S1""",
    "a ball and a finite cone": """
        F1 = sphere(radius=-0.3, translation=(0.1, 0.2, 0.3))
        F2 = cone(slope=0.4, height=0.7, translation=(0.1, -0.2, -0.4), rotation=(0.3, -0.5, 0.2, 0.1))
        S1 = F1
        S2 = F2
        T = S1 | S2""",
    "an endless cone in a cylinder": """
        F1 = cone(slope=0.5, translation=(0.0, 0.0, -0.2))
        F2 = cylinder(radius=0.3, height=1.0, rotation=(1.0, 0.0, 0.1, 0.0))
        S1 = F1 & F2
        T = S1""",
    "nothing but complements: the window's cube with dents": """
        F1 = not sphere(radius=0.4, translation=(0.5, 0.5, 0.5))
        F2 = not cylinder(radius=0.2)
        S1 = F1 & F2
        T = S1""",
    "endless bars, cut off at the window": """
        F1 = cylinder(radius=0.2)
        F2 = cylinder(radius=0.1, rotation=(1.0, 0.0, 1.0, 0.0))
        F3 = box(half=(0.4, 0.4, 0.1))
        F4 = not box(half=(0.3, 0.3, 2.0))
        S1 = F1
        S2 = F2
        S3 = F3 & F4
        T = S1 | S2 | S3""",
    "a plate of the plane": """
        F1 = square(half=(0.5, 0.3), rotation=0.3)
        F2 = not circle(radius=0.2)
        F3 = halfplane(translation=(0.1, 0.2), rotation=-1.0)
        F4 = triangle(left=0.1, right=0.3, height=-0.4, rotation=1.0)
        S1 = F1 & F2 & F3
        S2 = F4
        T = S1 | S2""",
    "a half-plane, cut off at the window": """
        F1 = halfplane(translation=(0.1, 0.2), rotation=-1.0)
        F2 = not circle(radius=0.2)
        S1 = F1 & F2
        T = S1""",
}  # fmt: skip
PROGRAMS = [
    "c(32,32,28)s(32,20,12)-t(10,50,9)+",
    "t(30,30,31)t(31,35,15)-s(3,60,9)+",
    "sp(32,32,32,20)cu(32,20,12,25)-cy(10,10,7,5,7)+",
    "cu(32,32,32,20)cy(32,32,32,8,64)*sp(32,32,40,1)-",
]


@pytest.fixture
def rendered(tmp_path):
    """rendered(text): the mesh that OpenSCAD makes of a file."""

    def render(text: str) -> trimesh.Trimesh:
        scad, stl = tmp_path / "shape.scad", tmp_path / "shape.stl"
        scad.write_text(text, encoding="utf-8")
        command = [OPENSCAD, "--export-format", "binstl", "-o", str(stl), str(scad)]
        result = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert result.returncode == 0, result.stderr
        complaints = [line for line in result.stderr.splitlines() if "WARNING" in line or "ERROR" in line]
        # Boxes that touch in an edge make a surface that is fine but for that edge.
        assert all("2-manifold" in line for line in complaints), result.stderr
        return trimesh.load_mesh(stl)

    return render


def assert_same_solid(theirs: trimesh.Trimesh, ours: trimesh.Trimesh):
    """Volumes within 1 %. And at the same place: facets of round shapes differ, by less than another 1 %."""
    assert ours.volume > 0
    assert theirs.volume == pytest.approx(ours.volume, rel=0.01)
    assert intersection([theirs, ours], engine="manifold").volume > 0.98 * ours.volume


@pytest.mark.parametrize("name", STUMPS)
def test_stumps(name, rendered):
    made = stump.parse(STUMPS[name])
    text = made.to_openscad().replace(
        "$fn = 48;", "$fn = 32;"
    )  # in half the time; volumes do not depend on it
    assert_same_solid(rendered(text), stump.execute(made).mesh())


@pytest.mark.parametrize("text", PROGRAMS)
def test_programs(text, rendered):
    program = csg.parse(text)
    assert_same_solid(rendered(program.to_openscad()), csg.execute(program).mesh())


@pytest.mark.parametrize("name", ["sampled", "dining_chair", "swivel_chair"])
def test_boxes(name, rendered):
    program = examples().get(name) or shapeassembly.sample(np.random.default_rng(1))
    theirs, ours = rendered(program.to_openscad()), shapeassembly.execute(program).mesh().copy()
    ours.apply_transform(Y_UP_TO_Z_UP)
    assert theirs.bounds == pytest.approx(ours.bounds, abs=1e-4)
    boxes = ours.split(only_watertight=False, repair=False)
    assert theirs.volume == pytest.approx(union(boxes, engine="manifold").volume, rel=0.01)


def test_an_edit_means_to_openscad_what_it_means_to_us(rendered):
    text = csg.parse("c(32,32,28)t(31,35,15)-").to_openscad()
    text = text.replace("triangle_2_radius = 15", "triangle_2_radius = 40 / 2 + circle_1_radius / 7")
    assert_same_solid(rendered(text), csg.execute(read(text)).mesh())
    text = stump.parse(STUMPS["a plate of the plane"]).to_openscad()
    text = text.replace("F2_rotation = 0.0", "turn = [-0.5]; F2_rotation = 2 * turn[0]")
    text = text.replace("F4_height = -0.4", "F4_height = F2_radius * 3")
    assert read(text) != stump.parse(STUMPS["a plate of the plane"])
    assert_same_solid(rendered(text), stump.execute(read(text)).mesh())


def test_what_goes_on_for_ever_still_does_after_edits(rendered):
    """A hole through a block that was made long and moved away; its quaternions are tiny and huge."""
    text = stump.parse(STUMPS["a plate with a turned hole, the paper's endless cylinder"]).to_openscad()
    for name, value in {
        "F1_half": "[0.5, 0.3, 40]",
        "F1_translation": "[30, 0, 0]",
        "F1_rotation": "[1e-200, 0, 0, 0]",
        "F2_translation": "[30, 0, -70]",
        "F2_rotation": "[1e200, 0, 0, 0]",
    }.items():
        text, count = re.subn(rf"(?m)^{name} = .*$", f"{name} = {value};", text)
        assert count == 1
    theirs = rendered(text)
    assert theirs.volume == pytest.approx(80 * (0.6 - np.pi * 0.2**2), rel=1e-3)
    assert theirs.euler_number == 0  # the hole goes through


def test_openscad_rounds_corners_as_we_do(tmp_path):
    """At every center and radius: half a pixel in one of them would go unseen in a volume."""
    scad, found = tmp_path / "corners.scad", tmp_path / "corners.echo"
    grid = "echo([for (x = [0:63]) for (r = [1:64]) [{}]]);"
    numbers = [f"truncated(x {sign} square_half(r))" for sign in "-+"]
    numbers += [f"truncated(x {part})" for part in (
        "- triangle_side(r) / 1.732", "+ triangle_side(r) / (2 * 1.732)", "- triangle_side(r) / 2",
        "+ triangle_side(r) / 2",
    )]  # fmt: skip
    text = csg.parse("s(9,9,9)t(9,9,9)+").to_openscad()
    for number in numbers:  # these are what our modules say
        said = [number.replace("x ", f"center[{axis}] ").replace("(r)", "(radius)") for axis in (0, 1)]
        assert any(one in text for one in said), number
    scad.write_text(text + grid.format(", ".join(numbers)), encoding="utf-8")
    subprocess.run([OPENSCAD, "-o", str(found), str(scad)], check=True, capture_output=True, timeout=60)
    theirs = np.array([float(number) for number in re.findall(r"-?[0-9.]+", found.read_text())]).reshape(
        -1, 6
    )
    x, r = (torch.from_numpy(grid).flatten() for grid in np.mgrid[0:64, 1:65])
    left, right, _, _ = square_corners(torch.stack([x, x, r], -1))
    ours = torch.stack([left, right, *triangle_corners(torch.stack([x, x, r], -1))], -1)
    assert np.array_equal(theirs, ours.numpy())
