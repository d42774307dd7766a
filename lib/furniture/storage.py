"""Storage furniture: a carcass, what fills it, what it stands on and what crowns it, each chosen on its own.

storage_furniture > cabinet > [cabinet_frame, cabinet_base, shelf, drawer, cabinet_door, …]: as in PartNet the
fronts and the shelves are not in the frame's group, though they touch it.
"""

from dataclasses import dataclass

from . import storage_fronts as fronts
from .kit import Piece, Workshop, group, tilt


@dataclass
class Carcass:
    """The outside of a cabinet, metres: x from -width/2, y from `bottom` to `top`, z from -depth/2 (the back)."""

    width: float
    bottom: float
    top: float
    depth: float
    board: float  # thickness of its panels
    backed: bool = True  # has a back panel

    @property
    def inside(self) -> tuple[tuple, tuple, tuple]:
        """Ranges (x, y, z) of the hollow between the panels."""
        x, z = self.width / 2 - self.board, self.depth / 2
        back = self.board * 0.7 if self.backed else 0.0
        return (-x, x), (self.bottom + self.board, self.top - self.board), (back - z, z)


def storage(workshop: Workshop) -> Piece:
    """One piece of a kind drawn at random."""
    kind = workshop.weighted(
        {bookcase: 22, cabinet: 18, chest: 18, sideboard: 14, wardrobe: 10, rack: 7, hutch: 8, ladder: 3}
    )
    pieces = kind(workshop)
    if workshop.chance(0.5):
        return group("storage_furniture", group("cabinet", *pieces))
    return group("storage_furniture", *pieces)


def bookcase(shop: Workshop) -> list[Piece]:
    """Open shelves in one to three columns, or cubes."""
    width, height = shop.between(0.5, 1.3), shop.between(0.8, 2.0)
    carcass = Carcass(width, 0, height, shop.between(0.25, 0.38), shop.between(0.02, 0.04), shop.chance(0.7))
    columns = shop.pick(*range(1, 1 + max(1, min(3, int(width / 0.33)))))
    return _stand(shop, carcass, fronts.shelves(columns), shop.weighted({"none": 3, "plinth": 2, "feet": 1}))


def cabinet(shop: Workshop) -> list[Piece]:
    """Doors, one to four, with shelves behind them or drawers above them."""
    width, height = shop.between(0.4, 1.2), shop.between(0.55, 1.4)
    carcass = Carcass(width, 0, height, shop.between(0.32, 0.55), shop.between(0.02, 0.035))
    fill = shop.weighted({fronts.doors: 3, fronts.doors_below_drawers: 3, fronts.open_above_doors: 2})
    return _stand(shop, carcass, fill, shop.pick("none", "plinth", "feet", "legs", "casters", "frame"))


def chest(shop: Workshop) -> list[Piece]:
    """Drawers in rows, also as a bedside chest or a dresser with a mirror."""
    kind = shop.weighted({"chest": 3, "bedside": 2, "dresser": 2})
    widths = {"chest": (0.6, 1.0), "bedside": (0.38, 0.55), "dresser": (1.0, 1.5)}
    heights = {"chest": (0.75, 1.3), "bedside": (0.4, 0.65), "dresser": (0.65, 0.9)}
    carcass = Carcass(
        shop.between(*widths[kind]), 0, shop.between(*heights[kind]), shop.between(0.38, 0.5), 0.025
    )
    fill = fronts.drawers_below_open if kind == "bedside" and shop.chance(0.4) else fronts.drawers(kind)
    pieces = _stand(shop, carcass, fill, shop.pick("none", "plinth", "feet", "legs", "casters", "frame"))
    if kind == "dresser" and shop.chance(0.5):
        pieces.append(_mirror(shop, carcass))
    return pieces


