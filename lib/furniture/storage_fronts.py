"""What fills a cabinet (shelves, doors, drawers, dividers) and what it stands on.

A filling takes the workshop and a carcass and returns two lists: pieces of the frame, and pieces beside the frame.
"""

from .desks import drawer
from .kit import Piece, Workshop, group

GAP = 0.003  # around a front, metres
Filling = tuple[list[Piece], list[Piece]]


def _columns(shop: Workshop, carcass, count: int, y: tuple) -> tuple[list[Piece], list[tuple]]:
    """Upright dividers for `count` equal columns over the heights y, and the x range of each column."""
    (left, right), _, (back, front) = carcass.inside
    pitch, half = (right - left) / count, carcass.board / 2
    edges = [left + k * pitch for k in range(count + 1)]
    if count == 1:
        return [], [(left, right)]
    first = shop.block("vertical_divider_panel", (edges[1] - half, edges[1] + half), y, (back, front - 0.004))
    lows = [edge + half for edge in edges[1:-1]]
    slots = list(zip([left, *lows], [*(low - 2 * half for low in lows), right]))
    return shop.row(first, (pitch, 0, 0), count - 1), slots


def _shelf_stack(shop: Workshop, carcass, x: tuple, y: tuple, count: int) -> list[Piece]:
    """`count` shelves that divide the heights y evenly."""
    _, _, (back, front) = carcass.inside
    board = carcass.board * 0.9
    pitch = (y[1] - y[0] + board) / (count + 1)
    at = y[0] + pitch - board
    return shop.row(shop.block("shelf", x, (at, at + board), (back, front - 0.005)), (0, pitch, 0), count)


def shelves(columns: int):
    """Open shelves in columns."""

    def fill(shop: Workshop, carcass) -> Filling:
        _, y, _ = carcass.inside
        dividers, slots = _columns(shop, carcass, columns, y)
        pitch = slots[-1][0] - slots[0][0] if columns > 1 else 0
        most = min(6, int((y[1] - y[0]) / 0.2))
        if columns > 1 and shop.chance(0.3):  # every column has shelves of its own
            counts = [int(shop.between(1, min(4, most) + 0.99)) for _ in range(2)]
            stacks = [_shelf_stack(shop, carcass, x, y, count) for x, count in zip(slots, counts)]
            if columns == 3:
                stacks.append([shop.copy(piece, (pitch, 0, 0)) for piece in stacks[0]])
            return dividers, [piece for stack in stacks for piece in stack]
        count = int(shop.between(max(1, (y[1] - y[0]) / 0.5), most + 0.99))
        boards = _shelf_stack(shop, carcass, slots[0], y, count)
        step = (slots[1][0] - slots[0][0], 0, 0) if columns > 1 else (0, 0, 0)
        return dividers, [each for board in boards for each in shop.row(board, step, columns)]

    return fill


def _doors(shop: Workshop, carcass, x: tuple, y: tuple, count: int, inset: bool) -> list[Piece]:
    """Doors side by side, mirrored in pairs, in front of the carcass or inside it."""
    front = carcass.depth / 2 + (0.0 if inset else 0.02)
    pitch = (x[1] - x[0]) / count
    doors = []
    for k in range(count):
        slot = (x[0] + k * pitch + GAP, x[0] + (k + 1) * pitch - GAP)
        if sum(slot) > 1e-6 and abs(x[0] + x[1]) < 1e-6:
            continue  # the mirror image of one at the left
        door = drawer(shop, "cabinet_door", slot, (y[0] + GAP, y[1] - GAP), (front - 0.02, front))
        doors += shop.both(door) if sum(slot) < -1e-6 and abs(x[0] + x[1]) < 1e-6 else [door]
    return doors


def _front_range(carcass, inset: bool) -> tuple[tuple, tuple]:
    """The (x, y) that fronts may cover: the hollow, or nearly the whole face of the carcass."""
    x, y, _ = carcass.inside
    if inset:
        return x, y
    half = carcass.width / 2
    return (-half, half), (carcass.bottom, carcass.top)


def _door_count(shop: Workshop, carcass) -> int:
    return 1 if carcass.width < 0.5 else shop.pick(2, 3, 4) if carcass.width > 1.1 else 2


def doors(shop: Workshop, carcass) -> Filling:
    """Doors over the whole front, with shelves behind them."""
    inset, count = shop.chance(0.5), _door_count(shop, carcass)
    pieces = _doors(shop, carcass, *_front_range(carcass, inset), count, inset)
    inner_x, inner_y, _ = carcass.inside
    dividers, _ = _columns(shop, carcass, 2 if count == 4 or shop.chance(0.15) else 1, inner_y)
    dividers = [_behind_doors(piece) for piece in dividers]
    if not dividers and shop.chance(0.5):
        stack = _shelf_stack(shop, carcass, inner_x, inner_y, shop.pick(1, 2))
        pieces += [_behind_doors(piece) for piece in stack]
    return dividers, pieces


