"""Measure CSG-Stump Net and its rivals on the same test clouds: python -m data_scripts.measure_stump_net

Make the clouds first (data_scripts.make_solids); without them the embedded ones are measured, and the result says so.
Writes results/stump_net/reconstruction.json, one row for each network:

    chamfer_mean  L2 Chamfer distance x 1000 between 2,048 points on the answer and the cloud's: the mean of the two
    chamfer_sum   directions, as CSG-Stump Net's program prints it, and their sum, as UCSG-Net's does
    iou           percent of the test points in both among those in either; half of them are inside, half of all near
                  the surface, so that it is not the IoU of the volumes
    f_score       percent, for points as near as points of the cloud are to one another
    primitives, nodes    that a decided answer uses, means; "needed": those for 99 % of the test points in it
    seconds              from the cloud to its surface, one thread
    empty                share of the answers without a surface; these count as a single point in the middle
    median_chamfer_mean  the median over the clouds, where all else are means; by_category: over those of each category

Networks see as many points of a cloud as in their training; the search sees all 2,048, and their normals.

NAMES are pretrained networks, or files of weights. Beside these there are a row for the clouds' bounding boxes, and the
search without a network (lib.finding) on --searched of the clouds, with the same networks on these. Six networks on 400
clouds take five minutes on one core; --quick takes 16 clouds and searches in 2.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path

import torch
import trimesh
from torch import Tensor, nn
from tqdm import tqdm

from data_scripts.ending import exit_code
from data_scripts.journal import write_whole
from data_scripts.measuring import INTERRUPTED, check_writable, rounded, version
from lib.datasets import REPOSITORY, DataError
from lib.datasets.solid_clouds import SolidSet, solid_clouds
from lib.finding import CloudError, PointCloud, SearchError, find_stump
from lib.interpreters.stump import Box, layers
from lib.metrics.fscore import cloud_f_score, spacing
from lib.metrics.points import squared_chamfer_distance
from lib.models.pretrained import pretrained
from lib.models.reconstructing import decided, surface
from lib.models.simplifying import simplified
from lib.models.soft_stump import SoftStump
from lib.models.stump_net import StumpNet
from lib.models.ucsg import UCSG, SoftTree
from lib.models.weights import CheckpointError, load
from lib.training.csgnet_command import spread
from lib.training.solids import iou

FOLDER = REPOSITORY / "results" / "stump_net"
NAMES = ("stump_net_64", "stump_net_32", "stump_net_64_boxes", "volumetric_primitives", "superquadrics")
OWN = ("bounding_box", "search")  # rows without a network
POINTS = 2048  # on each surface
SECONDS = 5.0  # that the search may think about the matrices of a cloud
QUICK = {"count": 16, "searched": 2}
DECIDING = ("interpreters", "models", "metrics", "finding", "datasets")

Answer = tuple[
    Callable[[Tensor], Tensor], Callable[[], dict[str, float]]
]  # the signed field, and what is used


def of_network(network: nn.Module, clouds: SolidSet, number: int) -> Answer:
    """What a network says of a cloud, decided."""
    said = network(clouds.points[number].float().unsqueeze(0))
    if isinstance(said, SoftTree):
        return decided(said), lambda: {"primitives": float(said.used().sum())}

    def used() -> dict[str, float]:
        needed = simplified(said, clouds.queries[number].float().unsqueeze(0))
        return counts("", said) | counts("needed_", needed)

    return decided(said), used


def counts(prefix: str, said: SoftStump) -> dict[str, float]:
    """Primitives and nodes that the decided answer to one cloud uses."""
    primitives, nodes = said.used()
    return {f"{prefix}primitives": float(primitives.sum()), f"{prefix}nodes": float(nodes.sum())}


def of_box(clouds: SolidSet, number: int) -> Answer:
    """The cloud's bounding box."""
    low, high = clouds.points[number].float().aminmax(dim=0)
    box = Box((high - low) / 2, (low + high) / 2)
    return box.distance, lambda: {"primitives": 1.0, "nodes": 1.0}


def of_search(clouds: SolidSet, number: int) -> Answer:
    """What the search finds; nothing where it gives up."""
    try:
        cloud = PointCloud(clouds.points[number].double().numpy(), clouds.normals[number].double().numpy())
        stump = find_stump(cloud, seconds=SECONDS).stump.to(torch.float32)
    except (CloudError, SearchError):
        return lambda points: torch.ones(len(points)), lambda: {"primitives": 0.0, "nodes": 0.0}
    used = {"primitives": float(len(stump.primitives)), "nodes": float(len(stump.union))}
    return lambda points: layers.signed(stump.distances(points), *stump.matrices), lambda: used


@torch.no_grad()
def figures(answer: Callable[[SolidSet, int], Answer], clouds: SolidSet, number: int) -> dict[str, float]:
    """One answer, measured."""
    target, start = clouds.points[number].float(), time.perf_counter()
    field, used = answer(clouds, number)
    mesh = surface(field, target)
    seconds = time.perf_counter() - start
    queries = clouds.queries[number].float()
    found, inside = field(queries) <= 0, clouds.inside.bool()
    points = on_surface(mesh, number)
    chamfer = 1000 * float(squared_chamfer_distance(points, target[:POINTS]))
    return {
        "chamfer_mean": chamfer,
        "chamfer_sum": 2 * chamfer,
        "iou": 100 * float(iou(found[None], inside)),
        "f_score": cloud_f_score(points, target[:POINTS], spacing(target[:POINTS])),
        **used(),
        "seconds": seconds,
        "empty": float(mesh.is_empty),
    }


