"""Chairs: a seat, and a base, a back, arms and a head that suit it, each chosen on its own.

chair_seat, chair_base, chair_back, chair_arm … are PartNet's groups; a family (dining chair, office chair, sofa,
stool, lounge chair) says only which choices and proportions go together.
"""

from dataclasses import dataclass

from . import chair_arms
from . import chair_backs as backs
from . import chair_bases as bases
from . import chair_seats as seats
from .kit import Piece, Workshop, group


@dataclass
class Frame:
    """Where the parts of a chair meet; metres. The seat is centred at x = z = 0, its top at `height`."""

    width: float
    depth: float
    height: float
    thick: float  # of the seat with all that belongs to it
    lean: float = 0.0  # of the back, radians
    back: float = 0.0  # height of the back above the seat; 0 without a back

    @property
    def under(self) -> float:
        """Height of the underside of the seat."""
        return self.height - self.thick

    @property
    def rear(self) -> float:
        return -self.depth / 2


def chair(workshop: Workshop) -> Piece:
    """One chair of a family drawn at random."""
    family = workshop.weighted({dining: 44, office: 15, sofa: 14, stool: 10, lounge: 17})
    pieces = family(workshop)
    return group("chair", *[piece for piece in pieces if piece.children])


def dining(shop: Workshop) -> list[Piece]:
    """A chair for a table, with or without arms."""
    frame = Frame(
        shop.between(0.40, 0.52), shop.between(0.40, 0.50), shop.between(0.42, 0.48), shop.between(0.03, 0.08)
    )
    frame.back, frame.lean = shop.between(0.32, 0.60), shop.weighted({0: 1, shop.between(0.05, 0.25): 3})
    base = shop.weighted(
        {
            bases.legs: 10,
            bases.runners: 2,
            bases.cantilever: 2,
            bases.pedestal: 1.5,
            bases.crossed: 1,
            bases.panels: 0.7,
            bases.h_legs: 1.3,
        }
    )
    back = shop.pick(*backs.WOODEN, backs.slab, backs.panel_on_posts)
    arms = shop.weighted({None: 3, chair_arms.wooden: 2})
    return _assemble(shop, frame, shop.pick(*seats.FIRM), base, back, arms, headrest=0.08)


def office(shop: Workshop) -> list[Piece]:
    """A swivel chair: a column on a star of legs, often on casters."""
    frame = Frame(
        shop.between(0.44, 0.54), shop.between(0.44, 0.52), shop.between(0.42, 0.52), shop.between(0.05, 0.11)
    )
    frame.back, frame.lean = shop.between(0.35, 0.70), shop.between(0.0, 0.22)
    seat = shop.weighted({seats.slab: 3, seats.cushion_on_board: 1})
    back = shop.weighted({backs.slab: 3, backs.panel_on_stem: 3, backs.winged: 2, backs.panel_on_posts: 1})
    arms = shop.weighted({None: 1, chair_arms.wooden: 1.3})
    return _assemble(shop, frame, seat, bases.star, back, arms, headrest=0.2)


def sofa(shop: Workshop) -> list[Piece]:
    """An upholstered seat for one to four people."""
    people = shop.weighted({1: 4, 2: 3, 3: 3, 4: 0.7})
    frame = Frame(shop.between(0.54, 0.66) * people, shop.between(0.58, 0.78), shop.between(0.38, 0.46), 0.0)
    frame.thick = shop.between(0.14, 0.3)
    frame.back, frame.lean = shop.between(0.3, 0.55), shop.pick(0, shop.between(0.05, 0.22))
    seat = seats.cushions(people)
    back = shop.pick(backs.slab, backs.cushions(people), backs.winged if people == 1 else backs.slab)
    base = shop.weighted({bases.feet: 3, bases.plinth: 1, bases.low_runners: 1})
    arms = shop.weighted({None: 1, chair_arms.upholstered: 5})
    return _assemble(shop, frame, seat, base, back, arms, headrest=0.06)


def stool(shop: Workshop) -> list[Piece]:
    """A bar stool or a low one, seldom with a low back."""
    side, tall = shop.between(0.3, 0.4), shop.chance(0.75)
    height = shop.between(0.60, 0.78) if tall else shop.between(0.38, 0.5)
    frame = Frame(side, side * shop.between(0.9, 1.0), height, shop.between(0.05, 0.1))
    back = shop.weighted({None: 3, backs.slab: 1, backs.rail: 1, backs.panel_on_posts: 1})
    if back:
        frame.back, frame.lean = shop.between(0.16, 0.32), shop.between(0, 0.15)
    base = shop.weighted(
        {bases.legs: 4, bases.tripod: 2, bases.star: 3, bases.pedestal: tall, bases.runners: 1}
    )
    return _assemble(shop, frame, shop.pick(*seats.FIRM), base, back, None, headrest=0)


def lounge(shop: Workshop) -> list[Piece]:
    """A low, deep easy chair: rockers, sled runners, shells."""
    frame = Frame(
        shop.between(0.54, 0.66), shop.between(0.52, 0.66), shop.between(0.34, 0.42), shop.between(0.06, 0.14)
    )
    frame.back, frame.lean = shop.between(0.45, 0.75), shop.between(0.15, 0.42)
    seat = shop.pick(seats.slab, seats.cushion_on_board, seats.cushion_on_frame, seats.slats)
    base = shop.pick(bases.legs, bases.rockers, bases.runners, bases.cantilever, bases.star, bases.h_legs)
    back = shop.pick(backs.slab, backs.panel_on_posts, backs.ladder, backs.spindles, backs.winged)
    arms = shop.weighted({None: 1, chair_arms.wooden: 5})
    if base is bases.legs and seat is not seats.slats and shop.chance(0.4):
        arms = chair_arms.upholstered
    return _assemble(shop, frame, seat, base, back, arms, headrest=0.15)


def _assemble(shop: Workshop, frame: Frame, seat, base, back, arms, headrest: float) -> list[Piece]:
    """Each choice made into its group; None is left out. A seat and a back may correct the frame, so they go first."""
    if base in bases.CENTRAL and seat in seats.HOLLOW:
        seat = seats.slab  # a column under the middle would end in the air
    pieces = [group("chair_seat", *seat(shop, frame))]
    if back:
        parts = back(shop, frame)
        if back in backs.PADDED and shop.chance(headrest):
            middle = parts[0].children[0].center[2]  # of the padded surface
            pieces.append(backs.leaning(frame, group("chair_head", *backs.head(shop, frame, middle))))
        pieces.append(backs.leaning(frame, group("chair_back", *parts)))
    if arms:
        pieces += arms(shop, frame)
    return [group("chair_base", *base(shop, frame)), *pieces]