def _behind_doors(piece: Piece) -> Piece:
    """Cut a little off the front of a piece, which would poke through a door inside the carcass."""
    piece.size, piece.center = piece.size - (0, 0, 0.024), piece.center - (0, 0, 0.012)
    return piece


def _drawer_grid(
    shop: Workshop, carcass, x: tuple, y: tuple, rows: int, columns: int, inset: bool
) -> list[Piece]:
    """Drawers in rows and columns, all of one size."""
    _, _, (back, front) = carcass.inside
    pitch_x, pitch_y = (x[1] - x[0]) / columns, (y[1] - y[0]) / rows
    front += 0.0 if inset else 0.02
    slot_x, slot_y = (x[0] + GAP, x[0] + pitch_x - GAP), (y[0] + GAP, y[0] + pitch_y - GAP)
    first = drawer(shop, "drawer", slot_x, slot_y, (back + 0.01 if inset else front - 0.02, front))
    row = shop.row(first, (pitch_x, 0, 0), columns)
    return [each for piece in row for each in shop.row(piece, (0, pitch_y, 0), rows)]


def drawers(kind: str):
    """Drawers over the whole front; `kind` ("chest", "bedside", "dresser") says how many columns."""

    def fill(shop: Workshop, carcass) -> Filling:
        inset = shop.chance(0.5)
        x, y = _front_range(carcass, inset)
        columns = {"chest": shop.pick(1, 1, 2), "bedside": 1, "dresser": shop.pick(2, 2, 3)}[kind]
        rows = max(2, min(6, int((y[1] - y[0]) / shop.between(0.14, 0.25))))
        dividers, slots = _columns(shop, carcass, columns, carcass.inside[1]) if inset else ([], [])
        if kind == "chest" and columns == 1 and shop.chance(0.35):  # two small drawers above the wide ones
            split = y[1] - (y[1] - y[0]) / rows
            wide = _drawer_grid(shop, carcass, x, (y[0], split), rows - 1, 1, inset)
            return dividers, wide + _drawer_grid(shop, carcass, x, (split, y[1]), 1, 2, inset)
        return dividers, _drawer_grid(shop, carcass, x, y, rows, columns, inset)

    return fill


def _two_storeys(shop: Workshop, carcass, share: float) -> tuple[list[Piece], tuple, tuple]:
    """A board between a lower and an upper part (`share` of the height is below): the board, and both y ranges."""
    x, (low, high), (back, front) = carcass.inside
    middle, half = low + share * (high - low), carcass.board / 2
    board = shop.block("shelf", x, (middle - half, middle + half), (back, front))
    return [board], (low, middle - half), (middle + half, high)


def doors_below_drawers(shop: Workshop, carcass) -> Filling:
    """One row of drawers above doors."""
    board, lower, upper = _two_storeys(shop, carcass, shop.between(0.65, 0.8))
    x, count = carcass.inside[0], _door_count(shop, carcass)
    pieces = _doors(shop, carcass, x, lower, count, True)
    return [], board + pieces + _drawer_grid(shop, carcass, x, upper, 1, min(count, 3), True)


def doors_above_drawers(shop: Workshop, carcass) -> Filling:
    """Doors above one or two rows of drawers."""
    board, lower, upper = _two_storeys(shop, carcass, shop.between(0.18, 0.32))
    x = carcass.inside[0]
    pieces = _drawer_grid(shop, carcass, x, lower, shop.pick(1, 2), shop.pick(1, 2), True)
    return [], board + pieces + _doors(shop, carcass, x, upper, _door_count(shop, carcass), True)


def open_above_doors(shop: Workshop, carcass) -> Filling:
    """Open shelves above doors."""
    board, lower, upper = _two_storeys(shop, carcass, shop.between(0.35, 0.6))
    x = carcass.inside[0]
    pieces = _doors(shop, carcass, x, lower, _door_count(shop, carcass), True)
    return [], board + pieces + _shelf_stack(shop, carcass, x, upper, shop.pick(0, 1, 2))


def drawers_below_open(shop: Workshop, carcass) -> Filling:
    """An open place above one or two drawers, or below them."""
    share, drawers_above = shop.between(0.5, 0.65), shop.chance(0.5)
    board, lower, upper = _two_storeys(shop, carcass, 1 - share if drawers_above else share)
    y = upper if drawers_above else lower
    return [], board + _drawer_grid(shop, carcass, carcass.inside[0], y, shop.pick(1, 2), 1, True)


