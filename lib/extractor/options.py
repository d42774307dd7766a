"""What an extraction may be asked to leave out."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """What an extraction may leave out: the ablations of the paper's section 7.1, and rejected programs for study.

    Without macros or hierarchy a program may declare more cuboids: there the limit on their number does not apply, so
    that an ablation can be made of the same shapes.
    """

    canonical_order: bool = (
        True  # False: lines in an arbitrary (but grounded) order, drawn by the graph's name
    )
    aligned_flag: bool = True  # False: no cuboid is marked as aligned
    macros: bool = True  # False: no squeeze, reflect or translate
    hierarchy: bool = True  # False: all leaves in one block
    keep_rejected: bool = False  # True: programs that fail validation are handed out, with their reason


CANONICAL = Options()  # what training programs are made with
