"""StructureNet's JSON -> PartGraph, and back. Every problem is told with the part it is about.

    part := {"id": 0, "label": "chair", "box": [12 numbers], "children": [part, …], "edges": [object, …]}
    box  := center x y z,  FULL side lengths along axes 1 2 3,  axis 1 x y z,  axis 2 x y z

Axis 3 is axis 1 x axis 2, so every box is right-handed; axes 1, 2, 3 become right, top, front as they come. World
axes and units are those of the file: x right, y up, z to the front. Beside the label and, for leaves, the box,
everything may be missing or null; an inner part without a box gets the bounds of its leaves.
"""

import json
import warnings
from collections.abc import Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path

from ..interpreters.cuboids import Cuboids
from .boxes import oriented_boxes
from .errors import PartGraphError, PartGraphWarning
from .labels import RANKED
from .nodes import MOST_SHOWN, TOO_DEEP, Node, ids_of, list_of, shown, walk
from .partgraph import CATEGORIES, UNLABELLED, Part, PartGraph, unstack

ALIASES = {"storagefurniture": "storage"}  # PartNet's own name
_MOST_LISTED = 40  # words in a message


def parse(source: str | bytes | dict, category: str = "", file: str = "") -> PartGraph:
    """The part graph of a JSON text or of the object in it; the graph's name is the stem of `file`.

    category  "chair", "table" or "storage", to be warned of labels it does not know; "" for no warning.
    Raises PartGraphError with file, part and what is wrong; warns with PartGraphWarning of what was put right.
    """
    category = known_category(category)
    try:
        nodes = walk(_read_json(source) if isinstance(source, str | bytes) else source)
        boxes, repaired = oriented_boxes(nodes)
        root = _build(nodes, unstack(boxes), ids_of(nodes))
    except PartGraphError as error:
        raise error.in_file(file) from None
    unknown = _unknown_labels(nodes, category)
    if repaired:
        paths = _listed([node.path for node in repaired])
        _warn(f"axes set at right angles and to length 1 in {paths}", file)
    if unknown:
        _warn(f"labels that no {category} of the authors' data has: {_listed(unknown)}", file)
    return PartGraph(root, category, Path(file).stem if file else "")


def known_category(category: str) -> str:
    """The category by our name for it. Raises PartGraphError naming the choices."""
    name = ALIASES.get(category, category)
    if name not in (*CATEGORIES, ""):
        choices = ", ".join(CATEGORIES)
        raise PartGraphError(f"unknown category {shown(category)}", f'one of {choices}, or "" for none')
    return name


def to_json(graph: PartGraph) -> str:
    """The graph on one line, the only kind of file that the authors' reader takes; numbers in full precision.

    Ids that repeat are replaced by 0, 1, 2, …. Raises PartGraphError for a graph that could not be read again.
    """
    try:
        parts = list(graph.root.walk())
        repeated = len({part.id for part in parts}) < len(parts)
        numbers = count() if repeated else (part.id for part in parts)
        value = _to_value(graph.root, numbers)
        text = json.dumps(value)
    except RecursionError:
        raise PartGraphError(*TOO_DEEP, file=graph.name) from None
    except (TypeError, ValueError) as error:  # edges made by code can hold anything
        raise PartGraphError(f"the edges are no JSON ({error})", "plain values", file=graph.name) from None
    parse(value, file=graph.name)
    return text


def _to_value(part: Part, numbers: Iterator[int]) -> dict:
    size, center, axes = (
        tensor.detach().double().flatten().tolist()
        for tensor in (part.box.size, part.box.center, part.box.axes)
    )
    value = {"id": next(numbers), "label": part.label, "box": center + size + axes[:6]}
    if part.children:
        value["children"] = [_to_value(child, numbers) for child in part.children]
    if part.edges:
        value["edges"] = list(part.edges)
    return value


def _read_json(text: str | bytes) -> object:
    """The value in a text: in all of it or, failing that, in its last line, which is all the authors' reader keeps."""
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8")
        except UnicodeDecodeError as error:
            raise PartGraphError(f"not a text file: byte {error.start} is not UTF-8", "JSON") from None
    text = text.removeprefix("\ufeff").rstrip()
    if not text:
        raise PartGraphError("the text is empty", "one JSON object")
    try:
        return _loads(text)
    except PartGraphError:
        last = text.rpartition("\n")[2]
        if last.lstrip().startswith("{"):
            with suppress(PartGraphError):
                return _loads(last)
        raise


def _loads(text: str) -> object:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise PartGraphError(f"not JSON: {error.msg} at {place}", "one JSON object") from None
    except RecursionError:
        raise PartGraphError(*TOO_DEEP) from None
    except ValueError:  # Python does not convert them: that would take too long
        raise PartGraphError("not JSON: a number with thousands of digits", "one JSON object") from None


def _build(nodes: list[Node], boxes: list[Cuboids], ids: list[int]) -> Part:
    """The tree, from the leaves up; the root is built last."""
    for at in reversed(range(len(nodes))):
        node = nodes[at]
        edges = tuple(list_of(node, "edges"))
        part = Part(node.get("label"), boxes[at], tuple(node.built[::-1]), ids[at], edges)
        if node.parent:
            node.parent.built.append(part)
    return part


def _unknown_labels(nodes: list[Node], category: str) -> list[str]:
    known = {*RANKED.get(category, ()), UNLABELLED}
    labels = dict.fromkeys(node.get("label") for node in nodes) if category else ()
    return [repr(label[:MOST_SHOWN]) for label in labels if label not in known]


def _warn(message: str, file: str) -> None:
    warnings.warn(PartGraphWarning(f"{file}: {message}" if file else message), stacklevel=3)


def _listed(words: list[str]) -> str:
    more = f" and {len(words) - _MOST_LISTED} more" if len(words) > _MOST_LISTED else ""
    return ", ".join(words[:_MOST_LISTED]) + more
