"""What longer runs measured, as text: tables of results/*.json, or how to make them where they are missing."""

import json
from pathlib import Path

RESULTS = Path(__file__).parents[2] / "results"
COMMAND = "python -m data_scripts.measure_extraction"


def saved_table(name: str, folder: Path = RESULTS) -> str:
    """The numbers of results/NAME.json, a line for each row of numbers; or, without that file, what measures them.

    Rows are the innermost mappings of a JSON object whose values are numbers or words; the keys around them are their
    names.
    """
    path = folder / f"{name}.json"
    if not path.is_file():
        return f"results/{name}.json is not there yet; this measures it: {COMMAND}"
    return "\n".join(_lines(json.loads(path.read_text(encoding="utf-8")), ()))


def _lines(value: dict, names: tuple[str, ...]) -> list[str]:
    plain = {key: item for key, item in value.items() if not isinstance(item, dict | list)}
    lines = (
        [f"{', '.join(names) or 'all'}: " + ", ".join(f"{k} {_shown(v)}" for k, v in plain.items())]
        if plain
        else []
    )
    for key, item in value.items():
        if isinstance(item, dict) and item:
            lines += _lines(item, (*names, key))
    return lines


def _shown(value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
