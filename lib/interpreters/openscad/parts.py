"""The boxes of a ShapeAssembly program <-> document: one module a box, and one for every part that holds others.

    Program_0_seat_size = [1.0, 0.1, 1.0];  Program_0_seat_center = …;  Program_0_seat_axes = …;
    module Program_0_seat() part("Program_0/seat") cuboid(Program_0_seat_size, …);
    module Program_0() { Program_0_seat(); Program_0_leg(); }
    rotate([90, 0, 0]) Program_0();                     y is up in ShapeAssembly, z in OpenSCAD

`part` keeps a box's own name, as not every name can be a module's. A file says where the boxes are, not which program
put them there; so it is read as `Parts`.
"""

import re
from collections import Counter
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ..cuboids import Cuboids
from ..quoting import quoted
from .document import Assign, Call, Document, Module, Text, call, vector
from .errors import ScadError
from .evaluating import Contents, only_child, without_children
from .helpers import helpers
from .words import RESERVED

LANGUAGE = "ShapeAssembly"
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*", re.ASCII)
_UPRIGHT = [90, 0, 0]  # degrees: x, y, z becomes x, -z, y
_HEADER = """The boxes of a ShapeAssembly program, for OpenSCAD: {}. Lengths are the program's own; slicers take them
for millimetres. x is right, y is up, z is to the front; the last turn stands the shape up along OpenSCAD's z.
A box has its size along its own axes: right, top and front, the rows of `axes`. Change the parameters as you like."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Boxes and their names.

    names    (n) path names such as "Program_0/seat", as `Shape.names` of ShapeAssembly; all different
    cuboids  (n) the boxes, float64
    Raises ScadError for anything else, and for numbers that are not finite.
    """

    names: tuple[str, ...]
    cuboids: Cuboids

    def __post_init__(self):
        if not isinstance(self.names, tuple | list) or not isinstance(self.cuboids, Cuboids):
            found = f"found a {type(self.names).__name__} and a {type(self.cuboids).__name__}"
            raise ScadError(found, expected="a tuple of names, and Cuboids")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "cuboids", self.cuboids.detach().to(torch.device("cpu"), torch.float64))
        if self.cuboids.size.shape != (len(self.names), 3):
            found = f"{len(self.names)} names for boxes of shape {tuple(self.cuboids.size.shape[:-1])}"
            raise ScadError(found, expected="as many")
        finite = self._rows().isfinite().all(1).tolist()
        for name, fine in zip(self.names, finite):
            if not isinstance(name, str) or not _NAME.fullmatch(name):
                raise ScadError(f"found the name {quoted(str(name))}", expected="such as 'Program_0/seat'")
            if not fine:
                raise ScadError(f"{quoted(name)} has a number that is not finite", expected="finite ones")
        if len(set(self.names)) < len(self.names):
            twice = Counter(self.names).most_common(1)[0][0]
            raise ScadError(f"two boxes are named {quoted(twice)}", expected="different names")

    def __eq__(self, other) -> bool:
        return (
            isinstance(other, Parts)
            and self.names == other.names
            and torch.equal(self._rows(), other._rows())
        )

    def __hash__(self) -> int:
        return hash((self.names, tuple(self._rows().flatten().tolist())))

    def __repr__(self) -> str:
        return f"Parts({len(self.names)} boxes)"

    def _rows(self) -> Float[Tensor, "n 15"]:
        boxes = self.cuboids
        return torch.cat([boxes.size, boxes.center, boxes.axes.flatten(-2)], -1)

    def to_openscad(self) -> str:
        """An OpenSCAD file; `read` gives the same parts."""
        from .writing import write

        return write(self)


def parts_of(program) -> Parts:
    """The leaves of a ShapeAssembly program, executed."""
    from ..shapeassembly.executing import execute

    shape = execute(program)
    return Parts(tuple(shape.names), shape.cuboids)


def write_parts(parts: Parts) -> Document:
    """Without the helpers."""
    inner = _inner(parts.names)
    modules = _identifiers([*(f"{path}/" for path in inner if path), *parts.names])
    parameters = [
        Assign("language", Text(LANGUAGE), above="---- Parameters ----", note="tells the reader what this is")
    ]
    boxes = []
    for k, name in enumerate(parts.names):
        parameters += _numbers(modules[name], name, parts.cuboids[k])
        boxes.append(_box_module(modules[name], name, "" if k else "---- Boxes ----"))
    groups = [
        Module(
            modules[f"{path}/"], (), _calls(inside, modules), above="---- What lies in what ----" * (not k)
        )
        for k, (path, inside) in enumerate(item for item in inner.items() if item[0])
    ]
    drawn = [call("rotate", vector(_UPRIGHT), children=_calls(inner[""], modules))] if parts.names else []
    return Document((*parameters, *groups, *drawn, *boxes), _HEADER.format(len(parts.names)))


