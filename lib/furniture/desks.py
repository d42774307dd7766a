"""Bases of tables with drawers and doors, from the floor to `frame.under`, and the drawers themselves."""

import numpy as np

from .kit import Piece, Workshop, group
from .table_bases import corner_legs


def drawer(shop: Workshop, label: str, x: tuple, y: tuple, z: tuple) -> Piece:
    """A drawer or a door: a body, and a knob or a handle that stands out a little at its front."""
    middle_x, middle_y, front = sum(x) / 2, sum(y) / 2, max(z)
    wide, high = shop.pick((0.012, 0.012), (min(0.06, abs(x[1] - x[0]) * 0.3), 0.008))
    if label == "cabinet_door":  # the handle is far from the hinge, which is at the outer side
        middle_x -= np.sign(middle_x + 1e-9) * (abs(x[1] - x[0]) / 2 - 0.035)
        wide, high = high, wide
    body = shop.block("other", x, y, (min(z), front))
    across, upright = (middle_x - wide, middle_x + wide), (middle_y - high, middle_y + high)
    handle = shop.block("other", across, upright, (front, front + 0.022))
    return group(label, body, handle)


def _tower(shop: Workshop, frame, outer: float, inner: float) -> list[Piece]:
    """A box at the right side with drawers in it, or with a door; x from `inner` to `outer`."""
    z, thick, low = frame.base[1], 0.022, shop.pick(0.0, shop.between(0.04, 0.12))
    pieces = [
        shop.block("vertical_side_panel", (outer - thick, outer), (0, frame.under), (-z, z)),
        shop.block("vertical_side_panel", (inner, inner + thick), (0, frame.under), (-z, z)),
        shop.block("bottom_panel", (inner + thick, outer - thick), (low, low + thick), (-z, z)),
    ]
    x = (inner + thick + 0.003, outer - thick - 0.003)
    bottom = low + thick
    if shop.chance(0.25):
        y = (bottom + 0.003, frame.under - 0.003)
        return pieces + [drawer(shop, "cabinet_door", x, y, (z - 0.02, z))]
    count = shop.pick(2, 3, 4)
    pitch = (frame.under - bottom) / count
    first = drawer(shop, "drawer", x, (bottom + 0.003, bottom + pitch - 0.003), (-z * 0.9, z))
    return pieces + shop.row(first, (0, pitch, 0), count)


def drawer_towers(shop: Workshop, frame) -> list[Piece]:
    """A box with drawers at either side, mirrored as a whole, and often a panel behind the legs."""
    x, z = frame.base
    inner = x - shop.between(0.3, 0.42)
    pieces = shop.both(*_tower(shop, frame, x, inner))
    if shop.chance(0.6):
        pieces.append(_modesty_panel(shop, frame, -inner, inner, -z))
    if shop.chance(0.3):
        y = (frame.under - shop.between(0.08, 0.12), frame.under)
        pieces.append(drawer(shop, "drawer", (0.003 - inner, inner - 0.003), y, (-z * 0.6, z)))
    return pieces


def _modesty_panel(shop: Workshop, frame, left: float, right: float, z: float) -> Piece:
    low = frame.under * shop.pick(0.0, shop.between(0.3, 0.6))
    return shop.block("back_panel", (left, right), (low, frame.under), (z, z + 0.02))


def one_tower(shop: Workshop, frame) -> list[Piece]:
    """A box with drawers at one side; legs or a panel at the other."""
    x, z = frame.base
    inner = x - shop.between(0.32, 0.48)
    pieces = _tower(shop, frame, x, inner)
    side = shop.pick(-1.0, 1.0)  # where the box is not
    if side > 0:
        pieces = [shop.copy(piece, mirrored=True) for piece in pieces]
    if shop.chance(0.5):
        sides = (side * x, side * (x - 0.025))
        pieces.append(shop.block("vertical_side_panel", sides, (0, frame.under), (-z, z)))
        if shop.chance(0.6):
            pieces.append(_modesty_panel(shop, frame, *sorted((side * (x - 0.025), -side * inner)), -z))
        return pieces
    thick = shop.between(0.03, 0.05)
    leg = shop.block("leg", (side * x, side * (x - thick)), (0, frame.under), (z - thick, z))
    return pieces + [leg, shop.copy(leg, (0, 0, thick - 2 * z))]


def drawer_box(shop: Workshop, frame) -> list[Piece]:
    """Four legs under a box with one to three drawers side by side."""
    high, thick = shop.between(0.09, 0.16), 0.02
    front, back = corner_legs(shop, frame)
    bottom = frame.under - high
    if shop.chance(0.7):  # legs run up to the top, outside the box
        x, z = front.top[0] - front.thick / 2, front.top[2] + front.thick / 2
    else:
        x, z = front.top[0] + front.thick / 2, front.top[2] + front.thick / 2
        front.top[1] = back.top[1] = bottom
    pieces = shop.both(front.build(shop), back.build(shop))
    pieces += shop.both(shop.block("vertical_side_panel", (x - thick, x), (bottom, frame.under), (-z, z)))
    pieces.append(shop.block("back_panel", (thick - x, x - thick), (bottom, frame.under), (-z, thick - z)))
    count, inner = (1 if frame.width < 0.7 else shop.pick(1, 2, 3)), x - thick
    pitch = 2 * inner / count
    slot = (-inner + 0.003, -inner + pitch - 0.003)
    first = drawer(shop, "drawer", slot, (bottom + 0.003, frame.under - 0.002), (thick - z + 0.004, z))
    pieces += shop.row(first, (pitch, 0, 0), count)
    if shop.chance(0.3):
        y = bottom * shop.between(0.15, 0.4)
        pieces.append(shop.block("shelf", (-x, x), (y, y + 0.022), (-z, z)))
    return pieces


def keyboard_desk(shop: Workshop, frame) -> list[Piece]:
    """Solid sides, a panel behind the legs and a tray under the top."""
    (x, z), thick = frame.base, 0.025
    pieces = shop.both(shop.block("vertical_side_panel", (x - thick, x), (0, frame.under), (-z, z)))
    pieces.append(_modesty_panel(shop, frame, thick - x, x - thick, -z))
    low = frame.under - shop.between(0.1, 0.14)
    half = x - thick - 0.003
    tray = shop.block("other", (-half, half), (low, low + 0.02), (-z * 0.2, z * 0.95))
    slide = shop.block("other", (half - 0.02, half), (low + 0.02, low + 0.04), (-z * 0.2, z * 0.9))
    pieces.append(group("keyboard_tray", tray, *shop.both(slide)))
    if shop.chance(0.5):
        pieces.append(shop.block("shelf", (thick - x, x - thick), (0.08, 0.1), (-z, 0)))
    return pieces
