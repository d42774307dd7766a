"""Tables: a top and a base, each chosen on its own, in the proportions of a kind of table.

table > regular_table > [tabletop, table_base]; both are groups of PartNet's. Desks get boxes with drawers below.
"""

from dataclasses import dataclass

from . import desks
from . import table_bases as bases
from .kit import Piece, Workshop, group


@dataclass
class Frame:
    """The measures of a table, metres; `height` is that of the top's upper side, `thick` the top's thickness."""

    width: float
    depth: float
    height: float
    thick: float
    overhang: float = 0.0  # of the top beyond the base
    central: bool = False  # is the base in the middle only?

    @property
    def under(self) -> float:
        """Height of the underside of the top."""
        return self.height - self.thick

    @property
    def base(self) -> tuple[float, float]:
        """Half the width and half the depth of the base."""
        return self.width / 2 - self.overhang, self.depth / 2 - self.overhang


def table(workshop: Workshop) -> Piece:
    """One table of a kind drawn at random."""
    kind = workshop.weighted({dining: 28, coffee: 22, side: 18, console: 10, desk: 24})
    frame, top, base = kind(workshop)
    if base is desks.drawer_box and top in (planks, slab_on_apron):
        top = slab  # an apron would hide the drawers
    frame.central = base in bases.CENTRAL
    if frame.central and base is not bases.two_pedestals:
        frame.width = min(frame.width, 1.3 * frame.depth)
    pieces = [group("tabletop", *top(workshop, frame)), group("table_base", *base(workshop, frame))]
    if workshop.chance(0.8):
        return group("table", group("regular_table", *pieces))
    return group("table", *pieces)


def dining(shop: Workshop):
    """A table to sit at."""
    width = shop.between(0.9, 2.0)
    depth = shop.weighted({shop.between(0.75, 1.0): 3, width: 1}) if width < 1.4 else shop.between(0.75, 1.0)
    frame = Frame(
        width, min(depth, width), shop.between(0.7, 0.78), shop.between(0.025, 0.06), shop.between(0.0, 0.12)
    )
    base = shop.weighted(
        {
            bases.legs: 8,
            bases.trestle: 3,
            bases.pedestal: 3,
            bases.two_pedestals: 1.5,
            bases.crossed: 1.5,
            bases.panels: 1.5,
            bases.frames: 1.5,
        }
    )
    return frame, shop.pick(slab, planks, framed, glass, leaves, slab_on_apron), base


def coffee(shop: Workshop):
    """A low table before a sofa."""
    width = shop.between(0.7, 1.3)
    depth = shop.pick(width * shop.between(0.45, 0.7), width)
    frame = Frame(width, depth, shop.between(0.3, 0.48), shop.between(0.025, 0.08), shop.between(0.0, 0.08))
    base = shop.weighted(
        {
            bases.legs: 4,
            bases.shelf_legs: 4,
            bases.pedestal: 1.5,
            bases.crossed: 1,
            bases.panels: 2,
            bases.frames: 2,
            bases.cube: 1,
        }
    )
    return frame, shop.pick(slab, planks, framed, glass, glass, slab_on_apron), base


def side(shop: Workshop):
    """A small table beside a bed or a chair."""
    width = shop.between(0.35, 0.6)
    frame = Frame(
        width,
        width * shop.pick(1.0, shop.between(0.8, 1.0)),
        shop.between(0.45, 0.75),
        shop.between(0.02, 0.045),
    )
    frame.overhang = shop.between(0.0, 0.05)
    base = shop.weighted(
        {
            bases.legs: 3,
            bases.shelf_legs: 3,
            bases.pedestal: 3,
            bases.tripod: 1.5,
            desks.drawer_box: 2,
            bases.c_frame: 1,
            bases.panels: 1,
        }
    )
    return frame, shop.pick(slab, slab, framed, glass, slab_on_apron), base


def console(shop: Workshop):
    """A narrow table against a wall, or a bench-like one."""
    width = shop.between(0.9, 1.5)
    frame = Frame(
        width,
        shop.between(0.3, 0.42),
        shop.between(0.7, 0.95),
        shop.between(0.025, 0.06),
        shop.between(0, 0.05),
    )
    base = shop.pick(
        bases.legs, bases.shelf_legs, desks.drawer_box, bases.panels, bases.frames, bases.trestle
    )
    return frame, shop.pick(slab, slab, framed, planks, slab_on_apron), base


def desk(shop: Workshop):
    """A writing desk."""
    width = shop.between(1.1, 1.8)
    frame = Frame(
        width,
        shop.between(0.55, 0.8),
        shop.between(0.7, 0.78),
        shop.between(0.025, 0.05),
        shop.between(0, 0.04),
    )
    base = shop.weighted(
        {
            desks.drawer_towers: 4,
            desks.one_tower: 4,
            desks.drawer_box: 3,
            bases.panels: 2,
            bases.frames: 2,
            desks.keyboard_desk: 1.5,
        }
    )
    return frame, shop.pick(slab, slab, slab, framed, slab_with_riser), base


# Tops


def _board(shop: Workshop, frame: Frame, label: str, y: tuple, border: float = 0.0) -> Piece:
    """A board over the whole top, `border` metres smaller on each side."""
    x, z = frame.width / 2 - border, frame.depth / 2 - border
    return shop.block(label, (-x, x), y, (-z, z))


