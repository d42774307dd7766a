"""Bases of tables. Each function makes the children of a table_base, from the floor to `frame.under`."""

from .chair_bases import Leg, directions, spoke, stretchers
from .kit import Piece, Workshop, group


def corner_legs(shop: Workshop, frame, splay: float = 0.0) -> tuple[Leg, Leg]:
    """The right front leg and the right back one; `splay`: how far out the feet stand, metres."""
    thick = shop.between(0.03, 0.08) if frame.width > 0.7 else shop.between(0.022, 0.04)
    x, z = (half - thick / 2 for half in frame.base)
    front = Leg((x + splay, 0, z + splay), (x, frame.under, z), thick)
    return front, Leg((x + splay, 0, -z - splay), (x, frame.under, -z), thick)


def legs(shop: Workshop, frame) -> list[Piece]:
    """Four or six legs, straight or splayed, with or without stretchers and casters."""
    splay = shop.weighted({0.0: 2, shop.between(0.02, 0.1): 1})
    if splay:
        frame.overhang += splay * shop.between(0.5, 1)
    front, back = corner_legs(shop, frame, splay)
    if not splay and shop.chance(0.1):
        return _on_casters(shop, front, back)
    pieces = shop.both(front.build(shop), back.build(shop))
    if frame.width > 1.6 and shop.chance(0.2):
        middle = Leg((0, 0, front.foot[2]), (0, frame.under, front.top[2]), front.thick).build(shop)
        return pieces + shop.row(middle, (0, 0, -front.foot[2] - front.top[2]), 2)
    style = shop.weighted({"none": 6, "sides": 1, "H": 2, "box": 1.5, "front and back": 1, "X": 1})
    return pieces + stretchers(shop, style, front, back)


def _on_casters(shop: Workshop, front: Leg, back: Leg) -> list[Piece]:
    wheels = []
    for leg in (front, back):
        leg.foot[1] = 0.07
        (x, _, z), half = leg.foot, min(leg.thick / 2, 0.02)
        wheel = shop.block("other", (x - half, x + half), (0, 0.05), (z - 0.025, z + 0.025))
        fork = shop.block("other", (x - half / 2, x + half / 2), (0.048, 0.07), (z - 0.012, z + 0.012))
        wheels.append(group("caster", wheel, fork))
    return shop.both(front.build(shop), back.build(shop), *wheels)


def shelf_legs(shop: Workshop, frame) -> list[Piece]:
    """Four legs with one or two shelves between them."""
    front, back = corner_legs(shop, frame)
    x, z = front.foot[0] + front.thick / 2 * shop.pick(0, 0.9), front.foot[2] + front.thick / 2 * 0.5
    height = frame.under * shop.between(0.15, 0.4)
    shelf = shop.block("shelf", (-x, x), (height, height + 0.025), (-z, z))
    pieces = shop.both(front.build(shop), back.build(shop))
    count = 2 if frame.under > 0.5 and shop.chance(0.3) else 1
    pieces += shop.row(shelf, (0, (frame.under - height) / 2, 0), count)
    if shop.chance(0.15):
        pieces.append(shop.block("back_panel", (-x, x), (height, frame.under), (-z, -z + 0.02)))
    return pieces


def trestle(shop: Workshop, frame) -> list[Piece]:
    """At each end a column, or two, on a foot and under a beam; one stretcher between them."""
    x, deep = frame.base[0] * shop.between(0.65, 0.95), frame.base[1] * shop.between(0.75, 1.0)
    thick, high = shop.between(0.04, 0.08), shop.between(0.04, 0.07)
    sides = (x - thick / 2, x + thick / 2)
    end = [shop.block("foot", sides, (0, high), (-deep, deep))]
    beam = high if shop.chance(0.6) else 0.0
    if beam:
        y = (frame.under - beam, frame.under)
        end.append(shop.block("bar_stretcher", sides, y, (-deep * 0.9, deep * 0.9)))
    column_z, half = shop.pick(0.0, deep * 0.45), thick / 2 + 0.02
    column = shop.block("leg", sides, (high, frame.under - beam), (column_z - half, column_z + half))
    end += [column] if not column_z else [column, shop.copy(column, (0, 0, -2 * column_z))]
    pieces = shop.both(group("leg", *end)) if shop.chance(0.5) else shop.both(*end)
    y = frame.under * shop.between(0.2, 0.75)
    inner = x - thick / 2
    if column_z:  # the stretcher needs something to end in
        rail = shop.block("bar_stretcher", sides, (y, y + 0.05), (-column_z, column_z))
        pieces += shop.both(rail)
    return pieces + [shop.block("bar_stretcher", (-inner, inner), (y - 0.005, y + 0.055), (-0.025, 0.025))]