def sideboard(shop: Workshop) -> list[Piece]:
    """Long and low: doors, drawers and open places side by side; media benches and kitchen units too."""
    carcass = Carcass(
        shop.between(1.1, 1.9), 0, shop.between(0.45, 0.9), shop.between(0.36, 0.5), shop.between(0.02, 0.035)
    )
    return _stand(shop, carcass, fronts.mixed_columns, shop.pick("none", "plinth", "feet", "legs", "frame"))


def wardrobe(shop: Workshop) -> list[Piece]:
    """Tall doors, sometimes above drawers."""
    carcass = Carcass(
        shop.between(0.7, 1.4), 0, shop.between(1.7, 2.1), shop.between(0.45, 0.6), shop.between(0.025, 0.04)
    )
    fill = shop.pick(fronts.doors, fronts.doors_above_drawers)
    return _stand(shop, carcass, fill, shop.pick("none", "plinth", "feet"))


def rack(shop: Workshop) -> list[Piece]:
    """Shelves between four posts, open all around, sometimes on casters."""
    width, depth, height = shop.between(0.45, 1.2), shop.between(0.3, 0.45), shop.between(0.7, 1.9)
    post, count, board = shop.between(0.022, 0.04), shop.pick(3, 4, 5), shop.between(0.018, 0.035)
    x, z = width / 2, depth / 2
    floor = 0.07 if shop.chance(0.25) else 0.0
    front = shop.block("frame_vertical_bar", (x - post, x), (floor, height), (z - post, z))
    back = shop.copy(front, (0, 0, post - 2 * z))
    low = shop.between(0.05, 0.2) + floor
    pitch = (height - low - board) / (count - shop.pick(1, 0.6))
    inset = shop.pick(0.0, post - 0.004)
    shelf = shop.block("shelf", (inset - x, x - inset), (low, low + board), (-z + 0.004, z - 0.004))
    bars = shop.both(front, back)
    if shop.chance(0.3):
        bar = shop.block("frame_horizontal_bar", (x - post, x), (height - post, height), (post - z, z - post))
        bars += shop.both(bar)
    pieces = [group("cabinet_frame", *bars), *shop.row(shelf, (0, pitch, 0), count)]
    if floor:
        pieces.append(group("cabinet_base", *fronts.casters(shop, x - post / 2, z - post / 2)))
    return pieces


def hutch(shop: Workshop) -> list[Piece]:
    """A cupboard below, and a shallower case with shelves or doors on it."""
    width, waist, board = shop.between(0.8, 1.3), shop.between(0.7, 0.9), shop.between(0.022, 0.035)
    lower = Carcass(width, 0, waist, shop.between(0.4, 0.5), board, backed=False)
    fill = shop.pick(fronts.doors, fronts.doors_below_drawers, fronts.drawers("chest"))
    pieces = _stand(shop, lower, fill, shop.pick("none", "plinth", "feet"), crown=False)
    waist = lower.top  # the base has lifted it
    deep, top = lower.depth * shop.between(0.55, 0.75), shop.between(1.6, 2.0)
    z = (-lower.depth / 2, deep - lower.depth / 2)
    x = width / 2
    frame = shop.both(shop.block("vertical_side_panel", (x - board, x), (waist, top), z))
    frame.append(shop.block("top_panel", (board - x, x - board), (top - board, top), z))
    frame.append(shop.block("back_panel", (board - x, x - board), (waist, top - board), (z[0], z[0] + 0.02)))
    pieces[0].children += frame
    count = shop.pick(1, 2, 3)
    pitch = (top - waist) / (count + 1)
    shelf = shop.block(
        "shelf", (board - x, x - board), (waist + pitch - 0.022, waist + pitch), (z[0] + 0.02, z[1] - 0.01)
    )
    return pieces + shop.row(shelf, (0, pitch, 0), count)


