"""ShapeNet as Occupancy Networks' data set has it, for those who own it: folders of one class each.

    FOLDER/train.lst, val.lst, test.lst    names of models, a line each
    FOLDER/NAME/pointcloud.npz             points (n, 3), normals (n, 3)
    FOLDER/NAME/points.npz                 points (m, 3), occupancies: m bools, or their bits, 8 a byte

    clouds = read_occnet("ShapeNet/03001627", split="train")     a SolidSet, as CSG-Stump Net learns from

Each model is moved and scaled as in the authors' program: the middle of its surface points' bounding box to the origin,
its diagonal to 1. (They also turn the axes, x y z to z y -x, which changes nothing for a network that learns so.)
"""

from pathlib import Path

import numpy as np
from tqdm import tqdm

from ..interpreters.checks import whole
from .base import DataError, choose, read_arrays
from .images import SPLITS
from .solid_clouds import SolidSet, gathered
from .solid_sampling import SolidSample

MOST = 1 << 20  # points of a model that can be asked for
FARTHEST = 1e4  # of numbers that are kept in half precision


def read_occnet(
    folder: str | Path, split: str | None = None, points: int = 2048, queries: int = 4096, seed: int = 0
) -> SolidSet:
    """The models of a class: so many surface points of each, and so many points of space, half of them inside.

    split  "train", "val", "test", or None for all
    Where there are fewer points inside, or outside, some come twice. Raises DataError for a folder that is none, for
    another split, no points or an odd number of queries, and for files that are missing, damaged or of another kind.
    """
    asked = [whole(number) for number in (points, queries, seed)]
    if (
        None in asked
        or not 1 <= asked[0] <= MOST
        or not 2 <= asked[1] <= MOST
        or asked[1] % 2
        or asked[2] < 0
    ):
        raise DataError(
            f"found {points!r} points, {queries!r} queries, seed {seed!r}; expected whole numbers, from 1, an even one "
            f"from 2, both to {MOST}, and one from 0"
        )
    points, queries, seed = asked
    folder = Path(folder)
    kind = folder.resolve().name  # of "." too
    rows = []
    for part in choose("split", split, SPLITS):
        names = tqdm(_names(folder / f"{part}.lst"), desc=f"{kind} {part}", leave=False, disable=None)
        rows += [(name, part, kind, _model(folder / name, points, queries, seed)) for name in names]
    if not rows:
        raise DataError(f"{folder}: found no models in its lists; expected some")
    return gathered(rows, f"occnet {kind}")


def _names(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").split()
    except (OSError, ValueError) as error:
        raise DataError(
            f"{path}: cannot be read ({error}); expected the names of models, a line each"
        ) from error


def _model(folder: Path, points: int, queries: int, seed: int) -> SolidSample:
    """One model, moved and scaled."""
    surface = _arrays(folder / "pointcloud.npz", ("points", "normals"))
    space = _arrays(folder / "points.npz", ("points", "occupancies"))
    inside = _bools(folder / "points.npz", space["occupancies"], len(space["points"]))
    low, high = surface["points"].min(0), surface["points"].max(0)
    with np.errstate(over="ignore"):
        middle, diagonal = (low + high) / 2, np.linalg.norm(high - low)
    if not 0 < diagonal < np.inf or inside.all() or not inside.any():
        raise DataError(
            f"{folder}: found no solid; expected points that differ, some inside and some outside"
        )
    far = max(np.abs(space["points"] - middle).max() / diagonal, np.abs(surface["normals"]).max())
    if far > FARTHEST:
        raise DataError(
            f"{folder}: found points of space, or normals, up to {far:.3g}; expected at most {FARTHEST:g} diagonals"
        )
    rng = np.random.default_rng(seed)
    chosen = _some(np.arange(len(surface["points"])), points, rng)
    halves = (
        _some(np.flatnonzero(inside), queries // 2, rng),
        _some(np.flatnonzero(~inside), queries - queries // 2, rng),
    )
    asked = space["points"][np.concatenate(halves)]
    return SolidSample(
        (surface["points"][chosen] - middle) / diagonal,
        surface["normals"][chosen],
        (asked - middle) / diagonal,
    )


def _arrays(path: Path, names: tuple[str, str]) -> dict[str, np.ndarray]:
    try:
        arrays = read_arrays(path, names)
    except KeyError as error:
        raise DataError(f"{path}: {error.args[0]}; expected {' and '.join(names)}") from error
    for name in (name for name in names if name != "occupancies"):
        array = arrays[name]
        if array.ndim != 2 or array.shape[1] != 3 or not len(array) or array.dtype.kind != "f":
            raise DataError(f"{path}: found {name} {array.dtype} {array.shape}; expected numbers (n, 3)")
        arrays[name] = array.astype(np.float64)
        if not np.isfinite(arrays[name]).all():
            raise DataError(f"{path}: found {name} that are not finite; expected numbers")
    if len({len(arrays[name]) for name in names if name != "occupancies"}) > 1:
        raise DataError(f"{path}: found different numbers of {' and '.join(names)}; expected as many")
    return arrays


def _bools(path: Path, given: np.ndarray, count: int) -> np.ndarray:
    """The occupancies, unpacked."""
    packed = given.dtype == np.uint8 and given.shape == (-(-count // 8),)
    found = np.unpackbits(given)[:count] if packed else given
    if found.shape != (count,) or found.dtype.kind not in "buif" or not np.isin(found, (0, 1)).all():
        raise DataError(
            f"{path}: found occupancies {given.dtype} {given.shape}; expected {count}, each 0 or 1, or their bits"
        )
    return found.astype(bool)


def _some(numbers: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    return np.resize(rng.permutation(numbers), count)
