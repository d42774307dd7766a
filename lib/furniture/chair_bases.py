"""Bases of chairs. Each function makes the children of a chair_base, from the floor to `frame.under`."""

import numpy as np

from .kit import Piece, Workshop, group


class Leg:
    """A leg of the right side: thickness, and where it stands and ends. `at(share)` is a point of its middle line."""

    def __init__(self, foot: tuple, top: tuple, thick: float):
        self.foot, self.top, self.thick = np.array(foot), np.array(top), thick

    def at(self, share: float) -> np.ndarray:
        return self.foot + share * (self.top - self.foot)

    def build(self, shop: Workshop, label: str = "leg") -> Piece:
        return shop.beam(label, self.foot, self.top, (self.thick, self.thick))


def four_legs(shop: Workshop, frame, splay: float) -> tuple[Leg, Leg]:
    """The right front leg and the right back leg, feet `splay` metres out; also for other furniture."""
    thick = shop.between(0.025, 0.05)
    inset = thick / 2 + (shop.between(0.02, 0.06) if splay else shop.between(0.0, 0.02))
    x, z, top = frame.width / 2 - inset, frame.depth / 2 - inset, frame.under
    back_splay = splay * shop.weighted({1.0: 3, 1.5: 1, 0.0: 1})
    side_splay = splay * shop.weighted({1.0: 3, 0.0: 1})
    front = Leg((x + side_splay, 0, z + splay), (x, top, z), thick)
    return front, Leg((x + side_splay, 0, -z - back_splay), (x, top, -z), thick)


def legs(shop: Workshop, frame) -> list[Piece]:
    """Four legs, straight or splayed, with or without stretchers."""
    splay = shop.weighted({0.0: 2, shop.between(0.03, 0.11): 3}) * min(1, frame.under / 0.4)
    front, back = four_legs(shop, frame, splay)
    pieces = shop.both(front.build(shop), back.build(shop))
    style = shop.weighted({"none": 5, "sides": 1, "H": 2, "box": 2, "front and back": 1, "X": 0.8})
    return pieces + stretchers(shop, style, front, back)


def stretchers(shop: Workshop, style: str, front: Leg, back: Leg) -> list[Piece]:
    """Bars between four legs; `style` is "none", "sides", "H", "box", "front and back" or "X"."""
    label = "bar_stretcher"
    low, high, thin = shop.between(0.2, 0.4), shop.between(0.45, 0.65), min(front.thick, back.thick) * 0.6
    share = low if style in ("X", "H") else high
    pieces = []
    if style in ("sides", "H", "box"):
        pieces += shop.both(shop.beam(label, back.at(share), front.at(share), (thin, thin), along=2))
    if style == "H":
        x, y, z = (back.at(share) + front.at(share)) / 2
        pieces.append(shop.crossbar(label, x, y, z, thin))
    if style in ("box", "front and back"):
        pieces += [shop.crossbar(label, *leg.at(low), thin) for leg in (front, back)]
    if style == "X":
        end, start = front.at(share), back.at(share) * (-1, 1, 1)
        along = 0 if end[0] - start[0] > end[2] - start[2] else 2
        pieces += shop.both(shop.beam(label, start, end, (thin, thin), along))
    return pieces


def runners(shop: Workshop, frame) -> list[Piece]:
    """Sled: on each side two legs on a runner along the floor."""
    splay, thick = shop.pick(0.0, shop.between(0.02, 0.06)), shop.between(0.02, 0.04)
    x, z = frame.width / 2 - thick / 2, frame.depth / 2 - thick
    front = Leg((x, thick / 2, z + splay), (x, frame.under, z), thick)
    back = Leg((x, thick / 2, -z - splay), (x, frame.under, -z), thick)
    reach = z + splay + thick / 2
    runner = shop.block("runner", (x - thick / 2, x + thick / 2), (0, thick), (-reach, reach))
    pieces = shop.both(front.build(shop), back.build(shop), runner)
    bar = shop.crossbar("bar_stretcher", x - thick / 2, thick / 2, thick / 2 - reach, thick)
    return pieces + shop.row(bar, (0, 0, 2 * reach - thick), shop.pick(0, 0, 1, 2))


def cantilever(shop: Workshop, frame) -> list[Piece]:
    """Front legs only, and runners back along the floor to a bar that joins them."""
    thick = shop.between(0.022, 0.04)
    x, z = frame.width / 2 - thick / 2, frame.depth / 2 - thick
    lean = shop.pick(0.0, shop.between(0.02, 0.08))
    leg = Leg((x, thick / 2, z + lean), (x, frame.under, z), thick)
    sides = (x - thick / 2, x + thick / 2)
    runner = shop.block("runner", sides, (0, thick), (-z - thick, z + lean + thick / 2))
    bar = shop.crossbar("bar_stretcher", x - thick / 2, thick / 2, -z - thick / 2, thick)
    rail = shop.block("seat_support", sides, (frame.under - thick, frame.under), (-z, z - thick / 2))
    rails = shop.both(rail) if shop.chance(0.5) else []
    return shop.both(leg.build(shop), runner) + [bar] + rails


