"""Tables of what extractions came to: of results/*.json that longer runs wrote, or of numbers just measured.

print(table({"here": {"chair": {"shapes": 40, "accepted_percent": 97.5, …}}}))
print(saved_table("extraction_furniture"))      or, where that file is missing, which command makes it
"""

import json
from collections.abc import Mapping
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "results"
COMMAND = "python -m data_scripts.measure_extraction"
# key of a result -> heading, format
COLUMNS = {
    "shapes": ("shapes", "d"),
    "accepted_percent": ("accepted %", ".1f"),
    "mean_f_score": ("F-score", ".1f"),
    "mean_cloud_f_score": ("of clouds", ".1f"),
    "lines": ("lines", ".1f"),
    "macros_per_line": ("macros/line", ".2f"),
}


def table(results: Mapping[str, Mapping[str, Mapping]]) -> str:
    """{experiment: {category: {quantity: number}}} as lines of text, with the reasons of rejection at the end.

    "reasons" counts rejections by reason. Where a result has the numbers of "original" programs they follow below
    it. A number that is not there is a dash, a quantity that nobody has is no column.
    """
    rows = [row for name, found in results.items() for row in _rows(name, found)]
    columns = [key for key in COLUMNS if any(key in row for _, row in rows)]
    width = 2 + max((len(name) for name, _ in rows), default=0)
    lines = [" " * width + "".join(f"{COLUMNS[key][0]:>12s}" for key in columns) + "  rejected"]
    for name, row in rows:
        cells = "".join(f"{_cell(row.get(key), COLUMNS[key][1]):>12s}" for key in columns)
        reasons = ", ".join(f"{count} {reason}" for reason, count in row.get("reasons", {}).items())
        lines.append(f"{name:{width}s}{cells}  {reasons}".rstrip())
    return "\n".join(lines)


def saved_table(name: str, folder: Path = RESULTS) -> str:
    """The table of results/NAME.json or, without that file, one line that says what measures it."""
    path = folder / f"{name}.json"
    if not path.is_file():
        return f"results/{name}.json is not there yet; this measures it: {COMMAND}"
    return table(json.loads(path.read_text(encoding="utf-8")))


def _rows(experiment: str, found: Mapping[str, Mapping]) -> list[tuple[str, Mapping]]:
    rows = []
    for category, row in found.items():
        rows.append((f"{experiment} {category}", row))
        if "original" in row:
            rows.append(("  the originals", row["original"]))
    return rows


def _cell(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
