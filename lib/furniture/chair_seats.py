"""Seats of chairs. Each function makes the children of a chair_seat, with its top at `frame.height`."""

from .kit import Piece, Workshop, group


def slab(shop: Workshop, frame) -> list[Piece]:
    """One thick board or cushion."""
    half = frame.width / 2
    surface = shop.block(
        "seat_single_surface", (-half, half), (frame.under, frame.height), (frame.rear, -frame.rear)
    )
    return [group("seat_surface", surface)]


def cushion_on_board(shop: Workshop, frame) -> list[Piece]:
    """A cushion on a board that may be smaller or larger."""
    half, border = frame.width / 2, shop.between(-0.03, 0.02)
    middle = frame.under + frame.thick * shop.between(0.25, 0.5)
    board_z = (frame.rear - border, -frame.rear + border)
    board = shop.block("seat_support", (-half - border, half + border), (frame.under, middle), board_z)
    cushion = shop.block(
        "seat_single_surface", (-half, half), (middle, frame.height), (frame.rear, -frame.rear)
    )
    return [group("seat_surface", cushion), board]


def cushion_on_frame(shop: Workshop, frame) -> list[Piece]:
    """A cushion lying on four rails."""
    frame.thick = max(frame.thick, 0.07)
    middle = frame.under + frame.thick * shop.between(0.4, 0.6)
    half, bar = frame.width / 2, shop.between(0.025, 0.045)
    side = shop.block("seat_frame_bar", (half - bar, half), (frame.under, middle), (frame.rear, -frame.rear))
    across = shop.block(
        "seat_frame_bar", (bar - half, half - bar), (frame.under, middle), (-frame.rear - bar, -frame.rear)
    )
    rails = shop.both(side) + shop.row(across, (0, 0, 2 * frame.rear + bar), 2)
    border = shop.between(-0.01, 0.015)
    cushion = shop.block(
        *("seat_single_surface", (-half - border, half + border), (middle, frame.height)),
        (frame.rear, -frame.rear + border),
    )
    return [group("seat_surface", cushion), group("seat_frame", *rails)]


def slats(shop: Workshop, frame) -> list[Piece]:
    """Slats from side to side or from back to front, on two rails."""
    frame.thick = max(frame.thick, 0.05)
    half, count, rail = frame.width / 2, shop.pick(3, 4, 5, 6, 7), shop.between(0.03, 0.05)
    top, middle = frame.height, frame.height - shop.between(0.018, 0.025)
    if shop.chance(0.6):  # slats from side to side
        pitch = frame.depth / (count - 0.25)
        first = shop.block(
            "seat_surface_bar", (-half, half), (middle, top), (frame.rear, frame.rear + 0.75 * pitch)
        )
        bars = shop.row(first, (0, 0, pitch), count)
        inset = shop.between(0.0, 0.04)
        side = (half - inset - rail, half - inset)
        rails = shop.both(
            shop.block("seat_frame_bar", side, (frame.under, middle), (frame.rear, -frame.rear))
        )
    else:
        pitch = frame.width / (count - 0.25)
        first = shop.block(
            "seat_surface_bar", (-half, -half + 0.75 * pitch), (middle, top), (frame.rear, -frame.rear)
        )
        bars = shop.row(first, (pitch, 0, 0), count)
        place = -frame.rear - shop.between(0.0, 0.04)
        front = shop.block("seat_frame_bar", (-half, half), (frame.under, middle), (place - rail, place))
        rails = shop.row(front, (0, 0, -2 * place + rail), 2)
    return [group("seat_surface", *bars), group("seat_frame", *rails)]


def cushions(people: int):
    """Seats of a sofa: cushions side by side, or one, on an upholstered box."""

    def make(shop: Workshop, frame) -> list[Piece]:
        count = shop.pick(1, people)
        middle, pitch = frame.height - frame.thick * shop.between(0.35, 0.6), frame.width / count
        left = (-frame.width / 2, -frame.width / 2 + pitch)
        overhang = shop.between(-0.01, 0.03)
        first = shop.block(
            "seat_single_surface", left, (middle, frame.height), (frame.rear, -frame.rear + overhang)
        )
        half = frame.width / 2
        box = shop.block("seat_support", (-half, half), (frame.under, middle), (frame.rear, -frame.rear))
        return [group("seat_surface", *shop.row(first, (pitch, 0, 0), count)), box]

    return make


FIRM = (slab, slab, cushion_on_board, cushion_on_frame, slats)
HOLLOW = (cushion_on_frame, slats)  # nothing in the middle of their undersides