def crossed(shop: Workshop, frame) -> list[Piece]:
    """At each end two legs that cross, and a bar through the crossings."""
    x, deep, thick = frame.base[0] * shop.between(0.7, 0.95), frame.base[1] * 0.9, shop.between(0.03, 0.06)
    outer = shop.beam("leg", (x, 0.01, -deep), (x, frame.under, deep), (thick, thick))
    inner = shop.beam("leg", (x - thick, 0.01, deep), (x - thick, frame.under, -deep), (thick, thick))
    bar = shop.crossbar("bar_stretcher", x - 1.4 * thick, frame.under / 2, 0.0, 0.04)
    return [*shop.both(outer, inner), bar]


def pedestal(shop: Workshop, frame) -> list[Piece]:
    """A column on a plate or on feet that point away from it, sometimes with a plate under the top."""
    reach, column = min(frame.base) * shop.between(0.65, 0.95), shop.between(0.03, 0.09) * min(1, frame.width)
    top, pieces, foot = frame.under, [], shop.between(0.025, 0.05)
    if shop.chance(0.4):
        plate = reach * shop.between(0.4, 0.8)
        pieces.append(shop.block("tabletop_connector", (-plate, plate), (top - 0.025, top), (-plate, plate)))
        top -= 0.025
    if shop.chance(0.5):
        pieces.append(shop.block("pedestal", (-reach, reach), (0, foot), (-reach, reach)))
        return pieces + [shop.block("central_support", (-column, column), (foot, top), (-column, column))]
    pieces.append(shop.block("central_support", (-column, column), (0.03, top), (-column, column)))
    return pieces + star_feet(shop, shop.pick(3, 4, 4, 5), (column * 0.8, reach), foot)


def star_feet(shop: Workshop, count: int, reach: tuple[float, float], thick: float) -> list[Piece]:
    """Feet around a column, between two distances from the middle, higher at the inner one."""
    rise, pieces = shop.pick(0.0, reach[1] * shop.between(0.1, 0.3)), []
    for direction in directions(shop, count):
        foot = spoke(shop, "foot", direction, reach, (0.04 + rise, thick / 2), thick)
        pieces += shop.both(foot) if direction[0] > 1e-9 else [foot]
    return pieces


def two_pedestals(shop: Workshop, frame) -> list[Piece]:
    """Two columns, each on a plate, perhaps joined."""
    x, reach, column = frame.base[0] * shop.between(0.55, 0.7), frame.base[1] * 0.7, shop.between(0.04, 0.08)
    wide = min(reach * shop.between(0.4, 1.0), x * 0.6)
    plate = shop.block("pedestal", (x - wide, x + wide), (0, 0.04), (-reach, reach))
    post = shop.block("central_support", (x - column, x + column), (0.04, frame.under), (-column, column))
    pieces = shop.both(plate, post)
    if shop.chance(0.5):
        y = frame.under * shop.between(0.15, 0.5)
        pieces.append(shop.block("bar_stretcher", (column - x, x - column), (y, y + 0.05), (-0.02, 0.02)))
    return pieces


