"""Stage 8a: symmetric sub-assemblies (paper, Appendix C, "Symmetry Detection").

Two legs joined by a bar touch different parts than their mirror images do, so no leg forms a pair by itself. But the
connected components of parts that all have a mirror image do: each such component becomes an inner part of its own,
a sub-program, which is then mirrored as a whole.
"""

from collections.abc import Callable, Sequence

import torch
from scipy.sparse.csgraph import connected_components

from .bounding import enclosing_box, part_leaves
from .contacts import Contact
from .facts import BlockFacts
from .partgraph import Part, stack
from .symmetry import is_image, mirror_images


def join_components(
    facts: BlockFacts,
    alike: float,
    holds_together: Callable[[list[int]], bool],
    axes: tuple[int, ...] = (0, 2),
) -> list[Part]:
    """The block's parts, mirrored components joined into inner parts; the same list if there are none.

    holds_together   would these parts be held by one another, and by the box around them, as well as they are now?
    """
    images = mirror_images(facts.parts, facts.boxes, facts.size, alike)
    for axis in axes:
        pairs = dict(images[axis].nonzero().tolist())
        if len(pairs) < 2:
            continue
        used, joined = set(), []
        for component in _components(list(pairs), facts.contacts):
            image = [pairs[i] for i in component]
            halves = [join([facts.parts[i] for i in half]) for half in (component, image)]
            if (
                _same_partners(component, pairs, facts.contacts)
                and is_image(*halves, axis, alike * float(facts.size.max()))
                and holds_together(component)
            ):
                used |= {*component, *image}
                joined += halves
        if joined:
            return [part for i, part in enumerate(facts.parts) if i not in used] + joined
    return list(facts.parts)


def join(parts: list[Part]) -> Part:
    """One inner part that holds `parts`, labelled like the first of them."""
    box = enclosing_box(stack(part_leaves(tuple(parts))))  # its axes are named already
    return Part(parts[0].label, box, tuple(parts), parts[0].id)


def _components(cuboids: list[int], contacts: Sequence[Contact]) -> list[list[int]]:
    """Sets of two and more of the cuboids that hang together."""
    index = {cuboid: k for k, cuboid in enumerate(cuboids)}
    links = torch.zeros(len(cuboids), len(cuboids))
    for contact in contacts:
        if contact.firm and contact.first in index and contact.second in index:
            links[index[contact.first], index[contact.second]] = 1
    _, number = connected_components(links.numpy(), directed=False)
    groups: dict[int, list[int]] = {}
    for cuboid, group in zip(cuboids, number.tolist()):
        groups.setdefault(group, []).append(cuboid)
    return [group for group in groups.values() if len(group) > 1]


def _same_partners(component: list[int], pairs: dict[int, int], contacts: Sequence[Contact]) -> bool:
    """Do both halves touch the same other parts, and at least one?"""
    half, other = set(component), {pairs[i] for i in component}
    if len(other) < len(half):
        return False
    touched = [
        {c.partner(i) for c in contacts if c.firm for i in (c.first, c.second) if i in side} - half - other
        for side in (half, other)
    ]
    return bool(touched[0]) and touched[0] == touched[1]
