"""The table of CSG-Stump Net and its rivals: of networks that always say the same box, the numbers are known before."""

import json
import math
from hashlib import sha256
from pathlib import Path

import pytest
import torch
import trimesh

from data_scripts import measure_stump_net
from lib.datasets.solid_clouds import SolidSet, solid_clouds
from lib.finding import SearchError
from lib.metrics.points import squared_chamfer_distance
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.stump_net import StumpNet, StumpNetConfig
from lib.models.ucsg import UCSG, UCSGConfig
from lib.models.weights import save
from tests.conftest import unchecked

HEADER = {
    *("data", "clouds", "searched", "weights", "date", "commit", "code", "rows", "rows_searched", "seconds"),
    "threads",
}
FIGURES = {"chamfer_mean", "chamfer_sum", "iou", "f_score", "primitives", "seconds", "empty"}
ROW = FIGURES | {"median_chamfer_mean", "by_category"}
BOXES = StumpNetConfig(
    2, 2, ("box",), "own", complement=False, feature=8, widths=(8,), neighbours=3
)  # volumetric primitives
UCSG_TINY = UCSGConfig(each=3, layers=3, nodes=2, feature=8, widths=(8,), neighbours=3)
HALF, PLACE = (
    (0.05, 0.04, 0.06),
    (0.02, 0.0, -0.01),
)  # of the box that is always said: within every cloud's own
EMBEDDED = ["--source", "embedded"]


@pytest.fixture(autouse=True, scope="module")
def quick():
    """A search of half a second; no shape checks: other tests have them."""
    with pytest.MonkeyPatch.context() as patch, unchecked():
        patch.setattr(measure_stump_net, "SECONDS", 0.5)
        yield


def saying(path: Path, unions: tuple[float, float]) -> Path:
    """Weights of a network that does not look: it says two boxes, HALF and one of twice its size, and unites those
    with a positive logit."""
    torch.manual_seed(0)
    network = StumpNet(BOXES)
    with torch.no_grad():
        (head,) = network.primitives
        for layer in (head.numbers, network.to_union):
            layer.weight.zero_()
        numbers = head.numbers.bias.view(2, -1)
        numbers[:] = torch.tensor([1.0, 0, 0, 0, *(math.atanh(2 * x) for x in PLACE), 0, 0, 0])
        for row, scale in enumerate((1, 2)):
            numbers[row, 7:] = torch.tensor([2 * scale * x for x in HALF]).logit() + 1.5
        network.to_union.bias[:] = torch.tensor(unions)
    save(network, path)
    return path


@pytest.fixture(scope="module")
def weights(tmp_path_factory) -> dict[str, Path]:
    """By the name of the row."""
    folder = tmp_path_factory.mktemp("weights")
    torch.manual_seed(0)
    save(UCSG(UCSG_TINY), folder / "trees.safetensors")
    return {
        "small": saying(folder / "small.safetensors", (1.0, -1.0)),
        "nothing": saying(folder / "nothing.safetensors", (-1.0, -1.0)),
        "trees": folder / "trees.safetensors",
    }


def run(out: Path, *options: object) -> dict:
    """What the command writes."""
    assert measure_stump_net.main([*map(str, options), *EMBEDDED, "--out", str(out)]) == 0
    return json.loads(out.read_text())


@pytest.fixture(scope="module")
def found(weights, tmp_path_factory) -> dict:
    """All rows of three clouds, one of them searched."""
    out = tmp_path_factory.mktemp("results") / "new" / "table.json"
    return run(out, *weights.values(), "--count", 3, "--searched", 1)


