"""What each choice of CSG-Stump Net's training is worth, as results/stump_net/ablation.json has it.

choices_table()    a row for each choice: IoU soft and decided, what deciding loses, weights
choices_figure()   the same as dots, one for each seed
"""

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from lib.viewing.measured_rows import measured_rows
from lib.viewing.stump_solids import COLORS

RESULT = Path(__file__).parents[2] / "results" / "stump_net" / "ablation.json"
COMMAND = "python -m data_scripts.ablate_stump_net"
FIGURES = {"runs", "soft", "decided", "lost", "weights"}


def choices(path: Path = RESULT) -> dict[str, dict]:
    """The measured rows by choice; see `measured_rows` for what is raised."""
    return measured_rows(path, "rows", FIGURES, COMMAND)


def choices_table(path: Path = RESULT) -> str:
    """The rows as lines of text: percent, means over the seeds; "lost" is in percent of the soft IoU."""
    found = choices(path)
    width = max(map(len, found)) + 2
    headings = ("IoU soft", "decided", "lost", "weights")
    lines = [" " * width + "".join(f"{heading:>12s}" for heading in headings)]
    for name, row in found.items():
        figures = "".join(f"{row[key]:12.1f}" for key in ("soft", "decided", "lost"))
        lines.append(f"{name:{width}s}{figures}{row['weights']:12,}")
    return "\n".join(lines)


def choices_figure(path: Path = RESULT) -> Figure:
    """Dots: decided IoU of each seed (full) and soft IoU (rings), a line for each choice."""
    found = choices(path)
    figure, ax = plt.subplots(figsize=(7.5, 0.32 * len(found) + 0.9), dpi=100)
    plt.close(figure)
    for place, row in enumerate(found.values()):
        for key, style in (("soft_iou", {"mfc": "none", "ms": 9}), ("decided_iou", {"ms": 4.5})):
            values = [run[key] for run in row["runs"]]
            label = f"{key[:-4]}, each seed" if not place else None
            ax.plot(values, [place] * len(values), "o", color=COLORS[0], label=label, **style)
    ax.set_yticks(range(len(found)), list(found))
    ax.invert_yaxis()
    ax.set_xlabel("IoU of the test points, %")
    ax.grid(axis="x", alpha=0.3)
    ax.legend(fontsize=8, loc="lower left")
    ax.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    return figure