def mixed_columns(shop: Workshop, carcass) -> Filling:
    """Two to four columns: the outer two alike, what is between them different."""
    count = shop.pick(2, 3, 3, 4)
    y = carcass.inside[1]
    dividers, slots = _columns(shop, carcass, count, y)
    outer, inner = shop.pick("door", "drawers", "open"), shop.pick("door", "drawers", "open")
    if inner == outer:  # nothing but shelves, or nothing but drawers, is another kind of furniture
        inner, outer = "door", shop.pick("door", "drawers")
    pieces = _column(shop, carcass, outer, slots[0], y)
    pieces += [shop.copy(piece, mirrored=True) for piece in pieces]
    if count == 3:
        pieces += _column(shop, carcass, inner, slots[1], y)
    elif count == 4:
        pieces += shop.both(*_column(shop, carcass, inner, slots[1], y))
    return dividers, pieces


def _column(shop: Workshop, carcass, kind: str, x: tuple, y: tuple) -> list[Piece]:
    if kind == "door":
        return _doors(shop, carcass, x, y, 1, True)
    if kind == "drawers":
        return _drawer_grid(shop, carcass, x, y, shop.pick(2, 3), 1, True)
    return _shelf_stack(shop, carcass, x, y, shop.pick(0, 1, 2))


# What it stands on


def plinth(shop: Workshop, carcass, lift: float) -> list[Piece]:
    """A board at the front and sides, or a whole box, set back a little."""
    inset, x, z = shop.between(0.0, 0.03), carcass.width / 2, carcass.depth / 2
    if shop.chance(0.4):
        return [shop.block("bottom_panel", (inset - x, x - inset), (0, lift), (-z, z - inset))]
    side = shop.block("base_side_panel", (x - inset - 0.025, x - inset), (0, lift), (-z, z - inset))
    front = shop.block(
        "base_side_panel", (inset + 0.025 - x, x - inset - 0.025), (0, lift), (z - inset - 0.025, z - inset)
    )
    pieces = [*shop.both(side), front]
    return pieces + ([shop.copy(front, (0, 0, inset + 0.025 - 2 * z))] if shop.chance(0.5) else [])


def feet(shop: Workshop, carcass, lift: float) -> list[Piece]:
    """Four blocks."""
    thick, x, z = shop.between(0.035, 0.07), carcass.width / 2, carcass.depth / 2
    front = shop.block("foot", (x - thick, x), (0, lift), (z - thick, z))
    return shop.both(front, shop.copy(front, (0, 0, thick - 2 * z)))


def legs(shop: Workshop, carcass, lift: float) -> list[Piece]:
    """Four slender legs, straight or splayed."""
    thick, splay = shop.between(0.025, 0.04), shop.pick(0.0, shop.between(0.02, 0.06))
    inset = thick / 2 + splay + shop.between(0.0, 0.04)
    x, z = carcass.width / 2 - inset, carcass.depth / 2 - inset
    feet = [((x + splay, 0, side * (z + splay)), (x, lift, side * z)) for side in (1, -1)]
    return shop.both(*(shop.beam("foot", foot, top, (thick, thick)) for foot, top in feet))


def frame(shop: Workshop, carcass, lift: float) -> list[Piece]:
    """Four legs joined by bars under the cabinet."""
    bar, x, z = shop.between(0.022, 0.035), carcass.width / 2, carcass.depth / 2
    front = shop.block("foot", (x - bar, x), (0, lift), (z - bar, z))
    low = (0, bar) if shop.chance(0.4) else (lift - bar, lift)
    side = shop.block("frame_horizontal_bar", (x - bar, x), low, (bar - z, z - bar))
    pieces = shop.both(front, shop.copy(front, (0, 0, bar - 2 * z)), side)
    across = shop.block("frame_horizontal_bar", (bar - x, x - bar), low, (z - bar, z))
    return pieces + ([across] if shop.chance(0.4) else [])


def casters(shop: Workshop, x: float, z: float) -> list[Piece]:
    """Four casters below the points (±x, ±z), 0.07 m high or less."""
    wheel = shop.block("other", (x - 0.012, x + 0.012), (0, 0.045), (z - 0.023, z + 0.023))
    fork = shop.block("other", (x - 0.02, x + 0.02), (0.04, 0.07), (z - 0.02, z + 0.02))
    front = group("caster", wheel, fork)
    return shop.both(front, shop.copy(front, (0, 0, -2 * z)))


def _cabinet_casters(shop: Workshop, carcass, lift: float) -> list[Piece]:
    return casters(shop, carcass.width / 2 - 0.04, carcass.depth / 2 - 0.04)


BASES = {"plinth": plinth, "feet": feet, "legs": legs, "frame": frame, "casters": _cabinet_casters}
