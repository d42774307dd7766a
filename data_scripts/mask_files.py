"""The files that masks are kept in, and what is left out of them:

    SOURCE.npz        masks (n, 512) uint8, 64x64 bits row by row; ids, views, splits, categories, n texts each
    SOURCE.json       how many masks, of what, what was left out and why, licence, credits, and the settings
    SOURCE-VIEW.png   a contact sheet: 96 masks, evenly over the set

How the two tell whether all is there and up to date: see `made_files`.
"""

import io
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import matplotlib.image
import numpy as np

from data_scripts.journal import write_whole
from data_scripts.made_files import code_of, write_made
from lib.datasets.images import BLANK, COLUMNS, FULL, SHARES, SPLITS, ImageSet, fault, in_one_split
from lib.interpreters.rasterising import FILL, SAMPLES, SIZE

SHEET = (8, 12)  # masks down and across
GAP = 4  # pixels between them
ELSEWHERE = "in another split too"


@dataclass(frozen=True)
class Drawn:
    """What became of one shape: its masks by view, or the reason why there are none."""

    id: str
    category: str
    split: str
    masks: dict[str, np.ndarray] = field(default_factory=dict)
    problem: str = ""


def settings(made_of: str, code: Iterable[str]) -> dict:
    """What decides what comes out; `code` are patterns of the repository's files that draw the masks."""
    return {
        "made_of": made_of,
        "size": SIZE,
        "longer_side": FILL,
        "samples": SAMPLES,
        "blank_up_to": BLANK,
        "full_above": FULL,
        "split_shares": list(SHARES),
        "code": code_of(code),
    }


def write(folder: Path, source: str, shapes: Iterable[Drawn], facts: dict) -> dict:
    """Write the .npz and .json of a source; returns what the latter says. `facts` go into it: settings, licence, …"""
    rows, masks, left_out = [], [], {}
    number = 0
    for shape in shapes:
        number += 1
        if shape.problem:
            left_out[shape.id] = shape.problem
        for view, mask in shape.masks.items():
            if reason := fault(mask):
                left_out[f"{shape.id} {view}"] = reason
            else:
                rows.append((shape.id, view, shape.split, shape.category))
                masks.append(np.packbits(mask))
    packed = np.stack(masks) if masks else np.zeros((0, SIZE * SIZE // 8), np.uint8)
    columns = dict(zip(COLUMNS, zip(*rows) if rows else [()] * len(COLUMNS)))
    keep = in_one_split(packed, columns["splits"])
    left_out |= {f"{rows[k][0]} {rows[k][1]}": ELSEWHERE for k in np.flatnonzero(~keep)}
    images = ImageSet(packed, columns, source).rows(np.flatnonzero(keep).tolist())
    counts = _counts(images, left_out)
    report = {"source": source, "shapes": number, **counts, **facts, "left_out": left_out}
    for sheet in folder.glob(f"{source}-*.png"):
        sheet.unlink()  # it shows other masks
    write_made(folder, source, _npz(images), report)
    return report


def _npz(images: ImageSet) -> bytes:
    """The same masks give the same bytes: numpy dates all members of its archives 1980."""
    texts = {name: np.array(getattr(images, name), dtype=np.str_) for name in COLUMNS}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, masks=images.packed, **texts)
    return buffer.getvalue()


def _counts(images: ImageSet, left_out: dict[str, str]) -> dict:
    times = Counter(map(bytes, images.packed))
    splits = {name: images.select(split=name) for name in SPLITS}
    return {
        "masks": len(images),
        "splits": {name: {"shapes": len(set(s.ids)), "masks": len(s)} for name, s in splits.items()},
        "views": dict(sorted(Counter(images.views).items())),
        "categories": dict(sorted(Counter(images.categories).items())),
        "rejected": dict(sorted(Counter(left_out.values()).items())),
        "repeated": len(images) - len(times),  # masks that came before in the same split; they stay
    }


def summary(report: dict) -> str:
    """The report in a few words."""
    splits = ", ".join(f"{count['masks']} {name}" for name, count in report["splits"].items())
    rejected = ", ".join(f"{count} {reason}" for reason, count in report["rejected"].items()) or "none"
    return (
        f"{report['masks']} masks of {report['shapes']} shapes ({splits}); left out: {rejected}; "
        f"{report['repeated']} repeat another of their split"
    )


def write_sheets(folder: Path, images: ImageSet) -> list[Path]:
    """A contact sheet for each view; returns where they are."""
    paths = []
    for view in dict.fromkeys(images.views):
        path = folder / f"{images.source}-{view}.png"
        buffer = io.BytesIO()
        sheet = _sheet(images.select(view=view).images.numpy())
        matplotlib.image.imsave(buffer, sheet, cmap="gray", vmin=0, vmax=2, format="png")
        write_whole(path, buffer.getvalue())
        paths.append(path)
    return paths


def _sheet(masks: np.ndarray) -> np.ndarray:
    """Masks side by side, shapes black (0) on white (2), gaps grey (1)."""
    down, across = SHEET
    pitch = SIZE + GAP
    sheet = np.ones((down * pitch + GAP, across * pitch + GAP))
    chosen = np.linspace(0, len(masks) - 1, min(len(masks), down * across)).round().astype(int)
    for place, number in enumerate(chosen):
        y, x = (GAP + pitch * k for k in divmod(place, across))
        sheet[y : y + SIZE, x : x + SIZE] = np.where(masks[number], 0, 2)
    return sheet
