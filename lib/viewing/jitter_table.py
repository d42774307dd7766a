"""What it brings to teach pictures that lie off the grid (training.csgnet_jitter), read from results/csgnet.

print(jitter_table())    mean Chamfer distances, px, of networks taught without and with it; both seeds of each
"""

from pathlib import Path

from lib.viewing.csgnet_results import RESULTS, SECOND, read_rows

WITHOUT = "without_jitter"  # beside the files of the networks that come with the project
NAMES = {WITHOUT: "without", "": "with jitter"}
RANDOM, FURNITURE = ("k=1", "k=5", "k=10"), ("supervised k=1", "supervised k=10")


def jitter_table(folder: Path = RESULTS) -> str:
    """A line for each network that was measured, on pictures of random programs and on silhouettes before refinement.

    Raises ValueError, which names the file, where one is missing or damaged.
    """
    random, furniture = (
        "".join(f"{name.split()[-1]:>8s}" for name in names) for names in (RANDOM, FURNITURE)
    )
    lines = [f"{'':20s}{'random programs':>24s}{'silhouettes':>18s}", f"{'':20s}{random}  {furniture}"]
    for place, name in NAMES.items():
        for number, seed in enumerate(("", SECOND)):
            known = [
                _rows(folder / place / seed / f"{file}.json", names)
                for file, names in (("synthetic_2d", RANDOM), ("silhouettes", FURNITURE))
            ]
            on_random = "".join(f"{known[0][k]['chamfer_px']:8.2f}" for k in RANDOM)
            on_furniture = "".join(f"{known[1][k]['chamfer_px']['0']:8.2f}" for k in FURNITURE)
            lines.append(f"{name + f', seed {number}':20s}{on_random}  {on_furniture}")
    return "\n".join(lines)


def _rows(path: Path, names: tuple[str, ...]) -> dict[str, dict]:
    rows = read_rows(path, {"chamfer_px": set()}, frozenset())["rows"]
    if set(names) - rows.keys():
        raise ValueError(
            f"{path}: found no rows {', '.join(names)}; measure them with data_scripts.measure_csgnet"
        )
    return rows
