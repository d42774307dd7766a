"""Document -> stump: the reader's half of `stumps`, which shows what a file looks like."""

import re

import torch

from ..quoting import quoted
from ..stump.poses import ANGLES
from ..stump.primitives import POSE, Primitive
from ..stump.program import MOST, Stump
from .document import Call, Module
from .endless import check_endless
from .errors import ScadError
from .evaluating import Contents, only_child, without_children
from .stumps import FORMS

_PLACED = {2: "placed_2d", 3: "placed"}
_WINDOWS = ("window", "window_2d")
_NUMBERED = re.compile(r"([FS])([1-9][0-9]{0,8})")


def read_stump(file: Contents) -> Stump:
    """Raises ScadError for a file that says no stump."""
    numbered = _numbered(file)
    primitives = _read_primitives(file, _in_order("F", numbered["F"]))
    check_endless(file, primitives)
    nodes = [_Node(file, len(primitives), only_child(module)) for module in _in_order("S", numbered["S"])]
    unused = [_Node(file, len(primitives), only_child(module)) for module in numbered["unused"].values()]
    complement = _complement(len(primitives), [*nodes, *unused])
    if len(primitives) * len(nodes) > MOST:
        raise ScadError(
            f"{len(primitives)} primitives in {len(nodes)} nodes", expected=f"at most {MOST} pairs of these"
        )
    intersection = torch.zeros(len(primitives), len(nodes), dtype=torch.bool)
    for c, node in enumerate(nodes):
        intersection[list(node.places), c] = True
    shape = file.drawn("extruded" if primitives[0].dimensions == 2 else "", "T")
    return Stump(tuple(primitives), complement, intersection, _read_union(file, shape, len(nodes)))


def _numbered(file: Contents) -> dict[str, dict[int, Module]]:
    """The modules by letter and number; `unused` has the number 0."""
    found: dict[str, dict[int, Module]] = {"F": {}, "S": {}, "unused": {}}
    for name, module in file.modules.items():
        if match := _NUMBERED.fullmatch(name):
            found[match[1]][int(match[2])] = module
        elif name == "unused":
            found[name][0] = module
        elif name != "T":
            expected = "F1, F2, …, S1, S2, …, unused or T"
            raise ScadError(f"found module {quoted(name)}", *module.at, name, expected)
    return found


def _in_order(letter: str, modules: dict[int, Module]) -> list[Module]:
    """Raises ScadError unless they are numbered from 1 without a gap."""
    for number, module in modules.items():
        if number > len(modules):
            missing = next(k for k in range(1, number) if k not in modules)
            expected = f"module {letter}{missing} too"
            raise ScadError(f"found {module.name}", *module.at, module.name, expected)
    return [modules[number] for number in sorted(modules)]


def _read_primitives(file: Contents, modules: list[Module]) -> list[Primitive]:
    """One or more, all of the plane or all of space."""
    if not modules:
        raise ScadError("there is no primitive", expected="module F1()")
    primitives = [_read_primitive(file, module) for module in modules]
    for primitive, module in zip(primitives, modules):
        if primitive.dimensions != primitives[0].dimensions:
            found = f"{module.name} has {primitive.dimensions} dimensions"
            raise ScadError(found, *module.at, module.name, f"{primitives[0].dimensions}, as F1 has")
    return primitives


def _read_primitive(file: Contents, module: Module) -> Primitive:
    placed = only_child(module)
    if placed.name not in _PLACED.values():
        raise ScadError(
            f"found {quoted(placed.name)}", *placed.at, placed.name, "placed(translation, rotation)"
        )
    pose, shape = file.arguments(placed, 2), without_children(only_child(placed))
    kind, sizes = FORMS.get(shape.name, (None, ()))
    if kind is None or placed.name != _PLACED[kind.dimensions]:
        possible = [name for name, (other, _) in FORMS.items() if placed.name == _PLACED[other.dimensions]]
        raise ScadError(f"found {quoted(shape.name)}", *shape.at, shape.name, " or ".join(possible))
    written = dict(zip((*sizes, *POSE), (*file.arguments(shape, len(sizes)), *pose)))
    widths = {**kind.counts, "translation": kind.dimensions, "rotation": ANGLES[kind.dimensions]}
    given = {
        key: file.number(value) if widths[key] == 1 else file.numbers(value, widths[key])
        for key, value in written.items()
    }
    if kind.dimensions == 3 and not any(given["rotation"]):
        expected = "a quaternion w, x, y, z with a length, such as [1, 0, 0, 0]"
        raise ScadError("the rotation is zero", *file.place(written["rotation"]), expected=expected)
    return kind(**given)


class _Node:
    """A node as written: `places`, where each of its primitives is called, and those that are cut out, `outside`."""

    def __init__(self, file: Contents, count: int, body: Call):
        self.places: dict[int, Call] = {}
        self.outside: set[int] = set()
        self._file, self._count = file, count
        if body.name == "difference" and body.children:
            self._within(body.children[0])
            for cut in body.children[1:]:
                self.outside.add(self._add(cut))
        else:
            self._within(body)

    def _within(self, base: Call) -> None:
        if base.name in _WINDOWS:
            self._file.arguments(base, 0)
            without_children(base)
        elif base.name == "intersection" and base.children:
            for member in base.children:
                self._add(member)
        else:
            self._add(base)

    def _add(self, member: Call) -> int:
        match = _NUMBERED.fullmatch(member.name)
        if match is None or match[1] != "F" or int(match[2]) > self._count:
            expected = f"one of F1 to F{self._count}, an intersection of them, or a difference"
            raise ScadError(f"found {quoted(member.name)}", *member.at, member.name, expected)
        self._file.module(member)
        place = int(match[2]) - 1
        if place in self.places:
            raise ScadError(f"{member.name} stands twice", *member.at, member.name, "each once")
        self.places[place] = member
        return place


def _complement(count: int, nodes: list[_Node]) -> torch.Tensor:
    """Which primitives are cut out. Raises ScadError for one that a node cuts out and another does not."""
    said: dict[int, bool] = {}
    for node in nodes:
        for place, member in node.places.items():
            outside = place in node.outside
            if said.setdefault(place, outside) != outside:
                found = f"{member.name} is {'cut out' if outside else 'kept'} here, and not in another node"
                raise ScadError(found, *member.at, member.name, "the same in all nodes")
    return torch.tensor([said.get(place, False) for place in range(count)])


def _read_union(file: Contents, shape: Module, count: int) -> torch.Tensor:
    union = torch.zeros(count, dtype=torch.bool)
    if not shape.children:
        return union
    body = only_child(shape)
    if body.name == "intersection" and len(body.children) == 2 and body.children[0].name in _WINDOWS:
        window, body = body.children
        file.arguments(without_children(window), 0)
    for node in body.children if body.name == "union" else (body,):
        match = _NUMBERED.fullmatch(node.name)
        if match is None or match[1] != "S":
            raise ScadError(f"found {quoted(node.name)}", *node.at, node.name, "nodes: S1, S2, …")
        file.module(node)
        union[int(match[2]) - 1] = True
    return union
