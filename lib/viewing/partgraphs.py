"""Figures about part graphs and what an extraction finds out about them.

print(tree(graph))                      labels and sizes, a line a part
labelled(graph)                         leaves coloured by label, with a legend
change_sheet(steps, changes)            stages side by side, what changed in colour
contact_sheet(boxes, contact_lists)     dots where translucent boxes touch
group_sheet(facts)                      the copies in each block
ways_chart(ways, tolerance, chosen)     how well each way of holding a part would do
"""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
import trimesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lib.extractor import BlockFacts, Part, PartGraph
from lib.extractor.contacts import FACE_TO_FACE, IN_FACE, MIDDLE, Contact
from lib.extractor.partgraph import stack
from lib.extractor.placing import Way
from lib.interpreters.cuboids import Cuboids
from lib.interpreters.shapeassembly.meshing import boxes_mesh
from lib.interpreters.shapeassembly.shape import PALETTE
from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, draw, show

PALE = (222, 224, 228)  # what is not being talked about
SAME = 1e-6  # world units: below it, two boxes are the same
KINDS = {  # of contact -> colour, words
    FACE_TO_FACE: ("#d62839", "face on face"),
    IN_FACE: ("#e08a00", "center of a face in the other"),
    MIDDLE: ("#1d6fb8", "middle of what they share"),
}
_WAYS = {1: ("#9aa5b8", "one attach"), 2: ("#5e8bba", "two attaches"), "squeeze": ("#70ad77", "squeeze")}


def tree(graph: PartGraph, sizes: bool = True) -> str:
    """The parts as lines of text: branches, labels and (rounded) sizes."""
    lines: list[str] = []

    def visit(part: Part, stem: str, branch: str, below: str) -> None:
        size = " × ".join(f"{side:.2f}" for side in part.box.size.tolist())
        lines.append(f"{stem + branch + part.label:40s} {size if sizes else ''}".rstrip())
        for number, child in enumerate(part.children, 1):
            last = number == len(part.children)
            visit(child, stem + below, "└── " if last else "├── ", "    " if last else "│   ")

    visit(graph.root, "", "", "")
    return "\n".join(lines)


def painted(boxes: Cuboids, marks: Sequence[int | None]) -> trimesh.Trimesh:
    """Boxes (n) as a mesh; box i has colour number marks[i] of the palette, or a pale grey for None."""
    colors = [PALE if mark is None else PALETTE[mark % len(PALETTE)] for mark in marks]
    return boxes_mesh(boxes, np.array(colors, dtype=np.uint8).reshape(-1, 3))


def labelled(graph: PartGraph, size: float = 3.6) -> Figure:
    """The leaves, a colour a label, and the labels beside them with how many leaves bear each."""
    labels = graph.labels
    return _with_legend(graph, {label: f"{label} × {labels.count(label)}" for label in labels}, size)


def _with_legend(graph: PartGraph, words: Mapping[str, str], size: float) -> Figure:
    figure = plt.figure(figsize=(size * 1.75, size), dpi=100)
    plt.close(figure)
    ax = figure.add_axes((0, 0, 1 / 1.75, 1))
    draw(ax, graph)
    handles = [
        Patch(color=np.array(PALETTE[k % len(PALETTE)]) / 255, label=word)
        for k, word in enumerate(words.values())
    ]
    figure.legend(handles=handles, loc="center left", bbox_to_anchor=(0.58, 0.5), frameon=False, fontsize=9)
    return figure


def by_branch(graph: PartGraph) -> list[int]:
    """For each leaf a number for the part it hangs on: leaves with one number are siblings."""
    parents = {id(child): part for part in graph.root.walk() for child in part.children}
    owners = [id(parents[id(leaf)]) for leaf in graph.root.leaves()]
    number = {owner: k for k, owner in enumerate(dict.fromkeys(owners))}
    return [number[owner] for owner in owners]


def inner_boxes(graph: PartGraph) -> Cuboids:
    """The boxes of all inner parts, the root included."""
    return stack([part for part in graph.root.walk() if part.children])


def what_changed(before: PartGraph, after: PartGraph) -> dict[str, set[int]]:
    """Ids of leaves by what became of them: "gone", "new", "rehung" (another parent), "turned", "resized"."""
    old, new = ({leaf.id: leaf.box for leaf in graph.root.leaves()} for graph in (before, after))
    parents = [_parent_ids(graph) for graph in (before, after)]
    both = old.keys() & new.keys()
    return {
        "gone": old.keys() - new.keys(),
        "new": new.keys() - old.keys(),
        "rehung": {i for i in both if parents[0][i] != parents[1][i]},
        "turned": {i for i in both if float((old[i].axes - new[i].axes).abs().max()) > SAME},
        "resized": {i for i in both if float((old[i].size - new[i].size).abs().max()) > SAME},
    }


def _parent_ids(graph: PartGraph) -> dict[int, int]:
    return {child.id: part.id for part in graph.root.walk() for child in part.children}


def change_sheet(
    steps: Mapping[str, PartGraph], changes: Sequence[tuple[str, str, str]], **options
) -> Figure:
    """For each (stage before, stage after, what) the later stage, coloured where `what` happened to leaves.

    `what` is a key of `what_changed`; `options` are those of `lib.viewing.figure.show`.
    """
    pictures, titles = [], []
    for before, after, what in changes:
        changed = what_changed(steps[before], steps[after])[what]
        leaves = steps[after].root.leaves()
        pictures.append(painted(stack(leaves), [3 if leaf.id in changed else None for leaf in leaves]))
        titles.append(f"{after}: {len(changed)} leaves {what}")
    return show(pictures, titles, **options)


