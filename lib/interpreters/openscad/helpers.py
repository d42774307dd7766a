"""The modules and functions at the end of our files, in OpenSCAD itself: what the named shapes above them mean.

A file holds those that it uses, and the reader accepts no others. A curved shape is a polyhedron: `swollen` blows it up
until its cross-section has the area of the true circle, and a sphere, to one part in a thousand, the true volume.
"""

from collections.abc import Iterable
from functools import cache

from .document import Application, Call, Document, Function, Module, Vector
from .parsing import parse

_FUNCTIONS = {
    # cos and sin take degrees in OpenSCAD.
    "swollen": "function swollen() = sqrt(2 * PI / $fn / sin(360 / $fn));",
    "turned": """function turned(w, x, y, z) = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]];""",
    "unit": "function unit(q) = q / norm(q);",
    "sized": "function sized(q) = q / max(abs(q[0]), abs(q[1]), abs(q[2]), abs(q[3]));",
    "rotation_of": "function rotation_of(q) = turned(q[0], q[1], q[2], q[3]);",
    "affine": """function affine(m, t) = [
        [m[0][0], m[0][1], m[0][2], t[0]],
        [m[1][0], m[1][1], m[1][2], t[1]],
        [m[2][0], m[2][1], m[2][2], t[2]]];""",
    "transposed": """function transposed(m) = [
        [m[0][0], m[1][0], m[2][0]],
        [m[0][1], m[1][1], m[2][1]],
        [m[0][2], m[1][2], m[2][2]]];""",
    "truncated": "function truncated(v) = sign(v) * floor(abs(v));",
    "square_half": "function square_half(r) = 1.412 * r / 2;",
    "triangle_side": "function triangle_side(r) = 1.732 * r;",
    "flat_half": "function flat_half(s) = floor((s - 1) / 2) + 0.5;",
}
_STUMPS = {
    "placed": """module placed(translation, rotation)
        multmatrix(affine(rotation_of(unit(sized(rotation))), translation)) children();""",
    "placed_2d": """module placed_2d(translation, rotation)
        translate(translation) rotate(rotation * 180 / PI) children();""",
    "box_of": "module box_of(half) cube([2 * abs(half[0]), 2 * abs(half[1]), 2 * abs(half[2])], center = true);",
    "sphere_of": "module sphere_of(radius) sphere(r = abs(radius) * pow(swollen(), 5 / 3));",
    "cylinder_of": """module cylinder_of(radius, height)
        cylinder(r = abs(radius) * swollen(), h = abs(height), center = true);""",
    "endless_cylinder_of": "module endless_cylinder_of(radius) cylinder_of(radius, 2 * endless());",
    "cone_of": """module cone_of(slope, height)
        cylinder(r1 = 0, r2 = abs(slope * height) * swollen(), h = abs(height));""",
    "endless_cone_of": "module endless_cone_of(slope) cone_of(slope, endless());",
    "square_of": "module square_of(half) square([2 * abs(half[0]), 2 * abs(half[1])], center = true);",
    "circle_of": "module circle_of(radius) circle(r = abs(radius) * swollen());",
    "triangle_of": """module triangle_of(left, right, height)
        polygon([[-abs(left), 0], [abs(right), 0], [0, abs(height)]]);""",
    "half_plane_of": """module half_plane_of()
        translate([-endless(), -endless()]) square([2 * endless(), endless()]);""",
    "extruded": "module extruded() linear_extrude(height = height) children();",
    "window": "module window() translate(window_low) cube(window_high - window_low);",
    "window_2d": "module window_2d() translate(window_low) square(window_high - window_low);",
}
_PROGRAMS = {
    "circle_at": "module circle_at(center, radius) translate(center) circle(r = radius * swollen());",
    "square_at": """module square_at(center, radius) square_between(
        truncated(center[0] - square_half(radius)) - 0.5, truncated(center[0] + square_half(radius)) + 0.5,
        truncated(center[1] - square_half(radius)) - 0.5, truncated(center[1] + square_half(radius)) + 0.5);""",
    "square_between": """module square_between(left, right, top, bottom)
        polygon([[left, top], [right, top], [right, bottom], [left, bottom]]);""",
    "triangle_at": """module triangle_at(center, radius) triangle_between(center[0],
        truncated(center[1] - triangle_side(radius) / 1.732),
        truncated(center[1] + triangle_side(radius) / (2 * 1.732)),
        truncated(center[0] - triangle_side(radius) / 2),
        truncated(center[0] + triangle_side(radius) / 2));""",
    "triangle_between": """module triangle_between(x, apex, base, left, right)
        trapezoid(x, apex, base, left, right, 0.5 / (base - apex));""",
    "trapezoid": """module trapezoid(x, apex, base, left, right, over) polygon([
        [x - 0.5 + (x - left) * over, apex - 0.5], [x + 0.5 - (right - x) * over, apex - 0.5],
        [right + 0.5 + (right - x) * over, base + 0.5], [left - 0.5 - (x - left) * over, base + 0.5]]);""",
    "sphere_at": """module sphere_at(center, radius)
        translate(center) sphere(r = max(radius - 1, 0.5) * pow(swollen(), 5 / 3));""",
    "cube_at": "module cube_at(center, side) translate(center) cube(2 * flat_half(side), center = true);",
    "cylinder_at": """module cylinder_at(center, radius, height) translate(center)
        cylinder(r = max(radius - 1, 0.5) * swollen(), h = 2 * flat_half(height), center = true);""",
    "plate": "module plate() linear_extrude(height = height) translate([0, 63]) mirror([0, 1]) children();",
}
_PARTS = {
    "part": "module part(path) children();",
    "cuboid": """module cuboid(size, center, axes) multmatrix(affine(transposed(axes), center))
        cube([abs(size[0]), abs(size[1]), abs(size[2])], center = true);""",
}
_TEXTS = {**_STUMPS, **_PROGRAMS, **_PARTS, **_FUNCTIONS}


@cache
def helpers() -> dict[str, Module | Function]:
    """All of them by name, as parsed."""
    return {name: parse(text).statements[0] for name, text in _TEXTS.items()}


def with_helpers(document: Document) -> Document:
    """The document and, behind it, the helpers that it uses."""
    names = used(document.statements)
    found = [helper for name, helper in helpers().items() if name in names]
    if found:
        above = "---- What the words above mean. The reader knows these: leave them as they are. ----"
        first = found[0]
        found[0] = type(first)(first.name, first.parameters, _content(first), above=above)
    return Document((*document.statements, *found), document.header)


def _content(helper: Module | Function):
    return helper.children if isinstance(helper, Module) else helper.value


def used(statements: Iterable) -> set[str]:
    """Names of the helpers that statements use, and of those that these use …"""
    names: set[str] = set()
    waiting = list(statements)
    while waiting:
        node = waiting.pop()
        if isinstance(node, Call | Application) and node.name in helpers() and node.name not in names:
            names.add(node.name)
            waiting.append(helpers()[node.name])
        waiting += _inner(node)
    return names


def _inner(node) -> list:
    """The calls and expressions right within one."""
    if isinstance(node, Vector):
        return list(node.items)
    if isinstance(node, Application):
        return list(node.arguments)
    inner = [*getattr(node, "children", ()), *(argument.value for argument in getattr(node, "arguments", ()))]
    return inner + [
        getattr(node, key)
        for key in ("value", "left", "right", "operand", "vector", "index")
        if hasattr(node, key)
    ]