def crossed(shop: Workshop, frame) -> list[Piece]:
    """Folding chair: on each side two legs that cross."""
    thick, reach = shop.between(0.022, 0.035), frame.depth / 2 * shop.between(0.8, 1.0)
    x, top = frame.width / 2 - thick / 2, frame.under
    outer = shop.beam("leg", (x, 0, -reach), (x, top, reach), (thick, thick))
    inner = shop.beam("leg", (x - thick, 0, reach), (x - thick, top, -reach), (thick, thick))
    bar = shop.crossbar("bar_stretcher", x - 1.5 * thick, 0.15 * top, 0.7 * reach, thick)
    return shop.both(outer, inner) + ([bar] if shop.chance(0.7) else [])


def panels(shop: Workshop, frame) -> list[Piece]:
    """Solid sides that stand on the floor."""
    thick, half = shop.between(0.02, 0.05), frame.width / 2
    pieces = shop.both(shop.block("leg", (half - thick, half), (0, frame.under), (frame.rear, -frame.rear)))
    if shop.chance(0.5):
        high = (frame.under * shop.between(0.3, 0.7), frame.under)
        z = (frame.rear, frame.rear + 0.025)
        pieces.append(shop.block("bar_stretcher", (thick - half, half - thick), high, z))
    return pieces


def h_legs(shop: Workshop, frame) -> list[Piece]:
    """On each side an assembly of its own: two legs, a stretcher and perhaps a rail on top."""
    splay = shop.pick(0.0, shop.between(0.03, 0.08))
    front, back = four_legs(shop, frame, splay)
    front.foot[0] = back.foot[0] = front.top[0]  # the whole side stands upright
    thin, y = front.thick * 0.7, shop.between(0.25, 0.5)
    side = [front.build(shop), back.build(shop)]
    side.append(shop.beam("bar_stretcher", back.at(y), front.at(y), (thin, thin), along=2))
    if shop.chance(0.4):
        side.append(shop.beam("bar_stretcher", back.at(0.95), front.at(0.95), (thin, thin), along=2))
    sides = shop.both(group("leg", *side))
    middle = shop.crossbar("bar_stretcher", *(front.at(y) + back.at(y)) / 2, thin)
    return sides + ([middle] if shop.chance(0.6) else [])


def pedestal(shop: Workshop, frame) -> list[Piece]:
    """A column on a plate, like a tulip."""
    radius, plate = min(frame.width, frame.depth) / 2 * shop.between(0.7, 0.95), shop.between(0.02, 0.04)
    column = shop.between(0.022, 0.05)
    pieces = [
        shop.block("pedestal", (-radius, radius), (0, plate), (-radius, radius)),
        shop.block("central_support", (-column, column), (plate, frame.under), (-column, column)),
    ]
    return pieces + _footrest(shop, frame, column)


def _footrest(shop: Workshop, frame, column: float) -> list[Piece]:
    """For the feet on a tall column: a bar to the front and one across it."""
    if frame.under < 0.5 or shop.chance(0.3):
        return []
    y, reach, thin = frame.under * shop.between(0.35, 0.5), frame.depth * shop.between(0.35, 0.45), 0.012
    stem = shop.block("bar_stretcher", (-thin, thin), (y - thin, y + thin), (column - 0.005, reach))
    bar = shop.block("bar_stretcher", (-reach, reach), (y - thin, y + thin), (reach, reach + 2 * thin))
    return [stem, bar]


def star(shop: Workshop, frame) -> list[Piece]:
    """A column on three to six legs, often on casters, often with a mechanism under the seat."""
    count, casters = (
        shop.weighted({3: 0.5, 4: 3, 5: 4, 6: 0.5}),
        shop.chance(0.6 if frame.under < 0.5 else 0.25),
    )
    column, top, pieces = shop.between(0.022, 0.04), frame.under, []
    if shop.chance(0.3) and top > 0.2:
        top -= 0.04
        plate = shop.block("seat_support", (-0.09, 0.09), (top, frame.under), (-0.1, 0.1))
        lever = shop.block("lever", (0.09, 0.2), (top + 0.01, top + 0.03), (0, 0.02))
        pieces.append(group("mechanical_control", plate, lever))
    pieces.append(shop.block("central_support", (-column, column), (0.06 * casters, top), (-column, column)))
    radius, thick = max(frame.width, 0.42) * shop.between(0.48, 0.6), shop.between(0.025, 0.045)
    height, rise = 0.06 * casters + thick / 2, shop.pick(0.0, shop.between(0.02, 0.06))
    for direction in directions(shop, count):
        arm = [spoke(shop, "leg", direction, (0.8 * column, radius), (height + rise, height), thick)]
        if casters:
            arm.append(_caster(shop, direction * (radius - 0.02)))
        pieces += shop.both(*arm) if direction[0] > 1e-9 else arm
    return pieces + _footrest(shop, frame, column)


