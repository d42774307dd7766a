"""Stage 10: which attachment comes when (paper, section 5.2).

An order is *grounded*: it starts from the bounding box, and a cuboid is only ever attached to what already stands.
Of all grounded orders those are wanted that lose nothing: every cuboid is placed in the best of its ways. More
partners standing never makes a cuboid's best way worse, so a cuboid whose best way is already open can be placed at
once, without shutting any better order out: no enumeration of orders is needed. Where no such cuboid is left, every
order loses something, and the one that loses least goes on.

Ties are broken as the paper breaks them: by the parts' semantic order, then attachments to aligned cuboids, then
attachments at face centers.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

from .contacts import BOTTOM, INSIDE, TOP
from .errors import RejectedError
from .placing import Way

LAST_RESORT = 5  # steps of misfit that are worth less than hanging a cuboid in the middle of nothing


def best_first(
    ways: Iterable[Way], misfits: Iterable[float], tolerance: float, aligned: list[bool]
) -> tuple[Way, ...]:
    """Ways with their misfits, in their order of preference; misfits are compared in steps of `tolerance`."""
    judged = []
    for way, misfit in zip(ways, misfits):
        steps = int(min(misfit / tolerance, 1e6)) + LAST_RESORT * (way.partners == (INSIDE,))
        judged.append(replace(way, misfit=misfit, preference=_preference(way, steps, aligned)))
    return tuple(sorted(judged, key=lambda way: way.preference))


def grounded_order(
    cuboids: Iterable[int], ways: Iterable[Way], name: Callable[[int], str] = str
) -> list[Way]:
    """One way for each cuboid, in an order in which each only needs what came before.

    cuboids  the numbers of those to be placed, in semantic order;  ways  those they have, the best first
    Raises RejectedError ("disconnected") when some cuboids have no chain of contacts to the bounding box.
    """
    waiting, standing, chosen = list(cuboids), {BOTTOM, TOP, INSIDE}, []
    own: dict[int, list[Way]] = {cuboid: [] for cuboid in waiting}
    for way in ways:
        own[way.cuboid].append(way)
    while waiting:
        possible = []
        for cuboid in waiting:
            way = next((way for way in own[cuboid] if standing.issuperset(way.partners)), None)
            if way:
                possible.append((_loss(way, own[cuboid][0]), cuboid, way))
        if not possible:
            found = f"no chain of contacts holds {', '.join(map(name, waiting))}"
            raise RejectedError("disconnected", found)
        _, cuboid, way = min(possible, key=lambda option: option[:2])
        chosen.append(way)
        standing.add(cuboid)
        waiting.remove(cuboid)
    return chosen


def _preference(way: Way, steps: int, aligned: list[bool]) -> tuple:
    """What is better comes first: fit, a macro, more connections, then the paper's ties."""
    on_tilted = tuple(partner >= 0 and not aligned[partner] for partner in way.partners)
    return (steps, not way.face, -len(way.partners), way.partners, on_tilted, way.kinds, way.points)


def _loss(way: Way, best: Way) -> tuple:
    """What is given up by placing a cuboid this way: steps of fit, a macro, a connection."""
    return tuple(own - wanted for own, wanted in zip(way.preference[:3], best.preference[:3]))
