"""Table 3 of CSGNet's paper, silhouettes, with our own numbers beside it, read from results/csgnet.

print(table_3())     the table of results/csgnet/silhouettes.json, or which command makes it
"""

from pathlib import Path

from lib.viewing.csgnet_results import RESULTS, SECOND, read_rows

TABLE = "silhouettes.json"
NO_TABLE = (
    f"results/csgnet/{TABLE} is not there yet; this measures it: "
    "python -m data_scripts.measure_csgnet silhouettes"
)
SWEEPS = {"0": "i=0", "1": "1", "2": "2", "4": "4", "10": "10", "None": "end"}  # in our file -> heading
PAPER = {  # mean Chamfer distance, px, after so many iterations of refinement: Sharma et al. 2018, Table 3
    "nearest": (1.92, 1.22, 1.13, 1.08, 1.07, 1.07),
    "supervised k=1": (2.30, 1.13, 0.97, 0.91, 0.90, 0.90),
    "supervised k=10": (1.60, 0.71, 0.60, 0.56, 0.55, 0.55),
    "reinforced k=1": (1.26, 0.61, 0.54, 0.52, 0.51, 0.51),
    "reinforced k=10": (1.14, 0.50, 0.44, 0.42, 0.42, 0.41),
}


def table_3(folder: Path = RESULTS) -> str:
    """Mean Chamfer distances to silhouettes, px, by iterations of refinement: ours, with a second seed where that was
    measured, and the paper's below each. Raises ValueError for a damaged file."""
    path = folder / TABLE
    if not path.is_file():
        return NO_TABLE
    found, second = (
        read_rows(each, {"chamfer_px": SWEEPS.keys()}) for each in (path, folder / SECOND / TABLE)
    )
    lines = [f"{found['samples']} silhouettes ({found['data']})", " " * 24 + _cells(SWEEPS.values())]
    for name, printed in PAPER.items():
        if name in found["rows"]:
            ours = found["rows"][name]["chamfer_px"]
            lines.append(f"{name:16s}{'ours':8s}{_cells(f'{ours[n]:.2f}' for n in SWEEPS)}")
            if name in second["rows"] and name != "nearest":
                ours = second["rows"][name]["chamfer_px"]
                lines.append(f"{'':16s}{'seed 1':8s}{_cells(f'{ours[n]:.2f}' for n in SWEEPS)}")
            lines.append(f"{'':16s}{'paper':8s}{_cells(f'{value:.2f}' for value in printed)}")
    return "\n".join([*lines, *_powell_lines(found)])


def _powell_lines(found: dict) -> list[str]:
    """Powell's method and ours on the same silhouettes, from the best network's answers, where that was measured."""
    row = found["rows"].get("reinforced k=10", {})
    if "powell_px" not in row:
        return []
    lines = [f"reinforced k=10, {found['powell_samples']} of these:"]
    for name, key, seconds in (
        ("our sweeps", "same_as_powell_px", "seconds_each"),
        ("Powell's method", "powell_px", "powell_seconds_each"),
    ):
        cells = _cells(f"{row[key][n]:.2f}" for n in SWEEPS)
        lines.append(f"  {name:22s}{cells}   {row[seconds]:.2g} s each, to the end")
    return lines


def _cells(texts) -> str:
    return "".join(f"{text:>7s}" for text in texts)
