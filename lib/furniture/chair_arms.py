"""Arms of chairs. They are made for the right side, as an assembly of their own, and mirrored as a whole."""

import numpy as np

from .kit import Piece, Workshop, group


def wooden(shop: Workshop, frame) -> list[Piece]:
    """A pair of arms beside the seat, of bars or as a frame; or one writing tablet."""
    if shop.chance(0.06):
        return [group("chair_arm", *writing_tablet(shop, frame))]
    style = shop.weighted(STYLES)
    return shop.both(group("chair_arm", *style(shop, frame, shop.between(0.16, 0.24))))


def _reach(frame, rise: float) -> tuple[float, float]:
    """From where the leaning back is at a height above the seat, to near the front of the seat (z)."""
    return frame.rear - rise * np.tan(frame.lean) if frame.back > rise else frame.rear, -frame.rear


def _arm_bar(shop: Workshop, frame, rise: float, wide: float, forward: float) -> Piece:
    back, front = _reach(frame, rise)
    x = frame.width / 2 - 0.002
    y = frame.height + rise
    return shop.block("arm_horizontal_bar", (x, x + wide), (y - 0.025, y), (back, front * forward))


def _arm_post(shop: Workshop, frame, rise: float, z: float, wide: float, thick: float) -> Piece:
    """An upright beside the seat, from its underside to the arm's bar."""
    x = frame.width / 2 - 0.002
    y = (frame.under, frame.height + rise - 0.025)
    return shop.block("arm_near_vertical_bar", (x, x + wide), y, (z - thick / 2, z + thick / 2))


def post_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A bar from the back to a post near the front."""
    wide, forward = shop.between(0.03, 0.06), shop.between(0.55, 1.0)
    z = -frame.rear * forward - 0.03
    return [_arm_bar(shop, frame, rise, wide, forward), _arm_post(shop, frame, rise, z, wide * 0.8, 0.03)]


def two_post_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A bar on two posts."""
    wide, forward = shop.between(0.03, 0.06), shop.between(0.7, 1.0)
    front = _arm_post(shop, frame, rise, -frame.rear * forward - 0.03, wide * 0.8, 0.03)
    rear = shop.copy(front, (0, 0, frame.rear * (forward + shop.between(0.5, 0.8)) + 0.03))
    return [_arm_bar(shop, frame, rise, wide, forward), front, rear]


def tee_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A pad on a single post, clear of the back."""
    wide, half = shop.between(0.05, 0.08), frame.depth * shop.between(0.25, 0.35)
    x, y = frame.width / 2 - 0.002, frame.height + rise
    pad = shop.block("arm_horizontal_bar", (x - 0.01, x - 0.01 + wide), (y - 0.03, y), (-half, half))
    z, thick = shop.between(-0.04, 0.03), shop.between(0.03, 0.07)
    return [pad, _arm_post(shop, frame, rise - 0.005, z, 0.028, thick)]


def slanted_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A bar from the back, held by a slanted post."""
    wide, forward = shop.between(0.03, 0.055), shop.between(0.75, 1.0)
    x, z = frame.width / 2 - 0.002 + wide / 2, -frame.rear * forward - 0.03
    foot = (x, frame.under + 0.005, z - shop.between(0.06, 0.14))
    post = shop.beam("arm_near_vertical_bar", foot, (x, frame.height + rise - 0.02, z), (wide * 0.8, 0.028))
    return [_arm_bar(shop, frame, rise, wide, forward), post]


def loop_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A closed loop: two uprights, a bar above and one beside the seat."""
    bar, front, rear = two_post_arm(shop, frame, rise)
    x, (_, _, start), (_, _, end) = frame.width / 2 - 0.002, rear.center, front.center
    y, z = (frame.under, frame.under + 0.025), (start + 0.015, end - 0.015)
    low = shop.block("arm_connector", (x, x + 0.025), y, z)
    return [group("arm_holistic_frame", bar, front, rear, low)]


def panel_arm(shop: Workshop, frame, rise: float) -> list[Piece]:
    """A bar on a closed panel."""
    x, wide, forward = frame.width / 2 - 0.002, shop.between(0.03, 0.05), shop.between(0.7, 1.0)
    y, z = (frame.under, frame.height + rise - 0.025), (frame.rear, -frame.rear * forward)
    panel = shop.block("arm_near_vertical_bar", (x, x + 0.022), y, z)
    return [_arm_bar(shop, frame, rise, wide, forward), panel]


STYLES = {post_arm: 4, two_post_arm: 2, tee_arm: 2, slanted_arm: 2, loop_arm: 1, panel_arm: 1}


def writing_tablet(shop: Workshop, frame) -> list[Piece]:
    """A board to write on, at the right hand only."""
    x, y, front = frame.width / 2 - 0.002, frame.height + 0.22, -frame.rear
    board = shop.block("arm_writing_table", (-0.02, x + 0.06), (y, y + 0.02), (front - 0.12, front + 0.14))
    back, _ = _reach(frame, 0.2)
    bar = shop.block("arm_horizontal_bar", (x, x + 0.04), (y - 0.025, y), (back, front))
    return [board, bar, _arm_post(shop, frame, 0.22, front - 0.05, 0.03, 0.03)]


def upholstered(shop: Workshop, frame) -> list[Piece]:
    """Upholstered blocks at both sides, plain or with a pad on top."""
    wide, rise = shop.between(0.08, 0.2), shop.between(0.1, min(0.28, max(0.12, frame.back - 0.05)))
    x, top, bottom = frame.width / 2, frame.height + rise, frame.under * shop.pick(1.0, 1.0, 0.6)
    z = (frame.rear, -frame.rear - shop.pick(0.0, shop.between(0.0, 0.06)))
    pad = shop.pick(0.0, shop.between(0.03, 0.06))
    pieces = [shop.block("arm_sofa_style", (x, x + wide), (bottom, top - pad), z)]
    if pad:
        pieces.append(shop.block("arm_horizontal_bar", (x - 0.012, x + wide + 0.01), (top - pad, top), z))
    return shop.both(group("chair_arm", *pieces))