def contact_sheet(
    boxes: Cuboids | Sequence[Cuboids],
    contacts: Sequence[Sequence[Contact]],
    titles: Sequence[str],
    size: float = 3.2,
    columns: int = 4,
) -> Figure:
    """Translucent boxes (n), a dot at each contact with lines to the centers of the two boxes that touch.

    boxes  one batch for all pictures, or one a picture. Contacts with the bounding box have a line to one center.
    """
    batches = [boxes] * len(contacts) if isinstance(boxes, Cuboids) else list(boxes)
    camera = Camera(bounds=bounds_of(*batches))
    columns = min(columns, len(contacts))
    rows = -(-len(contacts) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(size * columns, (size + 0.25) * rows + 0.3), squeeze=False
    )
    plt.close(figure)
    figure.subplots_adjust(0.01, 0.06 + 0.5 / (size * rows + 0.3), 0.99, 1, 0.02, 0.1)
    for ax in axes.flat:
        ax.axis("off")
    for ax, batch, found, title in zip(axes.flat, batches, contacts, titles, strict=False):
        ax.axis("on")
        draw(ax, batch, camera=camera, ghost=batch, opacity=0.42, shadow=False)
        for contact in found:
            _draw_contact(ax, contact, batch, camera)
        ax.set_xlabel(title, fontsize=9)
    kinds = dict.fromkeys(kind for found in contacts for kind in sorted(c.kind for c in found))
    dots = {"linestyle": "", "marker": "o", "markeredgecolor": "white", "markersize": 7}
    handles = [Line2D([], [], color=KINDS[kind][0], label=KINDS[kind][1], **dots) for kind in sorted(kinds)]
    if handles:
        figure.legend(handles=handles, loc="lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def _draw_contact(ax, contact: Contact, boxes: Cuboids, camera: Camera) -> None:
    color = KINDS[contact.kind][0]
    at = np.array([contact.point])
    for cuboid in (contact.first, contact.second):
        if cuboid >= 0:
            ends = np.concatenate([at, boxes.center[[cuboid]].numpy()])
            ax.plot(*camera.project(ends).T, color=color, linewidth=1.1, zorder=4)
    dot = {"s": 46, "edgecolors": "white", "linewidths": 1.0, "zorder": 6}
    ax.scatter(*camera.project(at).T, color=color, **dot)


def blocks_of(facts: BlockFacts, name: str = "") -> list[tuple[str, BlockFacts]]:
    """The facts of a block and of all blocks in it, by the label of the part they are about, breadth-first."""
    found = [(name, facts)]
    for _, block in found:  # grows while it is walked
        found += [(block.parts[i].label, inside) for i, inside in (block.inner or {}).items()]
    return found


def group_sheet(facts: BlockFacts, name: str = "", size: float = 2.4, columns: int = 4) -> Figure:
    """A picture for each block in which there is a group: its members in one colour, all else pale."""
    pictures, titles = [], []
    for label, block in blocks_of(facts, name):
        if not block.groups:
            continue
        pictures.append(painted_groups(block))
        lines = [f"{group.kind} {group.axis}, {len(group.members)} parts" for group in block.groups]
        titles.append("\n".join([f"{label}:", *lines]))
    return show(pictures, titles, size=size, columns=min(columns, max(1, len(pictures))))


def painted_groups(facts: BlockFacts) -> trimesh.Trimesh:
    """The leaves of a block, those of a group in one colour."""
    number = {member: k for k, group in enumerate(facts.groups) for member in group.members}
    leaves = [(leaf, number.get(i)) for i, part in enumerate(facts.parts) for leaf in part.leaves()]
    boxes = stack([leaf for leaf, _ in leaves])
    return painted(boxes, [mark for _, mark in leaves])


def ways_chart(ways: Sequence[Way], tolerance: float, chosen: Way, title: str) -> Figure:
    """A bar a way, the best first, coloured by what it is made of; a star over the one that was taken.

    Misfits are in block units, on a logarithmic scale that begins at a thirtieth of `tolerance`.
    """
    ordered = sorted(ways, key=lambda way: way.misfit)
    kinds = ["squeeze" if way.face else len(way.partners) for way in ordered]
    figure, ax = plt.subplots(figsize=(7.2, 2.9), dpi=100)
    plt.close(figure)
    bottom = tolerance / 30
    heights = [max(way.misfit, 1.15 * bottom) for way in ordered]
    ax.bar(range(1, len(ordered) + 1), heights, color=[_WAYS[kind][0] for kind in kinds], width=0.85)
    ax.axhline(tolerance, color="#d62839", linewidth=1, linestyle="--")
    taken = [(way.points, way.partners) == (chosen.points, chosen.partners) for way in ordered].index(True)
    ax.scatter([taken + 1], [heights[taken] * 1.35], marker="*", s=110, color="#1b1f27", zorder=4)
    handles = [Patch(color=color, label=word) for kind, (color, word) in _WAYS.items() if kind in kinds]
    handles.append(Line2D([], [], color="#d62839", linestyle="--", label="below: as good as 0"))
    handles.append(Line2D([], [], color="#1b1f27", marker="*", linestyle="", markersize=9, label="taken"))
    ax.set_yscale("log")
    ax.set(xlabel="ways, the best first", ylabel="misfit (block units)", ylim=(bottom, 3 * max(heights)))
    ax.set_title(title, fontsize=10)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(handles=handles, fontsize=8, frameon=False, loc="upper left", ncols=2)
    figure.tight_layout()
    return figure
