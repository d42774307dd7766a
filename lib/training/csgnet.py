"""What CSGNet learns with a teacher: the programs of pictures that were drawn from random programs (paper, eq. 1).

Pictures are drawn while it learns, a batch at a time, so that a data set is a list of tokens. An epoch is a number of
programs drawn from that list, by chance and with repetitions. The log says what share of its time went into finding
out which parts of a program are needed and in which order they are taught, and what share into drawing and jitter.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from ..datasets.csg import TokenSet
from ..interpreters.csg import execute_many
from ..interpreters.csg.ordering import ordered
from ..interpreters.csg.pruning import pruned
from ..metrics.images import image_chamfer, iou
from ..models.csgnet import CSGNet
from ..models.csgnet_decoding import write
from .csgnet_jitter import jittered

PER_REPORT = 100  # programs at once when other data is scored


class Teacher(nn.Module):
    """The network and what it is asked to do, as one module: pictures and their programs -> the loss."""

    def __init__(self, network: CSGNet):
        super().__init__()
        self.network = network

    def forward(
        self, canvases: Bool[Tensor, "rows *canvas"], tokens: Int[Tensor, "rows steps"]
    ) -> Float[Tensor, ""]:
        """Mean negative logarithm of the probability of a token, over all tokens up to each program's `$`."""
        stop = self.network.stop
        ended = (tokens == stop).cumsum(1) - (tokens == stop).long() > 0  # after the first `$`
        scores = self.network(canvases, tokens).float()
        return nn.functional.cross_entropy(scores[~ended], tokens[~ended])


@dataclass(frozen=True)
class Lessons:
    """What of the programs is taught, and how many.

    programs    an epoch
    curriculum  share of all steps in which the longest programs that are shown grow from the shortest to all of them
    pruned      teach programs without parts that their pictures do not need, see interpreters.csg.pruning
    in_order    of the ways to say a program teach one, see interpreters.csg.ordering
    jitter      share of the pictures that are moved and stretched a little, see csgnet_jitter; of the plane only
    Raises ValueError for less than one program, and for shares that are not from 0 to 1.
    """

    programs: int
    curriculum: float = 0.0
    pruned: bool = True
    in_order: bool = True
    jitter: float = 0.0

    def __post_init__(self) -> None:
        if self.programs < 1 or not (0 <= self.curriculum <= 1 and 0 <= self.jitter <= 1):
            raise ValueError(
                f"found {self.programs} programs, curriculum {self.curriculum}, jitter {self.jitter}; expected at "
                "least 1, and shares from 0 to 1"
            )


@dataclass
class ParseTask:
    """Learn programs of `train`; those of `other` are scored after every epoch. A `Task` for `lib.training.loop.fit`.

    about: JSON, data and settings that must be the same when a run goes on. Raises ValueError for no programs, for
    others of another vocabulary, for a curriculum of programs that are not sorted by length, and for jitter in space.
    """

    module: Teacher
    train: TokenSet
    other: TokenSet
    lessons: Lessons
    about: dict
    preparing: float = field(default=0.0, init=False)  # seconds since the last report
    drawing: float = field(default=0.0, init=False)
    started: float = field(default_factory=time.perf_counter, init=False)

    def __post_init__(self) -> None:
        words = self.train.vocabulary
        if not len(self.train) or not len(self.other) or self.other.vocabulary.dimensions != words.dimensions:
            found = f"{len(self.train)} programs to learn, {len(self.other)} to test"
            raise ValueError(f"found {found}; expected some of both, of one vocabulary")
        if self.lessons.jitter and words.dimensions != 2:
            raise ValueError(f"found jitter {self.lessons.jitter} in space; expected 0")
        self._lengths = (self.train.tokens != words.stop).sum(1)
        if self.lessons.curriculum and (self._lengths.diff() < 0).any():
            raise ValueError(
                "found a longer program before a shorter one; a curriculum expects the shorter ones first"
            )

    @property
    def network(self) -> nn.Module:
        return self.module

    def __len__(self) -> int:
        return self.lessons.programs

    def loss(
        self, network: nn.Module, picks: Sequence[int], noise: torch.Generator, progress: float
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of as many random programs as there are picks."""
        tokens = self.train.tokens[torch.randint(self.shown(progress), (len(picks),), generator=noise)]
        start = time.perf_counter()
        tokens = self.taught(tokens)
        ready = time.perf_counter()
        device = next(network.parameters()).device
        canvases = drawn(tokens, self.train, device)
        if self.lessons.jitter:
            canvases = jittered(canvases, self.lessons.jitter, noise)
        self.preparing += ready - start
        self.drawing += time.perf_counter() - ready
        return network(canvases, tokens.to(device)), {}

    def taught(self, tokens: Int[Tensor, "rows length"]) -> Int[Tensor, "rows length"]:
        """The programs as the network is to write them, with one `$` after the longest."""
        words, lessons = self.train.vocabulary, self.lessons
        if lessons.pruned:
            tokens = pruned(tokens, words)
        if lessons.in_order:
            tokens = ordered(tokens, words)
        # The order may make a part needless, as C's in A * C - B for (A - B) * C: of 5 of 100 programs of the plane.
        both = lessons.pruned and lessons.in_order
        while both and not torch.equal(shorter := pruned(tokens, words), tokens):
            tokens = ordered(shorter, words)
        return tokens[:, : int((tokens != words.stop).sum(1).max()) + 1]

    def shown(self, progress: float) -> int:
        """How many of the programs, the shortest first, are drawn from when a share `progress` of all steps is done."""
        if progress >= self.lessons.curriculum:
            return len(self.train)
        lengths = self._lengths.unique()
        longest = lengths[int(progress / self.lessons.curriculum * len(lengths))]
        return int((self._lengths <= longest).sum())

    @torch.no_grad()
    def report(self, network: nn.Module) -> dict[str, float]:
        """Shares of the time since the last report; of the other programs the loss, a mean over all their tokens, and
        how alike the shape that the network writes (greedy) is to the one it sees: Chamfer distance, px, or in space
        IoU, a mean over programs."""
        seconds = time.perf_counter() - self.started
        found = {
            f"{name}_share": min(1.0, getattr(self, name) / seconds) for name in ("preparing", "drawing")
        }
        device = next(network.parameters()).device
        sums = {"val_loss": 0.0, "val_cd" if self.other.vocabulary.dimensions == 2 else "val_iou": 0.0}
        likeness, asked = list(sums)[1], 0
        for start in range(0, len(self.other), PER_REPORT):
            tokens = self.taught(self.other.tokens[start : start + PER_REPORT])
            canvases = drawn(tokens, self.other, device)
            count = int((tokens != self.other.vocabulary.stop).sum()) + len(tokens)  # each ends with one `$`
            sums["val_loss"] += network(canvases, tokens.to(device)).item() * count
            asked += count
            answers = drawn(write(self.module.network, canvases).tokens, self.other, device)
            score = (
                image_chamfer(canvases, answers) if likeness == "val_cd" else iou(canvases, answers, dims=3)
            )
            sums[likeness] += score.sum().item()
        self.preparing, self.drawing, self.started = 0.0, 0.0, time.perf_counter()
        return found | {"val_loss": sums["val_loss"] / asked, likeness: sums[likeness] / len(self.other)}


def drawn(
    tokens: Int[Tensor, "rows length"], programs: TokenSet, device: torch.device
) -> Bool[Tensor, "rows *canvas"]:
    """What programs draw: images or grids."""
    shapes = execute_many(tokens, programs.vocabulary, device=device)
    return shapes.images if shapes.dimensions == 2 else shapes.grids
