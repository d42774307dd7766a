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
    arm: float = 0.0  # how far the arms stick out beyond the seat's sides

    @property
    def under(self) -> float:
        """Height of the underside of the seat."""
        return self.height - self.thick

    @property
    def rear(self) -> float:
        return -self.depth / 2


def chair(workshop: Workshop) -> Piece:
    """One chair of a family drawn at random."""
    family = workshop.pick(dining, office, sofa, stool, lounge, weights=(44, 15, 14, 10, 17))
    pieces = family(workshop)
    return group("chair", *[piece for piece in pieces if piece.children])


def dining(shop: Workshop) -> list[Piece]:
    """A chair for a table, with or without arms."""
    frame = Frame(
        shop.between(0.40, 0.52), shop.between(0.40, 0.50), shop.between(0.42, 0.48), shop.between(0.03, 0.08)
    )
    frame.back, frame.lean = shop.between(0.32, 0.60), shop.pick(0, shop.between(0.05, 0.25), weights=(1, 3))
    base = shop.pick(
        *(
            bases.legs,
            bases.runners,
            bases.cantilever,
            bases.pedestal,
            bases.crossed,
            bases.panels,
            bases.h_legs,
        ),
        weights=(10, 2, 2, 1.5, 1, 0.7, 1.3),
    )
    back = shop.pick(*backs.WOODEN, backs.slab, backs.panel_on_posts)
    arms = shop.pick(None, chair_arms.wooden, weights=(3, 2))
    return _assemble(shop, frame, shop.pick(*seats.FIRM), base, back, arms, headrest=0.08)


def office(shop: Workshop) -> list[Piece]:
    """A swivel chair: a column on a star of legs, often on casters."""
    frame = Frame(
        shop.between(0.44, 0.54), shop.between(0.44, 0.52), shop.between(0.42, 0.52), shop.between(0.05, 0.11)
    )
    frame.back, frame.lean = shop.between(0.35, 0.70), shop.between(0.0, 0.22)
    seat = shop.pick(seats.slab, seats.cushion_on_board)
    back = shop.pick(backs.slab, backs.panel_on_stem, backs.panel_on_posts, backs.winged)
    arms = shop.pick(None, chair_arms.wooden, weights=(1, 1.3))
    return _assemble(shop, frame, seat, bases.star, back, arms, headrest=0.2)


def sofa(shop: Workshop) -> list[Piece]:
    """An upholstered seat for one to four people."""
    people = shop.pick(1, 2, 3, 4, weights=(4, 3, 3, 0.7))
    frame = Frame(shop.between(0.54, 0.66) * people, shop.between(0.58, 0.78), shop.between(0.38, 0.46), 0.0)
    frame.thick = shop.between(0.14, 0.3)
    frame.back, frame.lean = shop.between(0.3, 0.55), shop.pick(0, shop.between(0.05, 0.22))
    seat = seats.cushions(people)
    back = shop.pick(backs.slab, backs.cushions(people), backs.winged if people == 1 else backs.slab)
    base = shop.pick(bases.feet, bases.plinth, bases.low_runners, weights=(3, 1, 1))
    arms = shop.pick(None, chair_arms.upholstered, weights=(1, 5))
    return _assemble(shop, frame, seat, base, back, arms, headrest=0.06)


def stool(shop: Workshop) -> list[Piece]:
    """A bar stool or a low one, seldom with a low back."""
    side, tall = shop.between(0.3, 0.4), shop.chance(0.75)
    height = shop.between(0.60, 0.78) if tall else shop.between(0.38, 0.5)
    frame = Frame(side, side * shop.between(0.9, 1.0), height, shop.between(0.05, 0.1))
    back = shop.pick(None, backs.slab, backs.rail, backs.panel_on_posts, weights=(3, 1, 1, 1))
    if back:
        frame.back, frame.lean = shop.between(0.16, 0.32), shop.between(0, 0.15)
    base = shop.pick(
        bases.legs, bases.tripod, bases.star, bases.pedestal, bases.runners, weights=(4, 2, 3, tall, 1)
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
    arms = shop.pick(None, chair_arms.wooden, chair_arms.upholstered, weights=(1, 4, 1))
    return _assemble(shop, frame, seat, base, back, arms, headrest=0.15)


def _assemble(shop: Workshop, frame: Frame, seat, base, back, arms, headrest: float) -> list[Piece]:
    """Each choice made into its group; None is left out. A seat and a back may correct the frame, so they go first."""
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