def ladder(shop: Workshop) -> list[Piece]:
    """Shelves between two leaning side bars and two upright ones."""
    width = shop.between(0.5, 0.8)
    height = shop.between(1.2, 1.8)
    depth = shop.between(0.35, 0.5)
    thick = 0.035
    x, z, top_z = width / 2, depth / 2, shop.between(0.1, 0.2)
    leaning = shop.beam(
        "frame_vertical_bar", (x - thick / 2, 0, z), (x - thick / 2, height, top_z - z), (thick, thick)
    )
    upright = shop.block("frame_vertical_bar", (x - thick, x), (0, height), (-z, thick - z))
    count, shelves = shop.pick(3, 4, 5), []
    for k in range(count):
        y = height * (0.12 + 0.8 * k / (count - 1))
        front = z + (top_z - 2 * z) * y / height
        shelves.append(shop.block("shelf", (thick - x, x - thick), (y, y + 0.025), (-z, front + 0.01)))
    return [group("cabinet_frame", *shop.both(leaning, upright)), *shelves]


LIFTS = {  # heights of bases, metres
    **{"none": (0, 0), "plinth": (0.05, 0.1), "feet": (0.05, 0.12)},
    **{"legs": (0.14, 0.3), "frame": (0.12, 0.3), "casters": (0.068, 0.07)},
}


def _stand(shop: Workshop, carcass: Carcass, fill, base: str, crown: bool = True) -> list[Piece]:
    """Frame, contents and base of a cabinet. `base` is one of "none", "plinth", "feet", "legs", "frame", "casters"."""
    lift = shop.between(*LIFTS[base])
    carcass.bottom, carcass.top = lift, carcass.top + lift
    panels = _panels(shop, carcass)
    inner, pieces = fill(shop, carcass)
    if crown and shop.chance(0.45):
        pieces.append(_countertop(shop, carcass))
    pieces = [group("cabinet_frame", *panels, *inner), *pieces]
    if lift:
        pieces.append(group("cabinet_base", *fronts.BASES[base](shop, carcass, lift)))
    return pieces


def _panels(shop: Workshop, carcass: Carcass) -> list[Piece]:
    """Sides, bottom, top and perhaps a back; the sides stand between top and bottom, or enclose them."""
    (left, right), (low, high), (back, front) = carcass.inside
    x, z, bottom, top = carcass.width / 2, carcass.depth / 2, carcass.bottom, carcass.top
    enclosing = shop.chance(0.65)
    side_y, flat_x = ((bottom, top), (left, right)) if enclosing else ((low, high), (-x, x))
    panels = shop.both(shop.block("vertical_side_panel", (right, x), side_y, (-z, z)))
    panels.append(shop.block("bottom_panel", flat_x, (bottom, low), (-z, z)))
    panels.append(shop.block("top_panel", flat_x, (high, top), (-z, z)))
    if carcass.backed:
        panels.append(shop.block("back_panel", (left, right), (low, high), (-z, back)))
    return panels


def _countertop(shop: Workshop, carcass: Carcass) -> Piece:
    """A board on top, which the carcass is then higher by."""
    over, x, z = shop.between(0.0, 0.03), carcass.width / 2, carcass.depth / 2
    low, carcass.top = carcass.top, carcass.top + shop.between(0.02, 0.04)
    return shop.block("countertop", (-x - over, x + over), (low, carcass.top), (-z, z + over + 0.01))


def _mirror(shop: Workshop, carcass: Carcass) -> Piece:
    """A mirror that stands on the top and leans back a little: glass in front of a board."""
    half, high, low = carcass.width * shop.between(0.25, 0.45), shop.between(0.45, 0.8), carcass.top + 0.035
    back = -carcass.depth / 2 + 0.02
    board = shop.block("other", (-half, half), (carcass.top, low + high), (back, back + 0.025))
    glass = shop.block(
        "other", (0.03 - half, half - 0.03), (low + 0.03, low + high - 0.03), (back + 0.02, back + 0.035)
    )
    return tilt(group("mirror", board, glass), shop.pick(0.0, shop.between(0.02, 0.12)), (carcass.top, back))
