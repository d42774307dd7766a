"""A readable table of build/bench.json, kept in results/: `python -m tests.bench_report build/bench.json`."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "results" / "shapeassembly_speed.json"


def rounded(number: float) -> float:
    """Three significant digits: more would be noise."""
    return float(f"{number:.3g}")


def rows(bench: dict) -> list[dict]:
    """One row a benchmark: medians, and how many times faster than the authors' interpreter, where that is known."""
    table = []
    for each in bench["benchmarks"]:
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


def main(path: str) -> None:
    """Print the table and write the result file."""
    bench = json.loads(Path(path).read_text(encoding="utf-8"))
    table = rows(bench)
    if not table:
        sys.exit(f"{path} holds no benchmark of tests/bench_shapeassembly.py")
    once = {name: table[0][name] for name in ("data", "torch", "threads")}
    result = {
        "date": bench["datetime"][:10],
        "commit": commit(),
        "cpu": bench["machine_info"].get("cpu", {}).get("brand_raw", "unknown"),
        "cpu_count": os.cpu_count(),
        **once,
        "rows": [{name: value for name, value in row.items() if name not in once} for row in table],
    }
    print(printed(table))
    print(f"{once['data']}, {once['threads']} thread, torch {once['torch']}; authors: on a machine like this")
    RESULT.parent.mkdir(exist_ok=True)
    RESULT.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(f"kept in {RESULT.relative_to(ROOT)}")


if __name__ == "__main__":
    main(sys.argv[1])
