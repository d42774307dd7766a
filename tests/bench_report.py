"""A readable table of build/bench.json: `python -m tests.bench_report build/bench.json`.

The rows of tests/bench_NAME.py are kept in results/NAME_speed.json.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results"


def rounded(number: float) -> float:
    """Three significant digits: more would be noise."""
    return float(f"{number:.3g}")


def rows(benchmarks: list[dict]) -> list[dict]:
    """One row a benchmark: medians, and how many times faster than the authors' program, where that is known."""
    table = []
    for each in benchmarks:
        info = each["extra_info"]
        if "what" not in info:
            continue
        seconds = each["stats"]["median"] / info["count"]
        authors = info["authors_seconds_each"]
        row = {
            "what": info["what"],
            "milliseconds": rounded(1000 * seconds),
            "per_second": rounded(1 / seconds),
        }
        if authors:
            row |= {
                "authors_milliseconds": rounded(1000 * authors),
                "times_faster": rounded(authors / seconds),
            }
        if info.get("peak_megabytes"):
            row |= {key: rounded(info[key]) for key in ("peak_megabytes", "authors_megabytes")}
        table.append(row | {"data": info["data"], "torch": info["torch"], "threads": info["threads"]})
    return table


def printed(table: list[dict]) -> str:
    """The table as text."""
    width = max(len(row["what"]) for row in table)
    lines = [f"{'':{width}}  {'ms each':>9}  {'a second':>9}  {'authors ms':>10}  {'faster':>7}"]
    for row in table:
        authors = (
            f"{row['authors_milliseconds']:10g}  {row['times_faster']:6g}x" if "times_faster" in row else ""
        )
        lines.append(
            f"{row['what']:{width}}  {row['milliseconds']:9g}  {row['per_second']:9g}  {authors}".rstrip()
        )
    return "\n".join(lines)


def commit() -> str:
    """The commit that was measured, marked if files differ from it."""
    git = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude=*"]
    found = subprocess.run(git, capture_output=True, text=True)
    return found.stdout.strip() or "unknown"


def by_file(benchmarks: list[dict]) -> dict[str, list[dict]]:
    """The benchmarks of tests/bench_NAME.py under NAME."""
    files: dict[str, list[dict]] = {}
    for each in benchmarks:
        files.setdefault(Path(each["fullname"].split("::")[0]).stem.removeprefix("bench_"), []).append(each)
    return files


def keep(name: str, table: list[dict], bench: dict, measured: str) -> Path:
    """Write results/NAME_speed.json; measured: the commit."""
    once = {key: table[0][key] for key in ("data", "torch", "threads")}
    result = {
        "date": bench["datetime"][:10],
        "commit": measured,
        "cpu": bench["machine_info"].get("cpu", {}).get("brand_raw", "unknown"),
        "cpu_count": os.cpu_count(),
        **once,
        "rows": [{key: value for key, value in row.items() if key not in once} for row in table],
    }
    path = RESULTS / f"{name}_speed.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    return path


def main(path: str) -> None:
    """Print the tables and write the result files."""
    bench = json.loads(Path(path).read_text(encoding="utf-8"))
    tables = {name: rows(found) for name, found in by_file(bench["benchmarks"]).items()}
    tables = {name: table for name, table in tables.items() if table}
    if not tables:
        sys.exit(f"{path} holds no benchmark of tests/bench_*.py")
    measured = commit()  # now: the first file that is written would make it dirty
    for name, table in tables.items():
        print(printed(table))
        first = table[0]
        print(
            f"{first['data']}, {first['threads']} thread, torch {first['torch']}; authors: on a machine like this"
        )
        print(f"kept in {keep(name, table, bench, measured).relative_to(ROOT)}\n")


if __name__ == "__main__":
    main(sys.argv[1])
