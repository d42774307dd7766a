"""The tree of a part-graph file before it has boxes: labels, ids, children and edges, checked one part at a time."""

import json
from collections.abc import Iterator
from itertools import count

from .errors import PartGraphError
from .partgraph import Part

MOST_LEVELS = 100  # PartNet's deepest tree has a dozen
MOST_PARTS = 100_000
TOO_DEEP = "parts or brackets are nested too deeply", f"at most {MOST_LEVELS} levels of parts"
MOST_SHOWN = 40  # characters of a value in a message


class Node:
    """A part as the file has it: the value, and where in the tree it stands."""

    def __init__(self, value: object, parent: "Node | None" = None, place: int = 0):
        self.value, self.parent, self.place = value, parent, place
        self.level = parent.level + 1 if parent else 1
        self.built: list[Part] = []  # its children once they are parts, the last one first

    def get(self, key: str) -> object:
        return self.value.get(key)

    @property
    def ancestors(self) -> Iterator["Node"]:
        node = self.parent
        while node:
            yield node
            node = node.parent

    @property
    def path(self) -> str:
        """Such as `chair/chair_back[1]/leg[0]`: labels, and which child of its parent each part is, from 0."""
        return "/".join(node._step for node in [self, *self.ancestors][::-1])

    @property
    def _step(self) -> str:
        label = self.value.get("label") if isinstance(self.value, dict) else None
        unnamed = "?" if self.parent else "root"
        step = repr(label[:MOST_SHOWN])[1:-1] if isinstance(label, str) else unnamed  # repr: no line breaks
        return f"{step}[{self.place}]" if self.parent else step

    def error(self, found: str, expected: str) -> PartGraphError:
        """An error about this part, by its path."""
        return PartGraphError(found, expected, self.path)


def walk(root: object) -> list[Node]:
    """Every part with its label, children and edges checked; parents before children. No depth can break a loop."""
    nodes, waiting = [], [Node(root)]
    while waiting:
        node = waiting.pop()
        nodes.append(node)
        children = _checked(node)
        if len(nodes) + len(waiting) + len(children) > MOST_PARTS:
            raise PartGraphError("too many parts", f"at most {MOST_PARTS}")
        waiting += [Node(child, node, place) for place, child in enumerate(children)][::-1]
    if len(nodes) == 1:
        raise nodes[0].error("no parts: the root has no children", "at least one leaf below the root")
    return nodes


def _checked(node: Node) -> list:
    """The children of a part that is a part."""
    if not isinstance(node.value, dict):
        raise node.error(f"found {shown(node.value)}", "a JSON object: a part")
    for ancestor in node.ancestors:
        if ancestor.value is node.value:
            raise ancestor.error("the part contains itself", "a tree of parts")
    if node.level > MOST_LEVELS:
        raise PartGraphError(*TOO_DEEP)
    label = node.get("label")
    if not isinstance(label, str) or not label:
        found = f"the label is {shown(label)}" if "label" in node.value else "no label"
        raise node.error(found, 'a word such as "leg"')
    for edge in list_of(node, "edges"):
        if not isinstance(edge, dict):
            raise node.error(f"an edge is {shown(edge)}", "a JSON object")
    return list_of(node, "children")


def list_of(node: Node, key: str) -> list | tuple:
    """The list under `key`, empty where there is none."""
    value = node.get(key)
    if value is not None and not isinstance(value, list | tuple):
        raise node.error(f"{key} is {shown(value)}", "a list")
    return value or []


def ids_of(nodes: list[Node]) -> list[int]:
    """The parts' ids; those without one get the numbers from 0 on that nobody has."""
    owner: dict[int, Node] = {}
    for node in nodes:
        number = node.get("id")
        if number is None:
            continue
        if not isinstance(number, int) or isinstance(number, bool) or abs(number) >= 2**63:
            raise node.error(f"the id is {shown(number)}", "a whole number")
        if number in owner:
            raise node.error(f"the id {number} is also that of part {owner[number].path}", "an id of its own")
        owner[number] = node
    free = (number for number in count() if number not in owner)
    return [next(free) if node.get("id") is None else node.get("id") for node in nodes]


def shown(value: object) -> str:
    """A value of a file, short and as JSON spells it, for a message."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    if isinstance(value, int) and abs(value) >= 2**63:
        return "a huge whole number"
    if isinstance(value, str):
        value = value[: MOST_SHOWN + 1]
    if value is None or isinstance(value, str | int | float):
        text = json.dumps(value)
        return text if len(text) <= MOST_SHOWN else text[: MOST_SHOWN - 1] + "…"
    return f"of type {type(value).__name__}"
