"""Fit programs to point clouds from wrong numbers: python -m data_scripts.fit_shapeassembly --count 463

For each program: a cloud of its surface, a start in which every number is off by up to --share, a fit of the
program's numbers and one of free boxes. Prints and keeps distances and rootedness. It can be interrupted: finished
programs are kept line by line, and the same command goes on with the next, to the same result.
"""

import argparse
import json
import sys
import zlib
from pathlib import Path

import torch
from tqdm import tqdm

from lib.datasets import CATEGORIES, REPOSITORY, SPLITS, DataError, shapeassembly
from lib.interpreters.shapeassembly import Program, ProgramError, execute
from lib.metrics.rootedness import is_rooted
from lib.training.fitting import fit_cuboids, fit_program, free_cuboids


def disturbed(program: Program, share: float, seed: int) -> Program:
    """Every number multiplied by its own factor between 1 - share and 1 + share."""
    noise = torch.rand(program.parameter_count, generator=torch.Generator().manual_seed(seed)).double()
    return program.with_parameters(program.parameters() * (1 - share + 2 * share * noise))


def fit_one(program: Program, name: str, share: float, steps: int, points: int) -> dict:
    """Distances (Chamfer, world units) and rootedness of one program's two fits. Raises ProgramError."""
    seed = zlib.crc32(name.encode())
    target = execute(program).surface_points(points, seed)
    start = disturbed(program, share, seed)
    boxes = execute(start).cuboids.detach()
    fit = fit_program(start, target, steps=steps, points=points)
    free = fit_cuboids(boxes, target, steps=steps, points=points)
    return {
        "id": name,
        "start": round(float(fit.losses[0]), 4),
        "program": round(float(fit.losses.min()), 4),
        "free": round(float(free.losses.min()), 4),
        "program_rooted": is_rooted(execute(program, fit.parameters).cuboids),
        "free_rooted": is_rooted(free_cuboids(free.parameters, boxes)),
    }


def fit_all(options: argparse.Namespace) -> list[dict]:
    """Rows of all programs asked for, those that an earlier run left in the file included."""
    programs = shapeassembly(options.category, options.split)[: options.count]
    print(programs.describe())
    settings = {key: getattr(options, key) for key in ("category", "split", "share", "steps", "points")}
    settings["source"] = programs.source
    rows = _read(options.out, settings)
    done = {row["id"] for row in rows}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    part = options.out.with_name(options.out.name + ".part")  # whole lines only, whatever the last run left
    part.write_text("".join(json.dumps(line) + "\n" for line in [settings, *rows]))
    part.replace(options.out)
    with options.out.open("a") as file:
        for name in tqdm([name for name in programs.ids if name not in done], desc="programs"):
            try:
                row = fit_one(
                    programs[programs.ids.index(name)], name, options.share, options.steps, options.points
                )
            except ProgramError as error:
                row = {"id": name, "failed": str(error)}
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    return [row for row in rows if row["id"] in programs.ids]


def _read(path: Path, settings: dict) -> list[dict]:
    """Rows of an earlier run with the same settings; a last line cut short by an interruption is dropped."""
    rows = []
    for line in path.read_text().splitlines() if path.exists() else []:
        try:
            rows.append(json.loads(line))
        except ValueError:
            break
    if rows and rows[0] != settings:
        raise DataError(f"{path} was made with other settings; remove it or choose another --out")
    return rows[1:]


def _summary(rows: list[dict]) -> str:
    good = [row for row in rows if "failed" not in row]
    lines = [f"{len(good)} programs fitted, {len(rows) - len(good)} without a finite result"]
    for who in ("program", "free") if good else ():
        distance = sum(row[who] for row in good) / len(good)
        rooted = sum(row[f"{who}_rooted"] for row in good) / len(good)
        lines.append(f"{who:8s} mean distance {distance:.3f}, rooted {rooted:.1%}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--category", choices=CATEGORIES, default="chair")
    parser.add_argument("--split", choices=SPLITS, default="val")
    parser.add_argument("--count", type=int, default=8, help="how many programs")
    parser.add_argument("--share", type=float, default=0.2, help="how far the start's numbers are off")
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--points", type=int, default=600)
    parser.add_argument(
        "--out", type=Path, help="where to keep the rows (default: build/, named by the settings)"
    )
    options = parser.parse_args(arguments)
    if options.out is None:
        name = (
            f"fit_{options.category}_{options.split}_{options.share}_{options.steps}_{options.points}.jsonl"
        )
        options.out = REPOSITORY / "build" / name
    try:
        print(_summary(fit_all(options)))
        print(f"kept in {options.out}")
    except DataError as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