def panels(shop: Workshop, frame) -> list[Piece]:
    """Solid sides, with or without a back, a shelf and a divider."""
    (x, z), thick = frame.base, shop.between(0.022, 0.05)
    pieces = shop.both(shop.block("vertical_side_panel", (x - thick, x), (0, frame.under), (-z, z)))
    inner, shelved = x - thick, shop.chance(0.4)
    if shop.chance(0.6):
        low = frame.under * shop.pick(0.0, shop.between(0.2, 0.6))
        place = -z if shelved else shop.pick(-z, -0.01)
        pieces.append(shop.block("back_panel", (-inner, inner), (low, frame.under), (place, place + 0.022)))
    if shelved:
        y, deep = frame.under * shop.between(0.1, 0.5), (0.022 - z, z * shop.between(0.5, 1))
        pieces.append(shop.block("shelf", (-inner, inner), (y, y + 0.022), deep))
        if shop.chance(0.4):
            pieces.append(
                shop.block("vertical_divider_panel", (-0.011, 0.011), (y + 0.022, frame.under), deep)
            )
    return pieces


def frames(shop: Workshop, frame) -> list[Piece]:
    """At each end a frame: two legs and a runner, perhaps a bar under the top; an assembly that is mirrored."""
    (x, z), thick = frame.base, shop.between(0.025, 0.06)
    sides, shift = (x - thick, x), shop.pick(0.0, shop.between(0.0, 0.2)) * x
    sides = (sides[0] - shift, sides[1] - shift)
    upper = thick if shop.chance(0.5) else 0.0
    front = shop.block("leg", sides, (thick, frame.under - upper), (z - thick, z))
    end = [front, shop.copy(front, (0, 0, thick - 2 * z)), shop.block("runner", sides, (0, thick), (-z, z))]
    if upper:
        end.append(shop.block("bar_stretcher", sides, (frame.under - upper, frame.under), (-z, z)))
    pieces = shop.both(group("leg", *end)) if shop.chance(0.5) else shop.both(*end)
    if shop.chance(0.4):
        pieces.append(shop.block("bar_stretcher", (-sides[0], sides[0]), (0, thick), (-z, thick - z)))
    return pieces


def cube(shop: Workshop, frame) -> list[Piece]:
    """A solid block, or a box that is open at the front."""
    x, z = frame.base
    if shop.chance(0.3):
        return [shop.block("pedestal", (0.05 - x, x - 0.05), (0, frame.under), (0.05 - z, z - 0.05))]
    pieces = shop.both(shop.block("vertical_side_panel", (x - 0.03, x), (0, frame.under), (-z, z)))
    pieces.append(shop.block("bottom_panel", (0.03 - x, x - 0.03), (0.0, 0.03), (-z, z)))
    if shop.chance(0.5):
        pieces.append(shop.block("vertical_divider_panel", (-0.015, 0.015), (0.03, frame.under), (-z, z)))
    return pieces


def tripod(shop: Workshop, frame) -> list[Piece]:
    """Three splayed legs."""
    thick, reach, splay = shop.between(0.025, 0.045), min(frame.base) * 0.6, shop.between(0.02, 0.1)
    back = Leg((0, 0, -reach - splay), (0, frame.under, -reach), thick)
    x, z = 0.87 * reach, 0.5 * reach
    front = Leg((x + 0.87 * splay, 0, z + 0.5 * splay), (x, frame.under, z), thick)
    return [back.build(shop), *shop.both(front.build(shop))]


def c_frame(shop: Workshop, frame) -> list[Piece]:
    """A table that reaches over a sofa: the top is carried from one side only."""
    (x, z), thick = frame.base, shop.between(0.025, 0.04)
    post = shop.block("leg", (-x, thick - x), (thick, frame.under), (z - thick, z))
    runner = shop.block("runner", (-x, x), (0, thick), (z - thick, z))
    back = (0, 0, thick - 2 * z)
    bar = shop.block("bar_stretcher", (-x, thick - x), (0, thick), (thick - z, z - thick))
    return [post, shop.copy(post, back), runner, shop.copy(runner, back), bar]


CENTRAL = (pedestal, two_pedestals, tripod)  # what touches the top in the middle only
