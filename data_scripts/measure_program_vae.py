"""Measure what a program VAE writes, one row of the ShapeAssembly paper's Tables 2 to 6 at a time.

    python -m data_scripts.measure_program_vae chair                          the committed weights, 1,000 samples
    python -m data_scripts.measure_program_vae chair --method no_reject       the same, invalid lines left out instead
    python -m data_scripts.measure_program_vae chair --method ours_authors_rules       their tolerances: 50 %, not 10 %
    python -m data_scripts.measure_program_vae chair --method ours_fitted     the paper's tolerances, and codes drawn
                                                                              from where those of real programs lie
    python -m data_scripts.measure_program_vae chair --method flat --weights runs/chair-flat/program_vae.safetensors
    python -m data_scripts.measure_program_vae chair --method ground_truth    the real programs themselves
    python -m data_scripts.measure_program_vae chair --method validation      the row "Validation" of Table 4
    python -m data_scripts.measure_program_vae chair --method interpolation   Table 6

The ablations of chairs were trained like the chairs themselves: `python -m lib.training program_vae --category chair
--ablation flat --epochs 120 --kl 0.05 --out runs/chair-flat`, after `python -m data_scripts.make_ablations`.

With --seed N, --out results/program_vae/other_seeds/N/CATEGORY_METHOD.json keeps the row beside that of seed 0.

Each writes results/program_vae/CATEGORY_METHOD.json, with the seed, the number of samples, the date and the version of
the code and of the weights. `lib.viewing.program_tables` puts the rows beside the paper's. A row takes two to three
minutes on two cores; --quick takes 48 samples.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
import torch

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_seed, check_writable, version
from lib.datasets import CATEGORIES, REPOSITORY, DataError, shapeassembly
from lib.interpreters.shapeassembly import Program, Shapes, execute_many
from lib.metrics.chamfer import novelty
from lib.metrics.clouds import surface_points_many
from lib.metrics.interpolation import step_size
from lib.metrics.programs import program_statistics
from lib.metrics.realism import cloud_features, frechet_distance
from lib.metrics.rootedness import rooted
from lib.metrics.stability import AUTHORS_TRIAL, stable_many
from lib.metrics.structures import novel_share
from lib.models.code_distribution import CodeDistribution
from lib.models.point_net import PointNet
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE
from lib.models.weights import CheckpointError, load
from lib.models.writing import sample, write
from lib.models.writing_rules import AUTHORS, Rules
from lib.training.realism import percent_fooled

FOLDER = REPOSITORY / "results" / "program_vae"
ABLATIONS = ("flat", "no_order", "no_align", "no_macros")
# Methods whose codes are drawn from a fitted distribution. The ablations too: the codes of flat chairs lie so far from
# the standard normal distribution that what is drawn from there has a Fréchet distance of 871, and of 18 fitted.
FITTED = ("ours_fitted", *ABLATIONS)
WRITTEN = ("ours", "ours_authors_rules", "no_reject", *FITTED)
DECIDING = ("interpreters", "models", "metrics", "training")  # parts of lib that the numbers come from
METHODS = (*WRITTEN, "ground_truth", "validation", "interpolation")
CLOUD = 1_024  # points on a shape, for what PointNet sees
# Of codes from a fitted distribution: of 0.75 to 1, chosen on other samples than those of the rows.
FITTED_SPREAD = {"chair": 0.85, "table": 1.0, "storage": 0.9}
QUICK = 48
LEAST = 8  # samples: a classifier needs some to learn from, and some that it has not seen
SEQUENCES, STEPS = 100, 100  # of Table 6


def quality(shapes: Shapes, train: Shapes, seed: int) -> dict[str, float]:
    """Table 2: percent rooted, stable and fool, and the Fréchet distance."""
    point_net = load(PointNet, pretrained("point_net"))
    # Both depend on how many shapes are compared: as many real ones as there are generated ones, if there are.
    some = np.random.default_rng(seed).permutation(len(train))[: len(shapes)]
    pair = (shapes, [train[i] for i in some])
    clouds, real = (surface_points_many(each, CLOUD, 2 * seed + i) for i, each in enumerate(pair))
    verdict = percent_fooled(clouds, real, seed)
    return {
        **physics(shapes),
        "fool": verdict.fooled,
        "doubted": verdict.doubted,
        "frechet": frechet_distance(cloud_features(point_net, clouds), cloud_features(point_net, real)),
    }


def physics(shapes: Shapes) -> dict[str, float]:
    """Percent of the shapes that are rooted, and that stand after a push: ours, and the authors'."""
    return {
        "rooted": 100 * float(rooted(shapes).mean()),
        "stable": 100 * float(stable_many(shapes).mean()),
        "stable_authors_trial": 100 * float(stable_many(shapes, trial=AUTHORS_TRIAL).mean()),
    }


def counts(programs: Sequence[Program], shapes: Shapes) -> dict[str, float]:
    """Tables 3 and 5: lines, macros per line, leaf parts."""
    found = program_statistics(programs, shapes)
    return {
        "lines": found.lines,
        **found.macros,
        "macros_per_line": found.macros_per_line,
        "leaves": found.leaves,
    }