def on_surface(mesh: trimesh.Trimesh, seed: int) -> Tensor:
    """Points of a surface, uniform by area; of nothing the middle of the cloud, which is the origin."""
    if mesh.is_empty:
        return torch.zeros(1, 3)
    return torch.from_numpy(trimesh.sample.sample_surface(mesh, POINTS, seed=seed)[0]).float()


def row(name: str, answer: Callable[[SolidSet, int], Answer], clouds: SolidSet) -> dict:
    """The means over all clouds, and Chamfer distance and IoU over those of each category."""
    bar = tqdm(range(len(clouds)), desc=name, leave=False, disable=None)
    rows = [figures(answer, clouds, number) for number in bar]
    found = {key: mean([each[key] for each in rows]) for key in rows[0]}
    found["median_chamfer_mean"] = sorted(each["chamfer_mean"] for each in rows)[len(rows) // 2]
    parts = {}
    for number, each in enumerate(rows):
        parts.setdefault(clouds.categories[number], []).append(each)
    found["by_category"] = {
        part: {key: mean([each[key] for each in some]) for key in ("chamfer_mean", "iou")}
        | {"clouds": len(some)}
        for part, some in sorted(parts.items())
    }
    return found


def mean(values: list[float]) -> float:
    return sum(values) / len(values)


def network_of(path: Path) -> nn.Module:
    """A CSG-Stump Net or a UCSG-Net, whichever is there. Raises CheckpointError, which says why, for neither."""
    told = []
    for kind in (StumpNet, UCSG):
        try:
            return load(kind, path)
        except CheckpointError as error:
            told.append(str(error))
    raise CheckpointError("; ".join(dict.fromkeys(told)))


def some(clouds: SolidSet, count: int) -> SolidSet:
    """At most that many of them, evenly. Raises DataError where there are none."""
    if not len(clouds):
        raise DataError(f"{clouds.describe()} There is nothing to measure; expected 1 or more")
    return clouds.rows(spread(len(clouds), count).tolist())


def measure(paths: dict[str, Path], source: str | None, count: int, searched: int) -> dict:
    """All rows."""
    start, clouds = time.perf_counter(), some(solid_clouds(source, "test"), count)
    networks = {name: network_of(path) for name, path in paths.items()}
    answers = {
        name: lambda c, k, network=network: of_network(network, c, k) for name, network in networks.items()
    }
    rows = {name: row(name, answer, clouds) for name, answer in (answers | {"bounding_box": of_box}).items()}
    few = some(clouds, searched)
    on_few = {name: row(name, answer, few) for name, answer in (answers | {"search": of_search}).items()}
    return {
        "data": clouds.describe(),
        "clouds": len(clouds),
        "searched": len(few),
        "weights": {name: sha256(path.read_bytes()).hexdigest()[:12] for name, path in paths.items()},
        **version(*DECIDING),
        "rows": rows,
        "rows_searched": on_few,
        "seconds": time.perf_counter() - start,
        "threads": torch.get_num_threads(),
    }


def main(arguments: list[str] | None = None) -> int:
    """The command. Returns the exit code: 0 finished, 1 nothing could be measured, 130 interrupted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", default=NAMES, help=f"default: {' '.join(NAMES)}")
    parser.add_argument("--source", help="whose solids (default: all that were made)")
    parser.add_argument("--count", type=int, default=400, help="clouds (%(default)s)")
    parser.add_argument(
        "--searched", type=int, default=20, help="clouds that are searched, too (%(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="16 clouds, 2 searched")
    parser.add_argument("--out", type=Path, default=FOLDER / "reconstruction.json", help="%(default)s")
    options = parser.parse_args(arguments)
    if options.quick:
        vars(options).update(QUICK)

    def work() -> None:
        check_writable(options.out)
        if min(options.count, options.searched) < 1:
            raise DataError(
                f"found --count {options.count} --searched {options.searched}; expected at least 1"
            )
        torch.set_num_threads(1)
        try:
            paths = paths_of(options.names)
            found = rounded(measure(paths, options.source, options.count, options.searched))
        except CheckpointError as error:
            raise DataError(str(error)) from error
        print(json.dumps({key: found[key] for key in ("rows", "rows_searched")}, indent=1))
        write_whole(options.out, (json.dumps(found, indent=1) + "\n").encode())
        print(f"kept in {options.out}")

    return exit_code(work, INTERRUPTED)


def paths_of(names: Sequence[str]) -> dict[str, Path]:
    """The weights of each row. Raises DataError for names of which two would be one row."""
    rows = [Path(name).stem for name in names]
    if taken := sorted({row for row in rows if [*rows, *OWN].count(row) > 1}):
        raise DataError(f"found several rows called {taken[0]!r}; expected files of different names")
    return {row: weights_of(name) for row, name in zip(rows, names)}


def weights_of(name: str) -> Path:
    """A file of weights, or a pretrained network. Raises CheckpointError for neither."""
    return Path(name) if name.endswith(".safetensors") else pretrained(name)


if __name__ == "__main__":
    sys.exit(main())