def directions(shop: Workshop, count: int) -> list[np.ndarray]:
    """Of `count` evenly spread horizontal directions, those that point to the right or along the middle plane."""
    turn = np.pi / 4 if count == 4 and shop.chance(0.6) else 0.0
    angles = turn + np.arange(count) * 2 * np.pi / count
    spread = np.stack([np.sin(angles), np.zeros(count), -np.cos(angles)], axis=1)
    return [direction for direction in spread if direction[0] > -1e-9]


def spoke(
    shop: Workshop, label: str, direction: np.ndarray, reach: tuple, heights: tuple, thick: float
) -> Piece:
    """A bar that points away from the middle; `reach` and `heights` are those of its inner and its outer end."""
    hub, tip = (direction * out + (0, y, 0) for out, y in zip(reach, heights))
    along = 0 if abs(direction[0]) > abs(direction[2]) + 1e-9 else 2
    start, end = (hub, tip) if direction[along] > 0 else (tip, hub)
    return shop.beam(label, start, end, (thick, thick), along)


def _caster(shop: Workshop, place: np.ndarray) -> Piece:
    x, _, z = place
    stem = shop.block("caster_stem", (x - 0.008, x + 0.008), (0.04, 0.065), (z - 0.008, z + 0.008))
    wheel = shop.block("wheel", (x - 0.016, x + 0.016), (0, 0.042), (z - 0.022, z + 0.022))
    return group("caster", stem, wheel)


def tripod(shop: Workshop, frame) -> list[Piece]:
    """Three splayed legs."""
    thick, splay, reach = shop.between(0.025, 0.04), shop.between(0.02, 0.09), frame.depth / 2 * 0.75
    back = Leg((0, 0, -reach - splay), (0, frame.under, -reach), thick)
    x, z = reach * 0.87, reach * 0.5
    front = Leg((x + splay * 0.87, 0, z + splay * 0.5), (x, frame.under, z), thick)
    pieces = [back.build(shop), *shop.both(front.build(shop))]
    if shop.chance(0.5):
        pieces.append(shop.crossbar("bar_stretcher", *front.at(shop.between(0.3, 0.5)), 0.6 * thick))
    return pieces


def rockers(shop: Workshop, frame) -> list[Piece]:
    """Four legs on two rockers."""
    front, back = four_legs(shop, frame, 0.0)
    thick, reach = front.thick, frame.depth / 2 + shop.between(0.1, 0.2)
    x, high = front.foot[0], shop.between(0.04, 0.07)
    front.foot[1] = back.foot[1] = high
    rocker = shop.block("rocker", (x - thick / 2, x + thick / 2), (0, high), (-reach, reach - 0.06))
    pieces = shop.both(front.build(shop), back.build(shop), rocker)
    return pieces + stretchers(shop, shop.pick("none", "sides", "front and back", "box"), front, back)


def feet(shop: Workshop, frame) -> list[Piece]:
    """Short feet, straight or splayed; a long sofa stands on its middle, too."""
    thick = shop.between(0.03, 0.07)
    inset = shop.between(0, 0.05)
    splay = shop.pick(0, shop.between(0.01, 0.04))
    x, z = frame.width / 2 - inset - thick / 2, frame.depth / 2 - inset - thick / 2
    label = shop.pick("foot", "leg")
    front = Leg((x + splay, 0, z + splay), (x, frame.under, z), thick)
    back = Leg((x + splay, 0, -z - splay), (x, frame.under, -z), thick)
    pieces = shop.both(front.build(shop, label), back.build(shop, label))
    if frame.width > 1.6:
        for side in (1, -1):
            pieces.append(
                Leg((0, 0, side * (z + splay)), (0, frame.under, side * z), thick).build(shop, label)
            )
    return pieces


def plinth(shop: Workshop, frame) -> list[Piece]:
    """A box on the floor, or two."""
    inset, half = shop.between(0.0, 0.06), frame.width / 2
    z = (frame.rear + inset, -frame.rear - inset)
    if shop.chance(0.6):
        return [shop.block("pedestal", (inset - half, half - inset), (0, frame.under), z)]
    return shop.both(shop.block("foot", (half - inset - 0.1, half - inset), (0, frame.under), z))


def low_runners(shop: Workshop, frame) -> list[Piece]:
    """On each side a runner carried by two short legs."""
    thick, half, inset = shop.between(0.025, 0.04), frame.width / 2, shop.between(0.0, 0.08)
    x, z = half - inset - thick / 2, frame.depth / 2 - 0.05
    runner = shop.block("runner", (x - thick / 2, x + thick / 2), (0, thick), (-z - 0.03, z + 0.03))
    front = shop.block("leg", (x - thick / 2, x + thick / 2), (thick, frame.under), (z - thick, z))
    back = shop.copy(front, (0, 0, -2 * z + thick))
    return shop.both(runner, front, back)


CENTRAL = (pedestal, star, tripod)  # what carries the seat in its middle only