def written_row(category: str, method: str, network: ProgramVAE, samples: int, seed: int) -> dict:
    """A row for what a network writes."""
    ablation = method if method in ABLATIONS else None
    real = list(shapeassembly(category, "train"))
    known = real if ablation is None else list(shapeassembly(category, "train", ablation=ablation))
    mode = "skip" if method == "no_reject" else "reject"
    rules = AUTHORS if method == "ours_authors_rules" else Rules()
    fitted = method in FITTED
    codes = CodeDistribution.of(network, known) if fitted else None
    spread = FITTED_SPREAD[category] if fitted else 1.0
    start = time.perf_counter()
    try:
        found = sample(network, samples, seed, mode, rules, spread, codes=codes)
    except RuntimeError as error:  # it gave up
        raise DataError(f"these weights write hardly any program: {error}") from error
    writing = time.perf_counter() - start
    shapes, train = execute_many(found.programs), execute_many(real)
    near = novelty(shapes, train, execute_many(list(shapeassembly(category, "val"))), seed)
    return {
        "rules": {
            "mode": mode,
            "near": rules.near,
            "outside": rules.outside,
            "fitted_codes": fitted,
            "spread": spread,
        },
        "rejected_percent": 100 * found.rejection_rate,
        **quality(shapes, train, seed),
        **counts(found.programs, shapes),
        **vars(near),
        "novel_percent": 100 * novel_share(found.programs, known),
        "seconds_writing": writing,
    }


def ground_truth_row(category: str, samples: int, seed: int) -> dict:
    """The real programs: lines and leaf parts of all of them, physics of a random part."""
    every = list(shapeassembly(category))
    chosen = np.random.default_rng(seed).permutation(len(every))[:samples]
    row = physics(execute_many([every[i] for i in chosen]))
    return {"samples": len(chosen), "programs": len(every), **row, **counts(every, execute_many(every))}


def validation_row(category: str, samples: int, seed: int) -> dict:
    """Validation programs in the place of generated ones: Table 4, and how new their structures are."""
    real, other = list(shapeassembly(category, "train")), list(shapeassembly(category, "val"))[:samples]
    near = novelty(execute_many(other), execute_many(real), None, seed)
    return {"samples": len(other), **vars(near), "novel_percent": 100 * novel_share(other, real)}


def interpolation_row(network: ProgramVAE, samples: int, seed: int) -> dict:
    """Straight ways between random latent codes, Table 6. Lines that break a rule are left out."""
    noise = torch.Generator().manual_seed(seed)
    sequences = []
    for _ in range(min(SEQUENCES, samples)):
        start, end = torch.randn(2, network.config.hidden, generator=noise)
        codes = torch.lerp(start, end, torch.linspace(0, 1, STEPS + 1)[:, None])
        sequences.append(write(network, codes, "skip").accepted)
    whole = [sequence for sequence in sequences if len(sequence) > 1]
    if not whole:
        raise DataError("these weights write hardly any program; expected a trained network")
    step, steps = step_size(whole, seed), sum(map(len, whole)) - len(whole)
    return {
        "samples": len(whole),
        "steps": steps,
        "geometric_step": step.geometric,
        "program_step": step.program,
    }


def measure(category: str, method: str, weights: Path, samples: int, seed: int) -> dict:
    """One row, with all that is needed to measure it again."""
    start = time.perf_counter()
    header = {"category": category, "method": method, "data": shapeassembly(category).source, "seed": seed}
    if method == "ground_truth":
        row = ground_truth_row(category, samples, seed)
    elif method == "validation":
        row = validation_row(category, samples, seed)
    else:
        network = load(ProgramVAE, weights)
        header["weights"] = sha256(weights.read_bytes()).hexdigest()[:12]
        if method == "interpolation":
            row = interpolation_row(network, samples, seed)
        else:
            row = written_row(category, method, network, samples, seed)
    seconds = {"seconds": round(time.perf_counter() - start, 1)}
    return {**header, "samples": samples, **version(*DECIDING), **_rounded(row), **seconds}


def _rounded(row: dict) -> dict:
    return {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns the exit code: 0 finished, 1 nothing could be measured, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("category", choices=CATEGORIES)
    parser.add_argument("--method", choices=METHODS, default="ours")
    parser.add_argument("--weights", type=Path, help="default: pretrained/program_vae_CATEGORY.safetensors")
    parser.add_argument("--samples", type=int, default=1_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} samples")
    parser.add_argument("--out", type=Path, help="default: results/program_vae/CATEGORY_METHOD.json")
    options = parser.parse_args(arguments)
    out = options.out or FOLDER / f"{options.category}_{options.method}.json"

    def work() -> None:
        check_writable(out)
        if options.method in ABLATIONS and not options.weights:
            raise DataError(f"--method {options.method} needs --weights: they are not committed")
        samples = QUICK if options.quick else options.samples
        if samples < LEAST:
            raise DataError(f"--samples is {samples}; expected at least {LEAST}")
        check_seed(options.seed)
        try:
            weights = options.weights or pretrained(f"program_vae_{options.category}")
            row = measure(options.category, options.method, weights, samples, options.seed)
        except CheckpointError as error:
            raise DataError(str(error)) from error
        print("\n".join(f"{name:22s} {value}" for name, value in row.items()))
        write_whole(out, (json.dumps(row, indent=1) + "\n").encode())
        print(f"kept in {out}")

    return exit_code(work, INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
