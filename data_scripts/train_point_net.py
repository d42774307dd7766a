"""Train the PointNet whose features the Fréchet distance compares: python -m data_scripts.train_point_net

It learns to tell, from points on their surfaces, which category the shapes of the ShapeAssembly data set are of and
how many leaf parts they have (five ranges a category): features that know both say whether shapes of the right kind
are too simple or too crowded. Writes pretrained/point_net.safetensors and, beside it, a card with what was measured.
Without the real programs (data_scripts.fetch_shapeassembly) it trains on the embedded ones, and says so on the card.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_seed, check_writable
from lib.datasets import CATEGORIES, REPOSITORY, DataError, shapeassembly
from lib.interpreters.shapeassembly import execute_many
from lib.metrics.clouds import surface_points_many
from lib.metrics.realism import in_parts
from lib.models.point_net import PRETRAINED, PointNet, PointNetConfig
from lib.models.weights import save
from lib.training.point_net import PointNetSchedule, new_point_net, train_epochs

POINTS = 1024  # drawn on each shape; a step sees some of them
RANGES = 5  # of the number of leaf parts, about equally full
SHAPES = 2000  # a category, in the order of the split, so that no category drowns the others
QUICK_SHAPES, QUICK_EPOCHS = 30, 2
QUICK_OUT = REPOSITORY / "build" / "point_net_quick.safetensors"

CARD = """# PointNet for the Fréchet distance

A PointNet ({parameters:,} weights) that names the category of a shape and the range of its number of leaf parts, from
points on its surface: {classes} classes. `lib.metrics.realism` compares its {features} features.

| | |
|---|---|
| data | {data} |
| training shapes | {train} |
| held-out shapes | {held_out} (split val, never trained on) |
| command | `python -m data_scripts.train_point_net{arguments}` |
| seed | {seed} |
| epochs | {epochs}, {points} of {drawn} points a step |
| time | {seconds:.0f} s of processor time, one thread |
| category right, held out | {category:.1f} % |
| class right, held out | {label:.1f} % (always the commonest class: {commonest:.1f} %) |

Licence: {licence}
"""
LICENCES = {
    "real": "the weights were trained on the ShapeAssembly programs, Copyright 2020, Brown University, which may be\n"
    "used for any purpose other than incorporation into a commercial product or service; treat the weights likewise.",
    "embedded": "the weights were trained on this project's own example programs; its licence is theirs.",
}


def train(options: argparse.Namespace) -> None:
    """Train, measure on the val split, write weights and card."""
    card_path = options.out.with_suffix(".md")
    if card_path == options.out:
        raise DataError(
            f"{options.out} is where the card goes; expected another ending, such as .safetensors"
        )
    check_seed(options.seed)
    check_writable(options.out)
    check_writable(card_path)
    torch.set_num_threads(1)
    started = time.process_time()
    edges = {category: _edges(category, options.shapes) for category in CATEGORIES}
    points, labels = _clouds("train", edges, options.shapes, options.seed)
    network = new_point_net(PointNetConfig(_names(edges)), options.seed)
    schedule = PointNetSchedule(epochs=options.epochs)
    with tqdm(total=schedule.epochs, desc="epochs") as bar:
        for loss in train_epochs(network, points, labels, schedule, options.seed):
            bar.set_postfix(loss=f"{loss:.3f}")
            bar.update()
    facts = _measured(network, *_clouds("val", edges, options.shapes, options.seed + 1))
    facts |= {"train": len(points), "seconds": time.process_time() - started}
    card = _card(network, facts, schedule, options)
    save(network.eval(), options.out)
    write_whole(card_path, card.encode())
    print(card)
    print(f"kept in {options.out}")


def _edges(category: str, shapes: int) -> list[int]:
    """The greatest number of leaf parts of each range but the last."""
    count = execute_many(list(shapeassembly(category, "train")[:shapes])).count
    return sorted({int(edge) for edge in np.quantile(count, np.arange(1, RANGES) / RANGES)})


def _names(edges: dict[str, list[int]]) -> tuple[str, ...]:
    """Names such as "chair, 7 to 8 leaf parts", in the order of the labels."""
    names = []
    for category in CATEGORIES:
        below = ["up", *(f"{edge + 1}" for edge in edges[category])]
        names += [f"{category}, {low} to {high} leaf parts" for low, high in zip(below, edges[category])]
        names.append(f"{category}, {below[-1]} or more leaf parts")
    return tuple(names)


def _clouds(
    split: str, edges: dict[str, list[int]], shapes: int, seed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Surface points (n, POINTS, 3) and labels (n,) of all categories."""
    points, labels, first = [], [], 0
    for number, category in enumerate(CATEGORIES):
        executed = execute_many(list(shapeassembly(category, split)[:shapes]))
        points.append(surface_points_many(executed, POINTS, 10 * seed + number).float())
        labels.append(first + np.searchsorted(edges[category], executed.count, side="left"))
        first += len(edges[category]) + 1
    return torch.cat(points), torch.from_numpy(np.concatenate(labels))


def _measured(network: PointNet, points: torch.Tensor, labels: torch.Tensor) -> dict:
    """Shares of held-out shapes, in percent, whose class, and whose category, is named right."""
    guess = in_parts(network, network, points).argmax(1)
    category = np.array([name.split(",")[0] for name in network.config.labels])
    return {
        "held_out": len(points),
        "label": 100 * (guess == labels).double().mean().item(),
        "category": 100 * (category[guess] == category[labels]).mean(),
        "commonest": 100 * labels.bincount().max().item() / len(labels),
    }


def _card(network: PointNet, facts: dict, schedule: PointNetSchedule, options: argparse.Namespace) -> str:
    programs = shapeassembly(split="train")
    arguments = (" --quick" if options.quick else "") + (f" --seed {options.seed}" if options.seed else "")
    return CARD.format(
        **facts,
        parameters=sum(weights.numel() for weights in network.parameters()),
        classes=len(network.config.labels),
        features=network.config.widths[-1],
        data=f"at most {options.shapes} programs a category of: {programs.describe()}",
        arguments=arguments,
        seed=options.seed,
        epochs=schedule.epochs,
        points=schedule.points,
        drawn=POINTS,
        licence=LICENCES[programs.source],
    )


def main(arguments: list[str] | None = None) -> int:
    """The exit code: 0 finished, 1 nothing could be written, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a few shapes and epochs, to see that it works")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--out", type=Path, help=f"the weights (default: {PRETRAINED.relative_to(REPOSITORY)})"
    )
    options = parser.parse_args(arguments)
    options.out = options.out or (QUICK_OUT if options.quick else PRETRAINED)
    options.shapes = QUICK_SHAPES if options.quick else SHAPES
    options.epochs = QUICK_EPOCHS if options.quick else PointNetSchedule().epochs
    return exit_code(lambda: train(options), INTERRUPTED)


if __name__ == "__main__":
    raise SystemExit(main())
