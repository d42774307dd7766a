"""How CSGNet's longer trainings went, an epoch a row, read from results/csgnet.

long_runs()          curves of trainings without a teacher, or None where they were not kept
long_runs(TAUGHT)    of trainings with one, whose programs have parts that nobody sees, or have none
"""

from pathlib import Path

from lib.viewing.csgnet_results import RESULTS, read_runs

CURVES, TAUGHT = "reinforce_curves.json", "teaching_curves.json"
NEEDED = {CURVES: {"val_reward", "val_cd"}, TAUGHT: {"val_loss", "val_cd"}}  # what figures show of each epoch
TRAIN = "python -m lib.training csgnet_reinforce"
NO_CURVES = (
    f"results/csgnet/{CURVES} is not there yet; these make such curves, in runs/: "
    f"`{TRAIN}`, and `{TRAIN} --start scratch`"
)


def long_runs(name: str = CURVES, folder: Path = RESULTS) -> list[dict] | None:
    """[{"name": …, "log": one row an epoch}]; None where the file is missing. Raises ValueError for a damaged one."""
    return read_runs(folder / name, NEEDED.get(name, frozenset()))
