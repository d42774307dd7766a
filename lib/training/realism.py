"""% fool: a PointNet learns to tell generated shapes from real ones; how many unseen ones does it get wrong?

(ShapeAssembly paper, section 7.1 and Appendix E; `lib.metrics.realism` says how we read them.) The paper leaves open
how many epochs, points and shapes; ours are the constants below.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor
from tqdm import tqdm

from ..metrics.realism import Realism, in_parts, realism
from ..models.point_net import PointNetConfig
from .point_net import PointNetSchedule, new_point_net, train_epochs

HELD_OUT = 0.25  # share of each kind that a classifier does not see in training
FOLDS = 2  # classifiers, each with other shapes held out
LAST = 5  # epochs over which the share is averaged
SCHEDULE = PointNetSchedule(epochs=15, batch=16, rate=2e-3)
CLASSIFIER = PointNetConfig(("generated", "real"), widths=(32, 64, 128), head_width=64)
REAL = CLASSIFIER.labels.index("real")


def percent_fooled(
    generated: Float[Tensor, "n points 3"],
    real: Float[Tensor, "m points 3"],
    seed: int = 0,
    schedule: PointNetSchedule = SCHEDULE,
    last: int = LAST,
) -> Realism:
    """Train classifiers on equal numbers of both kinds; shares of those held out that they get wrong, in percent.

    generated, real   surface points of shapes, world units; of the larger set a part is drawn. Draw the points of the
                      two with different seeds (`surface_points_many`).
    Each of FOLDS classifiers holds out another part; a single one often leans to one of the answers, which moves
    `fooled` and `doubted` against each other. Everything is drawn from `seed`. With 500 of each kind held out, as of
    1,000, chance alone gives a share of 25 % a standard error of 2 points.
    A generator that repeats shapes of the training set is rewarded: its samples are called what their twins are.
    Raises ValueError for fewer than eight shapes of a kind, or fewer epochs than are averaged.
    """
    size = min(len(generated), len(real))
    if size < 8:
        raise ValueError(f"found {size} shapes of one kind; expected at least 8")
    if not 1 <= last <= schedule.epochs:
        raise ValueError(f"found {last} last epochs of {schedule.epochs}; expected 1 to {schedule.epochs}")
    generator = torch.Generator().manual_seed(seed)
    kinds = [kind[torch.randperm(len(kind), generator=generator)[:size]] for kind in (generated, real)]
    with tqdm(total=FOLDS * schedule.epochs, desc="% fool", leave=False, disable=None) as bar:
        folds = [_verdicts(kinds, fold, seed, schedule, last, bar) for fold in range(FOLDS)]
    of_generated, of_real = (torch.cat(verdicts, 1) for verdicts in zip(*folds))
    return realism(of_generated, of_real)


def _verdicts(
    kinds: list[Tensor], fold: int, seed: int, schedule: PointNetSchedule, last: int, bar: tqdm
) -> list[Bool[Tensor, "last held"]]:
    """One classifier's training: which held-out shapes of each kind it calls real, in the last epochs."""
    points, held = _divided(kinds, fold)
    labels = torch.arange(2).repeat_interleave(len(points) // 2)
    network = new_point_net(CLASSIFIER, seed + fold)
    verdicts = []
    for epoch, _loss in enumerate(train_epochs(network, points, labels, schedule, seed + fold), start=1):
        bar.update()
        if epoch > schedule.epochs - last:
            logits = in_parts(network, network, held[:, : schedule.points])
            verdicts.append(logits.argmax(-1) == REAL)
    return list(torch.stack(verdicts).cpu().chunk(2, dim=1))


def _divided(kinds: list[Tensor], fold: int) -> tuple[Tensor, Tensor]:
    """Of both kinds, the generated first: those to train with, and those held out, a part of its own in each fold."""
    held = round(HELD_OUT * len(kinds[0]))
    turned = [kind.roll(-fold * held, 0) for kind in kinds]
    return torch.cat([kind[held:] for kind in turned]), torch.cat([kind[:held] for kind in turned])
