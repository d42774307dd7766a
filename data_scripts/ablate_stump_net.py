"""What each choice in CSG-Stump Net's training is worth:   python -m data_scripts.ablate_stump_net

Trains the compact network on chairs, once for each choice and seed, two passes over 2,560 clouds each, and scores it on
validation clouds. Each choice differs from the default in one thing. Writes results/stump_net/ablation.json; a row has

    options     what was said to `python -m lib.training stump_net`, beside what all were told
    weights     of the network, how many
    runs        for each seed: IoU of the test points soft and decided (percent), primitives and nodes used, entropy of
                the connections (bits), seconds; and the commit of the code that trained it
    soft, decided, lost   means over the seeds, and what deciding loses (percent of the soft IoU); spread: largest
                less smallest decided IoU of the seeds

Make the clouds first: data_scripts.fetch_shapeassembly, then data_scripts.make_solids --source shapeassembly. The runs
stay in --runs, and a killed command goes on from there. --quick: one seed, one pass; --source embedded needs no data.
"""

import argparse
import json
import shlex
import sys
from itertools import product
from pathlib import Path

from tqdm import tqdm

from data_scripts.ending import GOES_ON, exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import check_writable, rounded, version
from lib.datasets import REPOSITORY, DataError
from lib.datasets.solid_clouds import SOURCES, solid_clouds
from lib.training import stump_net_command
from lib.training.commands import main as train
from lib.training.loop import LOG

RESULT = REPOSITORY / "results" / "stump_net" / "ablation.json"
CHOICES = {
    "default": "",
    "linear head": "--head linear",
    "steeper connections": "--connections steeper",
    "straight-through connections": "--connections straight_through",
    "sharp surfaces from the start": "--dullest 150",
    "softmax means": "--power 0",
    "pull as the authors": "--pull authors",
    "no complement": "--no_complement",
    "boxes only": "--kinds box",
}
SEEDS = (0, 1, 2)
CATEGORY = "chair"
FIGURES = {  # ours -> the log's, and what it is multiplied with
    "soft_iou": ("val_soft_iou", 100),
    "decided_iou": ("val_iou", 100),
    "primitives": ("primitives", 1),
    "nodes": ("nodes", 1),
    "entropy": ("entropy", 1),
    "seconds": ("seconds", 1),
}
DECIDING = ("interpreters", "models", "training", "datasets")


def measure(runs: Path, source: str, quick: bool) -> dict:
    """All rows, from runs that are finished or are trained now. Raises DataError."""
    data = solid_clouds(source, "train").select(category=CATEGORY)
    told = ("--source", source, "--category", CATEGORY, "--epochs", "1" if quick else "2")
    seeds = SEEDS[:1] if quick else SEEDS
    rows: dict[str, dict] = {name: {"options": options, "runs": []} for name, options in CHOICES.items()}
    # Every choice with one seed comes before the second seed: a comparison is there early.
    for seed, name in tqdm([*product(seeds, CHOICES)], desc="runs", disable=None):
        place = runs / ("quick" if quick else "whole")
        run, weights = trained(place / f"{name.replace(' ', '-')}-{seed}", CHOICES[name], told, seed)
        rows[name]["weights"] = weights
        rows[name]["runs"].append({"seed": seed} | run)
    header = {"data": data.describe(), "all": shlex.join(told), **version(*DECIDING)}
    return rounded(header | {"rows": {name: row | means(row["runs"]) for name, row in rows.items()}})


def trained(folder: Path, options: str, told: tuple[str, ...], seed: int) -> tuple[dict, int]:
    """Figures at the end of a run, and how many weights its network has. Raises DataError where it could not end,
    and KeyboardInterrupt."""
    command = ["stump_net", *told, *shlex.split(options), "--seed", str(seed), "--out", str(folder)]
    code = train({"stump_net": stump_net_command.COMMAND}, command)
    if code == 130:
        raise KeyboardInterrupt
    if code:
        raise DataError(f"{folder}: the training did not end; see above")
    last = json.loads((folder / LOG).read_text(encoding="utf-8").splitlines()[-1])
    facts = json.loads((folder / "stump_net.json").read_text(encoding="utf-8"))
    figures = {name: factor * last[key] for name, (key, factor) in FIGURES.items()}
    return figures | {"commit": facts["code"]["commit"]}, facts["weights"]


def means(runs: list[dict]) -> dict[str, float]:
    """Over the seeds."""
    soft, decided = ([run[f"{name}_iou"] for run in runs] for name in ("soft", "decided"))
    lost = 100 * (1 - sum(decided) / sum(soft)) if sum(soft) else 0.0
    return {
        "soft": sum(soft) / len(soft),
        "decided": sum(decided) / len(decided),
        "lost": lost,
        "spread": max(decided) - min(decided),
    }


def table(found: dict) -> str:
    """The rows, a line each."""
    lines = [f"{'':30} {'soft':>6} {'decided':>8} {'lost %':>7} {'spread':>7} {'weights':>11}"]
    for name, row in found["rows"].items():
        lines.append(
            f"{name:30} {row['soft']:6.1f} {row['decided']:8.1f} {row['lost']:7.1f} {row['spread']:7.1f} "
            f"{row['weights']:11,}"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns the exit code: 0 finished, 1 nothing could be written, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    runs = Path("runs") / "stump-ablation"
    parser.add_argument("--runs", type=Path, default=runs, help="folder of the runs (default: %(default)s)")
    parser.add_argument(
        "--source", choices=(*SOURCES, "embedded"), default=SOURCES[0], help="default: %(default)s"
    )
    parser.add_argument("--quick", action="store_true", help="one seed, one pass over the clouds")
    parser.add_argument("--out", type=Path, default=RESULT, help=f"default: {RESULT.relative_to(REPOSITORY)}")
    options = parser.parse_args(arguments)

    def work() -> None:
        check_writable(options.out)
        found = measure(options.runs, options.source, options.quick)
        print(table(found))
        write_whole(options.out, (json.dumps(found, indent=1) + "\n").encode())
        print(f"kept in {options.out}")

    return exit_code(work, GOES_ON)


if __name__ == "__main__":
    sys.exit(main())