@pytest.fixture(scope="module")
def clouds() -> SolidSet:
    """The three that are measured: evenly from the first on."""
    test = solid_clouds("embedded", "test")
    return test.rows([k * len(test) // 3 for k in range(3)])


def each_row(found: dict) -> list[tuple[str, dict]]:
    return [*found["rows"].items(), *found["rows_searched"].items()]


def mean(values) -> float:
    values = [float(value) for value in values]
    return sum(values) / len(values)


# ---- the rows ----


def test_all_rows_are_there_with_all_their_figures(found, weights):
    assert set(found) == HEADER
    assert list(found["rows"]) == [*weights, "bounding_box"]
    assert list(found["rows_searched"]) == [*weights, "search"]
    for name, row in each_row(found):
        nodes = {"nodes"} if name != "trees" else set()
        needed = (
            {"needed_primitives", "needed_nodes"} if name not in ("trees", *measure_stump_net.OWN) else set()
        )
        assert set(row) == ROW | nodes | needed


def test_the_result_says_what_was_measured(found, weights):
    assert found["data"].startswith("3 solids as point clouds (3 test), source: embedded")
    assert (found["clouds"], found["searched"], found["threads"]) == (3, 1, 1)
    assert found["weights"] == {
        name: sha256(path.read_bytes()).hexdigest()[:12] for name, path in weights.items()
    }
    assert len(found["code"]) == 12 and found["seconds"] > 0


def test_all_figures_are_finite_and_in_their_range(found):
    for _, row in each_row(found):
        numbers = {key: value for key, value in row.items() if key != "by_category"}
        assert all(math.isfinite(value) and value >= 0 for value in numbers.values())
        assert row["iou"] <= 100 and row["f_score"] <= 100 and row["empty"] <= 1
        assert row["chamfer_sum"] == pytest.approx(2 * row["chamfer_mean"], abs=2e-4)  # four digits are kept
        assert row["chamfer_mean"] > 0


def test_categories_are_those_of_the_clouds_and_their_means_the_whole(found, clouds):
    counts = {name: clouds.categories.count(name) for name in clouds.categories}
    assert len(counts) > 1
    for _, row in found["rows"].items():
        assert {name: part["clouds"] for name, part in row["by_category"].items()} == counts
        for key in ("chamfer_mean", "iou"):
            whole = sum(counts[name] * part[key] for name, part in row["by_category"].items()) / 3
            assert whole == pytest.approx(row[key], abs=2e-4)
    for _, row in found["rows_searched"].items():
        assert row["by_category"] == {
            clouds.categories[0]: {"chamfer_mean": row["chamfer_mean"], "iou": row["iou"], "clouds": 1}
        }


def overlap(inside: torch.Tensor, clouds: SolidSet) -> float:
    """IoU in percent of answers (n, q) and the truth, a mean over the clouds."""
    truth = clouds.inside.bool()
    return mean(100 * (row & truth).sum() / (row | truth).sum() for row in inside)


def test_the_bounding_box_contains_all_that_is_inside(found, clouds):
    row, points, queries = found["rows"]["bounding_box"], clouds.points.float(), clouds.queries.float()
    low, high = points.amin(1, keepdim=True), points.amax(1, keepdim=True)
    inside = ((low <= queries) & (queries <= high)).all(2)
    assert row["iou"] == pytest.approx(overlap(inside, clouds), abs=0.1)  # a point that rounding moves: 0.03
    assert row["iou"] > 49 and (row["primitives"], row["nodes"], row["empty"]) == (1, 1, 0)


def test_the_bounding_box_is_where_the_cloud_is(clouds):
    moved = clouds[:1]
    moved.points += torch.tensor([0.5, -1.0, 2.0], dtype=torch.float16)
    low, high = moved.points[0].float().aminmax(dim=0)
    field, _ = measure_stump_net.of_box(moved, 0)
    least = float((high - low).min()) / 2
    found = field(torch.stack([low, high, (low + high) / 2, high + least]))
    assert found.tolist() == pytest.approx([0, 0, -least, 3**0.5 * least], abs=1e-6)


def test_of_a_network_that_always_says_one_box_the_figures_are_those_of_the_box(found, clouds):
    row, center, half = found["rows"]["small"], torch.tensor(PLACE), torch.tensor(HALF)
    assert (row["primitives"], row["nodes"], row["empty"]) == (1, 1, 0)
    inside = ((clouds.queries.float() - center).abs() <= half).all(2)
    assert 0 < row["iou"] == pytest.approx(overlap(inside, clouds), abs=0.1)  # as above
    box = trimesh.creation.box(2 * half.numpy(), trimesh.transformations.translation_matrix(PLACE))
    # Nearest points on the box itself, and means over many random points: 2,048 of them differ by 2 or 3 percent.
    there = torch.from_numpy(trimesh.sample.sample_surface(box, 20_000, seed=7)[0]).float()
    expected = [1000 * float(squared_chamfer_distance(there, cloud)) for cloud in clouds.points.float()]
    assert row["chamfer_mean"] == pytest.approx(mean(expected), rel=0.05)
    assert row["median_chamfer_mean"] == pytest.approx(sorted(expected)[1], rel=0.05)
    once = found["rows_searched"]["small"]
    assert once["chamfer_mean"] == once["median_chamfer_mean"] == pytest.approx(expected[0], rel=0.05)


def test_an_answer_of_nothing_is_a_point_in_the_middle(found, clouds):
    row = found["rows"]["nothing"]
    assert (row["primitives"], row["nodes"], row["empty"], row["iou"]) == (0, 0, 1, 0)
    squares = clouds.points.float().square().sum(2)
    expected = 1000 * mean((squares.mean(1) + squares.amin(1)) / 2)
    assert row["chamfer_mean"] == pytest.approx(expected, rel=1e-3)


def test_a_tree_uses_some_of_its_primitives(found):
    assert 1 <= found["rows"]["trees"]["primitives"] <= 2 * UCSG_TINY.each


def test_the_search_finds_more_than_the_box(found, clouds):
    row = found["rows_searched"]["search"]
    box = measure_stump_net.figures(measure_stump_net.of_box, clouds, 0)
    assert row["empty"] == 0 and row["primitives"] >= 1 and row["nodes"] >= 1
    assert row["iou"] > box["iou"] and row["chamfer_mean"] < box["chamfer_mean"]


def test_where_the_search_gives_up_there_is_nothing(monkeypatch, clouds):
    def give_up(*_, **__):
        raise SearchError("nothing", "a stump")

    with monkeypatch.context() as patch:
        patch.setattr(measure_stump_net, "find_stump", give_up)
        given_up = measure_stump_net.figures(measure_stump_net.of_search, clouds, 0)
    flat = clouds[:1]
    flat.points[..., 1] = 0  # nothing is inside
    lost = measure_stump_net.figures(measure_stump_net.of_search, flat, 0)
    for found in (given_up, lost):
        assert (found["empty"], found["primitives"], found["nodes"], found["iou"]) == (1, 0, 0, 0)


@pytest.mark.parametrize("points", [24, 40])
def test_a_network_sees_as_many_points_as_in_its_training(clouds, points):
    torch.manual_seed(0)
    network = StumpNet(
        StumpNetConfig(2, 2, ("box",), feature=8, widths=(8,), neighbours=3, points=points)
    ).eval()
    field, _ = measure_stump_net.of_network(network, clouds, 0)
    cut = clouds[:1]
    cut.points[:, points:] = 9.0
    same, _ = measure_stump_net.of_network(network, cut, 0)
    cut.points[:, points - 1] = 0.4
    other, _ = measure_stump_net.of_network(network, cut, 0)
    queries = clouds.queries[0].float()
    assert torch.equal(field(queries), same(queries)) and not torch.equal(field(queries), other(queries))


@pytest.mark.parametrize("count", [1, 2, 7, 20, 35, 400])
def test_as_many_clouds_are_taken_as_are_asked_for(count):
    clouds = solid_clouds("embedded", "test")
    ids = measure_stump_net.some(clouds, count).ids
    assert len(set(ids)) == len(ids) == min(count, len(clouds)) and ids[0] == clouds.ids[0]


def test_quick_takes_few(monkeypatch, weights, tmp_path, capsys):
    assert measure_stump_net.QUICK == {"count": 16, "searched": 2}
    monkeypatch.setattr(measure_stump_net, "QUICK", {"count": 2, "searched": 1})
    monkeypatch.setattr(measure_stump_net, "of_search", measure_stump_net.of_box)  # quicker
    found = run(tmp_path / "table.json", weights["small"], "--quick")
    assert (found["clouds"], found["searched"]) == (2, 1)
    told = capsys.readouterr().out
    assert told.endswith(f"kept in {tmp_path / 'table.json'}\n")
    printed = json.loads(told[: told.rindex("}") + 1])
    assert printed == {key: found[key] for key in ("rows", "rows_searched")}


# ---- what cannot be measured ----


def refused(capsys, out: Path, *options: object) -> str:
    """One line that says why; nothing is written."""
    before = out.exists()
    assert measure_stump_net.main([*map(str, options), *EMBEDDED, "--out", str(out)]) == 1
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and told.out == "" and out.exists() == before
    assert told.err.startswith("DataError: ")
    return told.err


@pytest.mark.parametrize(
    "options, told",
    [
        (["nowhere.safetensors"], "nowhere.safetensors: cannot be read"),
        (["nowhere"], "no weights called 'nowhere'"),
        (["small", "--count", 0], "found --count 0 --searched 20; expected at least 1"),
        (["small", "--searched", -1], "found --count 400 --searched -1; expected at least 1"),
        (["small", "small"], "found several rows called 'small'"),
    ],
)
def test_errors_name_what_is_wrong(weights, tmp_path, capsys, options, told):
    given = [weights.get(each, each) for each in options]
    assert told in refused(capsys, tmp_path / "table.json", *given)
    assert not list(tmp_path.iterdir())


def test_a_source_that_is_none_is_told(weights, tmp_path, capsys):
    out = tmp_path / "table.json"
    assert measure_stump_net.main([str(weights["small"]), "--source", "shapenet", "--out", str(out)]) == 1
    error = capsys.readouterr().err
    assert error.startswith("DataError: unknown source 'shapenet'") and error.count("\n") == 1
    assert not out.exists()


def test_a_row_that_is_there_without_a_network_is_no_name(weights, tmp_path, capsys):
    save(UCSG(UCSG_TINY), tmp_path / "search.safetensors")
    error = refused(capsys, tmp_path / "table.json", tmp_path / "search.safetensors")
    assert "found several rows called 'search'; expected files of different names" in error


def test_weights_of_something_else_are_told(tmp_path, capsys):
    (tmp_path / "text.safetensors").write_text("mine")
    error = refused(capsys, tmp_path / "o.json", tmp_path / "text.safetensors")
    assert error.count("no safetensors file") == 1
    (tmp_path / "folder.safetensors").mkdir()
    error = refused(capsys, tmp_path / "o.json", tmp_path / "folder.safetensors")
    assert error.count("it is a folder") == 1


def test_weights_of_another_network_are_told(tmp_path, capsys):
    other = CSGNet(CSGNetConfig(2, 400, (2,), (16,), (16,), (1,), "none", 4, 8, 0.0))
    save(other, tmp_path / "other.safetensors")
    error = refused(capsys, tmp_path / "o.json", tmp_path / "other.safetensors")
    assert "weights of kind 'CSGNet'; expected 'StumpNet'" in error and "expected 'UCSG'" in error


def test_damaged_weights_of_the_right_network_are_told(tmp_path, capsys):
    network = StumpNet(BOXES)
    with torch.no_grad():
        network.to_union.bias[0] = torch.nan
    save(network, tmp_path / "damaged.safetensors")
    error = refused(capsys, tmp_path / "o.json", tmp_path / "damaged.safetensors")
    assert "found numbers that are not finite in 'to_union.bias'" in error


def test_networks_that_do_not_come_with_the_project_are_told(monkeypatch, tmp_path, capsys):
    """Without names all of NAMES are meant."""
    original = measure_stump_net.pretrained
    monkeypatch.setattr(measure_stump_net, "pretrained", lambda name: original(name, tmp_path))
    error = refused(capsys, tmp_path / "o.json")
    assert f"no weights called '{measure_stump_net.NAMES[0]}'; found none at all" in error


def test_a_result_that_cannot_be_written_is_told_before_the_work(monkeypatch, weights, tmp_path, capsys):
    monkeypatch.setattr(measure_stump_net, "measure", None)
    assert "is a folder; expected the name of a file" in refused(capsys, tmp_path, weights["small"])
    error = refused(capsys, weights["small"] / "below.json", weights["small"])
    assert "a file cannot be read or written" in error


def test_nothing_to_measure_is_told(monkeypatch, weights, tmp_path, capsys):
    monkeypatch.setattr(measure_stump_net, "solid_clouds", lambda *_: solid_clouds("embedded")[:0])
    error = refused(capsys, tmp_path / "o.json", weights["small"])
    assert "There is nothing to measure; expected 1 or more" in error


def test_an_interruption_writes_nothing(monkeypatch, weights, tmp_path, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(measure_stump_net, "surface", interrupt)
    out = tmp_path / "table.json"
    assert measure_stump_net.main([str(weights["small"]), *EMBEDDED, "--out", str(out)]) == 130
    assert not out.exists() and "nothing was written" in capsys.readouterr().err


def test_test_clouds_are_measured(monkeypatch, weights, tmp_path):
    asked = []

    def recorded(source, split):
        asked.append((source, split))
        return solid_clouds(source, split)

    monkeypatch.setattr(measure_stump_net, "solid_clouds", recorded)
    monkeypatch.setattr(measure_stump_net, "of_search", measure_stump_net.of_box)
    run(tmp_path / "table.json", weights["small"], "--count", 1)
    assert asked == [("embedded", "test")]
