"""Stump <-> document: F1, F2, … are the primitives, S1, S2, … the nodes, T is the shape.

    F1_half = [0.5, 0.5, 0.1];                                   numbers of F1: its sizes, translation, rotation
    module F1() placed(F1_translation, F1_rotation) box_of(F1_half);
    module S1() difference() { F1(); F2(); F3(); }               F1 and neither F2 nor F3, which are complemented
    module S2() intersection() { F1(); F4(); }                   what has no F at all begins with window()
    module unused() difference() { window(); F5(); }             complemented, but in no node
    module T() union() { S1(); S2(); }

What goes on for ever ends at `endless()` from its translation, and T at the window, as its meshes do. Both are for the
eye: a stump has neither.
"""

from ..stump.bounds import bounds, window
from ..stump.primitives import (
    POSE,
    Box,
    Circle,
    Cone,
    Cylinder,
    HalfPlane,
    Primitive,
    Sphere,
    Square,
    Triangle,
)
from ..stump.program import Stump
from .document import Assign, Call, Document, Module, Number, Text, call, vector
from .endless import WINDOW, endless_function
from .frame import SEGMENTS
from .helpers import used

LANGUAGE = "CSG-Stump"
FORMS = {  # helper -> kind, sizes
    "box_of": (Box, ("half",)),
    "sphere_of": (Sphere, ("radius",)),
    "cylinder_of": (Cylinder, ("radius", "height")),
    "endless_cylinder_of": (Cylinder, ("radius",)),
    "cone_of": (Cone, ("slope", "height")),
    "endless_cone_of": (Cone, ("slope",)),
    "square_of": (Square, ("half",)),
    "circle_of": (Circle, ("radius",)),
    "triangle_of": (Triangle, ("left", "right", "height")),
    "half_plane_of": (HalfPlane, ()),
}
_NAMES = {form: name for name, form in FORMS.items()}
_HEADER = """{0!r} of {1}, for OpenSCAD. Lengths are the stump's own; slicers take them for millimetres.
Change the parameters as you like. F are primitives, S intersections of them, T, the shape, is a union of S.
A node that lies outside of F2, say, is written as a difference: F2 is cut out of it.
{2}"""


def write_stump(stump: Stump) -> Document:
    """Without the helpers."""
    modules = [
        *(_primitive(k, p) for k, p in enumerate(stump.primitives, start=1)),
        *_nodes(stump),
        _shape(stump),
    ]
    helpers = used(modules)
    parameters = [*_frame(stump, helpers), *_numbers(stump)]
    drawn = (_drawing(stump), *endless_function(stump.primitives, helpers))
    world = "space" if stump.dimensions == 3 else "the plane"
    return Document((*parameters, *modules, *drawn), _HEADER.format(stump, world, _TURN[stump.dimensions]))


def _form(primitive: Primitive) -> tuple[type, tuple[str, ...]]:
    return type(primitive), tuple(key for key in primitive.written if key not in POSE)


def _frame(stump: Stump, helpers: set[str]) -> list[Assign]:
    """The parameters of the file as a whole, as far as its helpers need them."""
    made = [
        Assign("language", Text(LANGUAGE), above="---- Parameters ----", note="tells the reader what this is")
    ]
    if "swollen" in helpers:
        made.append(Assign("$fn", Number(SEGMENTS), note="corners of a full circle, at least 3"))
    if stump.dimensions == 2:
        sides = window(stump)[1] - window(stump)[0]
        made.append(Assign("height", Number(float(sides.max()) / 8 or 1.0), note="of the plate"))
    if helpers & {"window", "window_2d"}:
        note = "the shape goes on for ever: this much of it is drawn; widen it at will"
        for name, corner in zip(WINDOW, window(stump).tolist()):
            made.append(Assign(name, vector(corner), note=note))
            note = ""
    return made


_MEANING = {
    "half": "half of its sides",
    "slope": "radius / height",
}
_TURN = {
    2: "Translation and rotation place a primitive: where its origin is, and its turn, counter-clockwise in radians.",
    3: """Translation and rotation place a primitive: where its own origin is, and the quaternion w, x, y, z that turns
the world's axes into its own.""",
}


def _numbers(stump: Stump) -> list[Assign]:
    made = []
    for k, primitive in enumerate(stump.primitives, start=1):
        above = f"F{k}: {primitive.name}"
        for key in primitive.written:
            numbers = getattr(primitive, key).detach().double().cpu().reshape(-1).tolist()
            note = _MEANING.get(key, "")
            value = vector(numbers if len(numbers) > 1 else numbers[0])
            made.append(Assign(f"F{k}_{key}", value, note=note, above=above))
            above = ""
    return made


def _primitive(k: int, primitive: Primitive) -> Module:
    kind, sizes = _form(primitive)
    shape = call(_NAMES[kind, sizes], *(f"F{k}_{key}" for key in sizes))
    above = "---- Primitives ----" if k == 1 else ""
    pose = [f"F{k}_{key}" for key in POSE]
    return Module(
        f"F{k}", (), (call("placed" + _flat(kind.dimensions), *pose, children=(shape,)),), above=above
    )


def _flat(dimensions: int) -> str:
    return "_2d" if dimensions == 2 else ""


def _nodes(stump: Stump) -> list[Module]:
    made = []
    outside = stump.complement.tolist()
    for c, column in enumerate(stump.intersection.T.tolist(), start=1):
        chosen = [k for k, one in enumerate(column) if one]
        within = [f"F{k + 1}" for k in chosen if not outside[k]]
        without = [f"F{k + 1}" for k in chosen if outside[k]]
        above = "---- Nodes ----" if c == 1 else ""
        made.append(Module(f"S{c}", (), (_node(within, without, stump.dimensions),), above=above))
    selected = stump.intersection.any(1).tolist()
    unused = [f"F{k + 1}" for k, one in enumerate(outside) if one and not selected[k]]
    if unused:
        above = "Complemented, but in no node: not drawn."
        made.append(Module("unused", (), (_node([], unused, stump.dimensions),), above=above))
    return made


def _node(within: list[str], without: list[str], dimensions: int) -> Call:
    base = _joined("intersection", within or ["window" + _flat(dimensions)])
    return call("difference", children=(base, *map(call, without))) if without else base


def _joined(operation: str, names: list[str]) -> Call:
    return call(names[0]) if len(names) == 1 else call(operation, children=tuple(map(call, names)))


def _shape(stump: Stump) -> Module:
    united = [f"S{c}" for c, one in enumerate(stump.union.tolist(), start=1) if one]
    children = (_joined("union", united),) if united else ()
    if united and bounds(stump).isinf().any():
        children = (call("intersection", children=(call("window" + _flat(stump.dimensions)), *children)),)
    return Module("T", (), children, above="---- The shape ----")


def _drawing(stump: Stump) -> Call:
    if stump.dimensions == 3:
        return call("T")
    return call("extruded", children=(call("T"),))