def slab(shop: Workshop, frame: Frame) -> list[Piece]:
    """One board."""
    return [group("tabletop_surface", _board(shop, frame, "board", (frame.under, frame.height)))]


def planks(shop: Workshop, frame: Frame) -> list[Piece]:
    """Boards side by side, lengthwise or across, on two bars."""
    count, bar, x, z = shop.pick(3, 4, 5, 6), 0.025, frame.width / 2, frame.depth / 2
    y, low = (frame.under, frame.height), (frame.under - bar, frame.under)
    if shop.chance(0.5):
        pitch = frame.depth / (count - 0.05)
        first, step = shop.block("board", (-x, x), y, (-z, -z + 0.95 * pitch)), (0, 0, pitch)
        bars = shop.both(shop.block("bar", (x * 0.7, x * 0.7 + 0.06), low, (-z * 0.95, z * 0.95)))
    else:
        pitch = frame.width / (count - 0.05)
        first, step = shop.block("board", (-x, -x + 0.95 * pitch), y, (-z, z)), (pitch, 0, 0)
        bar_z = z * 0.7
        bars = shop.row(
            shop.block("bar", (-x * 0.95, x * 0.95), low, (-bar_z, -bar_z + 0.06)),
            (0, 0, 2 * bar_z - 0.06),
            2,
        )
    return [group("tabletop_surface", *shop.row(first, step, count)), group("tabletop_frame", *bars)]


def _ring(shop: Workshop, label: str, half: tuple[float, float], y: tuple, wide: float) -> list[Piece]:
    """Four bars around a rectangle with these half sides."""
    x, z = half
    sides = shop.both(shop.block(label, (x - wide, x), y, (-z, z)))
    return sides + shop.row(
        shop.block(label, (wide - x, x - wide), y, (z - wide, z)), (0, 0, wide - 2 * z), 2
    )


def framed(shop: Workshop, frame: Frame) -> list[Piece]:
    """A board inside four bars."""
    wide, half = shop.between(0.03, 0.07), (frame.width / 2, frame.depth / 2)
    sunk = frame.thick * shop.between(0.0, 0.25)
    board = _board(shop, frame, "board", (frame.under + sunk, frame.height - sunk), wide)
    bars = _ring(shop, "bar", half, (frame.under, frame.height), wide)
    return [group("tabletop_surface", board), group("tabletop_frame", *bars)]


def glass(shop: Workshop, frame: Frame) -> list[Piece]:
    """A pane of glass, lying free, in a ring of bars, or on two bars."""
    style = shop.pick("free", "ring") if frame.central else shop.pick("free", "ring", "bars")
    if style == "free":
        return [group("tabletop_surface", _board(shop, frame, "glass", (frame.under, frame.height)))]
    if style == "ring":
        wide = shop.between(0.03, 0.06)
        pane = _board(shop, frame, "glass", (frame.under + 0.005, frame.height - 0.003), wide)
        bars = _ring(shop, "bar", (frame.width / 2, frame.depth / 2), (frame.under, frame.height), wide)
    else:
        middle = frame.under + frame.thick / 2
        pane, z = _board(shop, frame, "glass", (middle, frame.height)), frame.base[1]
        x = frame.base[0] - shop.between(0, 0.05)
        bars = shop.both(shop.block("bar", (x - 0.05, x), (frame.under, middle), (-z, z)))
    return [group("tabletop_surface", pane), group("tabletop_frame", *bars)]


def slab_on_apron(shop: Workshop, frame: Frame) -> list[Piece]:
    """A board with an apron of four bars below it, around the ends of the legs."""
    apron, y = shop.between(0.04, 0.09), frame.under
    board = _board(shop, frame, "board", (y, frame.height))
    bars = _ring(shop, "bar", frame.base, (y - apron, y), shop.between(0.018, 0.03))
    return [group("tabletop_surface", board), group("tabletop_frame", *bars)]


def leaves(shop: Workshop, frame: Frame) -> list[Piece]:
    """A middle board with a leaf at either end, hanging or pulled out."""
    middle, leaf, y = frame.width / 2, shop.between(0.16, 0.3), (frame.under, frame.height)
    board = _board(shop, frame, "board", y)
    if shop.chance(0.5):
        low = frame.height - leaf * shop.between(0.8, 1.3)
        side = shop.block(
            "tabletop_dropleaf",
            (middle, middle + 0.022),
            (low, frame.height),
            (-frame.depth / 2, frame.depth / 2),
        )
    else:
        side = shop.block(
            "tabletop_dropleaf", (middle, middle + leaf), y, (-frame.depth / 2, frame.depth / 2)
        )
    return [group("tabletop_surface", board), *shop.both(side)]


def slab_with_riser(shop: Workshop, frame: Frame) -> list[Piece]:
    """A board that carries a narrow second one at its back."""
    x, z, rise = frame.width / 2, frame.depth / 2, shop.between(0.1, 0.3)
    deep, y = frame.depth * shop.between(0.25, 0.4), frame.height
    board = _board(shop, frame, "board", (frame.under, y))
    upper = shop.block("board", (-x, x), (y + rise, y + rise + 0.022), (-z, -z + deep))
    posts = shop.both(shop.block("tabletop_connector", (x - 0.022, x), (y, y + rise), (-z, -z + deep)))
    if shop.chance(0.5):
        posts.append(shop.block("tabletop_connector", (-0.011, 0.011), (y, y + rise), (-z, -z + deep)))
    return [group("tabletop_surface", board, upper), *posts]