def _inner(names: tuple[str, ...]) -> dict[str, list[str]]:
    """What lies in each part that holds others: boxes by their names, such parts by path and "/"; "" is the root."""
    inner: dict[str, list[str]] = {"": []}
    for name in names:
        words = name.split("/")
        for depth in range(1, len(words)):
            path, above = "/".join(words[:depth]), "/".join(words[: depth - 1])
            if path not in inner:
                inner[path] = []
                inner[above].append(f"{path}/")
        inner["/".join(words[:-1])].append(name)
    return inner


def _identifiers(paths: list[str]) -> dict[str, str]:
    """A name for the module of each path, all different, none of OpenSCAD's or of the helpers'."""
    taken, identifiers = RESERVED | set(helpers()), {}
    for path in paths:
        plain = wanted = path.strip("/").replace("/", "_")
        count = 1
        while wanted in taken:
            count += 1
            wanted = f"{plain}_{count}"
        taken.add(wanted)
        identifiers[path] = wanted
    return identifiers


def _numbers(identifier: str, name: str, box: Cuboids) -> list[Assign]:
    return [
        Assign(f"{identifier}_size", vector(box.size.tolist()), above=name),
        Assign(f"{identifier}_center", vector(box.center.tolist())),
        Assign(f"{identifier}_axes", vector(box.axes.tolist())),
    ]


def _box_module(identifier: str, name: str, above: str) -> Module:
    box = call("cuboid", *(f"{identifier}_{key}" for key in ("size", "center", "axes")))
    return Module(identifier, (), (call("part", Text(name), children=(box,)),), above=above)


def _calls(paths: list[str], identifiers: dict[str, str]) -> tuple[Call, ...]:
    return tuple(call(identifiers[path]) for path in paths)


def read_parts(file: Contents) -> Parts:
    """The boxes that are drawn, in the order of their modules. Raises ScadError for a file that says none."""
    boxes = {name: module for name, module in file.modules.items() if _is_leaf(module)}
    drawn = _drawn(file, boxes)
    read = {identifier: _box(file, module) for identifier, module in boxes.items() if identifier in drawn}
    names: dict[str, Module] = {}
    for identifier, (name, place, _) in read.items():
        if not _NAME.fullmatch(name):
            raise ScadError(f"found the name {quoted(name)}", *place, name, 'such as "Program_0/seat"')
        if names.setdefault(name, boxes[identifier]) is not boxes[identifier]:
            raise ScadError(f"two boxes are named {quoted(name)}", *place, name, "different names")
    numbers = torch.tensor([row for *_, row in read.values()], dtype=torch.float64).reshape(-1, 15)
    return Parts(tuple(names), Cuboids(numbers[:, :3], numbers[:, 3:6], numbers[:, 6:].unflatten(1, (3, 3))))


def _is_leaf(module: Module) -> bool:
    return bool(module.children) and module.children[0].name == "part"


def _drawn(file: Contents, boxes: dict[str, Module]) -> set[str]:
    """All modules that are called from the top. Raises ScadError for one that is called twice."""
    waiting = [child for top in file.calls for child in _upright(file, top)]
    drawn: set[str] = set()
    while waiting:
        node = waiting.pop()
        module = file.module(node)
        if node.name in drawn:
            raise ScadError(f"{quoted(node.name)} is drawn twice", *node.at, node.name, "each part once")
        drawn.add(node.name)
        if node.name not in boxes:
            waiting += module.children
    return drawn


def _upright(file: Contents, top: Call) -> tuple[Call, ...]:
    """What is stood up; a call that stands for itself is fine too."""
    if top.name != "rotate":
        return (top,)
    (turn,) = file.arguments(top, 1)
    if file.numbers(turn, 3) != _UPRIGHT:
        raise ScadError("found another rotation", *file.place(turn), expected="[90, 0, 0], which makes z up")
    return top.children


def _box(file: Contents, module: Module) -> tuple[str, tuple, list[float]]:
    """Name, the name's place, and the numbers: size, center, axes."""
    part = only_child(module)
    (path,) = file.arguments(part, 1)
    name, box = file.value(path), without_children(only_child(part))
    if not isinstance(name, str):
        raise ScadError("found no name", *file.place(path), expected='a text such as "Program_0/seat"')
    if box.name != "cuboid":
        raise ScadError(f"found {quoted(box.name)}", *box.at, box.name, "cuboid(size, center, axes)")
    size, center, axes = file.arguments(box, 3)
    return name, file.place(path), [*file.numbers(size, 3), *file.numbers(center, 3), *file.matrix(axes)]
