"""Backs and heads of chairs. A back is made upright behind or on the seat, then leans as a whole."""

from .kit import Piece, Workshop, group, tilt


def leaning(frame, piece: Piece) -> Piece:
    """A back, or what is mounted on it, tilted about the rear edge of the seat."""
    return tilt(piece, frame.lean, (frame.height, frame.rear)) if frame.lean else piece


def slab(shop: Workshop, frame) -> list[Piece]:
    """One upholstered board that stands on the seat or behind it."""
    thick = shop.between(0.03, 0.06) + 0.25 * max(0, frame.thick - 0.1)
    half = frame.width / 2 * shop.between(0.88, 1.0)
    behind = shop.chance(0.5)
    bottom = frame.height - frame.thick * shop.between(0.3, 1.0) if behind else frame.height
    z = (frame.rear - thick, frame.rear) if behind else (frame.rear, frame.rear + thick)
    board = shop.block("back_single_surface", (-half, half), (bottom, frame.height + frame.back), z)
    return [group("back_surface", board)]


def winged(shop: Workshop, frame) -> list[Piece]:
    """A middle board between two wings that stand forward."""
    thick, half, deep = shop.between(0.04, 0.08), frame.width / 2, shop.between(0.1, 0.2)
    y, wing = (frame.height, frame.height + frame.back), shop.between(0.04, 0.07)
    middle = shop.block(
        "back_single_surface", (wing - half, half - wing), y, (frame.rear, frame.rear + thick)
    )
    low = frame.height + frame.back * shop.pick(0.0, shop.between(0.3, 0.5))
    side = shop.block(
        "back_single_surface", (half - wing, half), (low, y[1] * 0.99), (frame.rear, frame.rear + deep)
    )
    return [group("back_surface", middle, *shop.both(side))]


def cushions(people: int):
    """Back cushions side by side, with a board behind them."""

    def make(shop: Workshop, frame) -> list[Piece]:
        thick, board, pitch = shop.between(0.12, 0.18), shop.between(0.04, 0.08), frame.width / people
        top, half = frame.height + frame.back, frame.width / 2
        first = shop.block(
            *("back_single_surface", (-half, pitch - half), (frame.height, top - shop.between(0.0, 0.08))),
            (frame.rear, frame.rear + thick),
        )
        row = shop.row(first, (pitch, 0, 0), people)
        y = (frame.under, top - shop.between(0.0, 0.05))
        support = shop.block("back_support", (-half, half), y, (frame.rear - board, frame.rear))
        return [group("back_surface", *row), support]

    return make


def posts(shop: Workshop, frame) -> tuple[list[Piece], float, float]:
    """Two posts at the rear corners of the seat; also the z of their middle and the free width between them."""
    thick, half = shop.between(0.025, 0.042), frame.width / 2
    behind = shop.chance(0.4)
    bottom = frame.under if behind else frame.height
    z = (frame.rear - thick, frame.rear) if behind else (frame.rear, frame.rear + thick)
    post = shop.block("back_frame_vertical_bar", (half - thick, half), (bottom, frame.height + frame.back), z)
    return shop.both(post), post.center[2], 2 * (half - thick)


def _rail(shop: Workshop, label: str, gap: float, z: float, y: tuple, thick: float = 0.02) -> Piece:
    return shop.block(label, (-gap / 2, gap / 2), y, (z - thick / 2, z + thick / 2))


def ladder(shop: Workshop, frame) -> list[Piece]:
    """Two posts with slats from side to side between them."""
    sides, z, gap = posts(shop, frame)
    count, low = shop.pick(2, 3, 4, 5), frame.height + frame.back * shop.between(0.1, 0.35)
    pitch = (frame.height + frame.back - low) / count
    high = pitch * shop.between(0.45, 0.75)
    top = frame.height + frame.back
    first = _rail(shop, "back_surface_horizontal_bar", gap, z, (top - high, top))
    slats = shop.row(first, (0, -pitch, 0), count)
    return [group("back_surface", *slats), group("back_frame", *sides)]


def spindles(shop: Workshop, frame) -> list[Piece]:
    """Upright bars under a top rail, between posts or without them, down to the seat or to a lower rail."""
    if shop.chance(0.6):
        sides, z, gap = posts(shop, frame)
    else:
        sides, z, gap = [], frame.rear + 0.02, frame.width * shop.between(0.85, 1.0)
        frame.back = min(frame.back, 0.45)
    high, top, bottom = shop.between(0.04, 0.09), frame.height + frame.back, frame.height
    rails = [_rail(shop, "back_frame_horizontal_bar", gap, z, (top - high, top), 0.028)]
    if sides and shop.chance(0.5):
        bottom = frame.height + frame.back * shop.between(0.15, 0.3)
        rails.append(_rail(shop, "back_frame_horizontal_bar", gap, z, (bottom - 0.03, bottom), 0.025))
    count, thick = shop.pick(*range(2 if sides else 4, 8)), shop.between(0.014, 0.02)
    step = gap / (count + 1) if sides else (gap - thick) / (count - 1)
    x = -step * (count - 1) / 2
    bar = shop.beam("back_surface_vertical_bar", (x, bottom, z), (x, top - high, z), (thick, thick))
    return [group("back_surface", *shop.row(bar, (step, 0, 0), count)), group("back_frame", *sides, *rails)]


def splat(shop: Workshop, frame) -> list[Piece]:
    """One wide upright board in the middle, between posts and under a top rail."""
    sides, z, gap = posts(shop, frame)
    high, top, half = shop.between(0.04, 0.08), frame.height + frame.back, gap * shop.between(0.12, 0.25)
    rail = _rail(shop, "back_frame_horizontal_bar", gap, z, (top - high, top), 0.025)
    board = shop.block(
        "back_surface_vertical_bar", (-half, half), (frame.height, top - high), (z - 0.008, z + 0.008)
    )
    return [group("back_surface", board), group("back_frame", *sides, rail)]


def cross(shop: Workshop, frame) -> list[Piece]:
    """Two bars that cross between posts and rails."""
    sides, z, gap = posts(shop, frame)
    top, high, thick = frame.height + frame.back, shop.between(0.04, 0.06), shop.between(0.018, 0.028)
    low = frame.height + frame.back * shop.pick(0.05, 0.25)
    rails = [
        _rail(shop, "back_frame_horizontal_bar", gap, z, (top - high, top), 0.025),
        _rail(shop, "back_frame_horizontal_bar", gap, z, (low, low + 0.03), 0.025),
    ]
    start, end = (-gap / 2 + thick, low + 0.03, z), (gap / 2 - thick, top - high, z)
    bar = shop.beam("back_surface_vertical_bar", start, end, (thick, 0.016))
    return [group("back_surface", *shop.both(bar)), group("back_frame", *sides, *rails)]


def panel_on_posts(shop: Workshop, frame) -> list[Piece]:
    """A board between two posts, clear of the seat."""
    sides, z, gap = posts(shop, frame)
    top, low = frame.height + frame.back, frame.height + frame.back * shop.between(0.15, 0.5)
    thick = shop.between(0.018, 0.035)
    board = _rail(shop, "back_single_surface", gap, z, (low, top - shop.between(0, 0.03)), thick)
    return [group("back_surface", board), group("back_frame", *sides)]


def framed(shop: Workshop, frame) -> list[Piece]:
    """A board in a full frame: two posts and two rails."""
    sides, z, gap = posts(shop, frame)
    top = frame.height + frame.back
    high = shop.between(0.03, 0.05)
    low = frame.height + frame.back * shop.pick(0.0, 0.2)
    rails = [
        _rail(shop, "back_frame_horizontal_bar", gap, z, (top - high, top), 0.028),
        _rail(shop, "back_frame_horizontal_bar", gap, z, (low, low + high), 0.028),
    ]
    board = _rail(shop, "back_single_surface", gap, z, (low + high, top - high), 0.016)
    return [group("back_surface", board), group("back_frame", *sides, *rails)]


def rail(shop: Workshop, frame) -> list[Piece]:
    """A single rail on two posts."""
    frame.back = min(frame.back, 0.42)
    sides, z, gap = posts(shop, frame)
    top = frame.height + frame.back
    surface = _rail(shop, "back_single_surface", gap, z, (top - shop.between(0.05, 0.1), top), 0.025)
    return [group("back_surface", surface), group("back_frame", *sides)]


def panel_on_stem(shop: Workshop, frame) -> list[Piece]:
    """A board on one or two narrow stems that come from behind the seat."""
    thick = shop.between(0.04, 0.07)
    half = frame.width / 2 * shop.between(0.75, 1.0)
    low = shop.between(0.08, 0.16)
    top = frame.height + frame.back
    board = shop.block(
        "back_single_surface", (-half, half), (frame.height + low, top), (frame.rear, frame.rear + thick)
    )
    y = (frame.under, frame.height + low + shop.between(0.1, 0.5) * (frame.back - low))
    if shop.chance(0.6):
        wide = shop.between(0.025, 0.05)
        stems = [shop.block("back_connector", (-wide, wide), y, (frame.rear - 0.022, frame.rear))]
    else:
        x = (half * 0.45, half * 0.45 + 0.03)
        stems = shop.both(shop.block("back_connector", x, y, (frame.rear - 0.022, frame.rear)))
    return [group("back_surface", board), *stems]


PADDED = (slab, panel_on_stem, winged)  # they may carry a headrest
WOODEN = (ladder, spindles, spindles, splat, cross, framed, rail)


def head(shop: Workshop, frame, middle: float) -> list[Piece]:
    """A pad above a back whose middle plane is at z = `middle`, on it or on two short bars."""
    gap, high = shop.pick(0.0, shop.between(0.03, 0.06)), shop.between(0.09, 0.15)
    half, bottom = frame.width * shop.between(0.24, 0.34), frame.height + frame.back + gap
    pad = shop.block("headrest", (-half, half), (bottom, bottom + high), (middle - 0.025, middle + 0.035))
    if not gap:
        return [pad]
    sides, y, z = (half * 0.5, half * 0.5 + 0.018), (bottom - gap, bottom), (middle - 0.009, middle + 0.009)
    return [pad, *shop.both(shop.block("head_connector", sides, y, z))]
