"""Tables 2 to 5: with networks that always answer the same, every number in a row is known beforehand."""

import json
import os
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import torch

from data_scripts import measure_csgnet
from lib.datasets import csg_programs, silhouettes
from lib.datasets.csg import TokenSet
from lib.datasets.images import COLUMNS, ImageSet
from lib.interpreters.csg import execute, parse, vocabulary_of
from lib.metrics.images import image_chamfer, iou
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.weights import save
from tests.conftest import unchecked

HEADER = {
    "table",
    "dimensions",
    "weights",
    "date",
    "commit",
    "code",
    "data",
    "samples",
    "rows",
    "seconds",
    "threads",
}
ROW = {"exact_percent", "by_length", "exact_by_length", "seconds_each"}
TEN = (
    "c(32,32,16)", "s(32,32,20)", "t(32,32,20)", "c(16,16,8)", "s(16,48,12)",
    "c(48,16,8)", "s(48,48,16)", "t(24,24,12)", "c(24,40,20)", "t(40,40,16)",
)  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch, tmp_path):
    """Embedded data; few shapes; no shape checks: other tests have them."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "no-data"))
    monkeypatch.setattr(measure_csgnet, "QUICK", 6)
    with unchecked():
        yield


def network(config: CSGNetConfig | None = None) -> CSGNet:
    torch.manual_seed(0)
    config = config or CSGNetConfig(2, 400, (2,), (16,), (16,), (1,), "none", 4, 8, 0.0)
    return CSGNet(config)


SPACE = CSGNetConfig(3, 6635, (2,), (32,), (32,), (1,), "none", 4, 8, 0.0)


def answering(path: Path, texts: tuple[str, ...], config: CSGNetConfig | None = None) -> Path:
    """Weights of a network that does not look: whatever the shape, its likeliest programs are these primitives."""
    blind = network(config)
    vocabulary = vocabulary_of(blind.config.dimensions)
    with torch.no_grad():
        for weight in blind.parameters():
            weight.zero_()
        blind.scores.bias[blind.stop] = 60  # after the first primitive comes the end
        for place, text in enumerate(texts):
            blind.scores.bias[vocabulary.index(text)] = 30 - place
    save(blind, path)
    return path


@pytest.fixture
def weights(tmp_path) -> Path:
    return answering(tmp_path / "weights.safetensors", TEN)


def run(out: Path, *options: object) -> dict:
    """What the command writes."""
    assert measure_csgnet.main([*map(str, options), "--out", str(out)]) == 0
    return json.loads(out.read_text())


def hand_made(monkeypatch, dimensions: int, **splits: list[str]) -> None:
    """Programs in place of the data set's."""
    vocabulary = vocabulary_of(dimensions)

    def programs(asked: int, split: str) -> TokenSet:
        assert asked == dimensions
        longest = max(len(parse(text)) for text in splits[split]) + 1
        tokens = torch.stack([parse(text).tokens(vocabulary, longest) for text in splits[split]])
        return TokenSet(tokens, vocabulary, "made", split)

    monkeypatch.setattr(measure_csgnet, "csg_programs", programs)


def apart(one: str, other: str) -> float:
    return image_chamfer(execute(parse(one)).image, execute(parse(other)).image).item()


# ---- Tables 2 and 4 ----


def test_random_programs_of_the_plane(monkeypatch, weights, tmp_path, capsys):
    test = ["c(32,32,16)", "s(16,48,12)", "c(32,32,16)s(32,32,20)+", "c(48,48,8)t(16,24,16)+"]
    known = ["c(32,32,16)", "c(48,48,8)t(16,24,12)+", "s(16,48,8)"]
    hand_made(monkeypatch, 2, test=test, train=known)
    found = run(tmp_path / "new" / "row.json", "synthetic", "--weights", weights)
    assert set(found) == HEADER | {"known"}
    assert (found["samples"], found["known"], found["data"], found["dimensions"]) == (4, 3, "made", 2)
    assert found["weights"] == sha256(weights.read_bytes()).hexdigest()[:12] and len(found["code"]) == 12
    assert "k=10" in capsys.readouterr().out
    rows = found["rows"]
    assert set(rows) == {"nearest", "k=1", "k=5", "k=10"}
    nearest = {test[0]: known[0], test[1]: known[2], test[2]: known[0], test[3]: known[1]}
    answers = {"nearest": [apart(*pair) for pair in nearest.items()]}
    answers |= {f"k={k}": [min(apart(text, each) for each in TEN[:k]) for text in test] for k in (1, 5, 10)}
    exact = {"nearest": [1, 0, 0, 0], "k=1": [1, 0, 0, 0], "k=5": [1, 1, 0, 0], "k=10": [1, 1, 0, 0]}
    for name, row in rows.items():
        assert set(row) == ROW | {"chamfer_px"} and row["seconds_each"] >= 0
        each, right = (torch.tensor(list(map(float, a[name]))) for a in (answers, exact))
        assert row["chamfer_px"] == pytest.approx(each.mean().item(), abs=1e-4)
        expected = {"1": each[:2].mean().item(), "3": each[2:].mean().item()}
        assert row["by_length"] == pytest.approx(expected, abs=1e-4)
        assert row["exact_percent"] == pytest.approx(100 * right.mean().item())
        assert row["exact_by_length"] == pytest.approx({"1": 100 * right[:2].mean().item(), "3": 0.0})
    assert answers["k=10"][3] < answers["k=1"][3] and answers["k=5"][1] < answers["k=1"][1]  # more are nearer


def test_random_programs_of_space(monkeypatch, tmp_path):
    monkeypatch.setattr(measure_csgnet, "AT_ONCE", 1)
    answers = ("sp(32,32,32,16)", "cu(32,32,32,24)", "sp(16,16,16,8)")
    weights = answering(tmp_path / "3d.safetensors", answers, SPACE)
    test = ["sp(32,32,32,20)", "sp(16,16,16,8)sp(48,48,48,8)+"]
    hand_made(monkeypatch, 3, test=test, train=["sp(32,32,32,20)"])
    found = run(tmp_path / "row.json", "synthetic", "--dimensions", 3, "--weights", weights)
    assert found["dimensions"] == 3 and found["samples"] == 2

    def alike(one: str, other: str) -> float:
        return 100 * iou(execute(parse(one)).grid, execute(parse(other)).grid, dims=3).item()

    first = [alike(text, answers[0]) for text in test]
    assert found["rows"]["k=1"]["by_length"] == pytest.approx({"1": first[0], "3": first[1]}, abs=1e-3)
    assert found["rows"]["k=1"]["iou_percent"] == pytest.approx(sum(first) / 2, abs=1e-3)
    # Of two equal spheres one is half of both together.
    assert found["rows"]["k=5"]["by_length"]["3"] == pytest.approx(50, abs=1e-3)
    assert found["rows"]["nearest"]["exact_by_length"] == {"1": 100, "3": 0}


def test_a_quick_run_on_embedded_programs(tmp_path):
    weights = tmp_path / "untrained.safetensors"
    save(network(), weights)
    found = run(tmp_path / "row.json", "synthetic", "--quick", "--weights", weights)
    assert (found["samples"], found["known"], found["data"]) == (6, 12, "embedded")  # a hundredth of 1,200
    assert set(found["rows"]["k=1"]["by_length"]) == {"3", "5", "7", "9", "11", "13"}  # one of each length
    distance = [found["rows"][f"k={k}"]["chamfer_px"] for k in (1, 5, 10)]
    assert distance[0] >= distance[1] >= distance[2] > 0
    again = run(tmp_path / "again.json", "synthetic", "--quick", "--weights", weights)
    for row in (*found["rows"].values(), *again["rows"].values()):
        del row["seconds_each"]
    assert again["rows"] == found["rows"]


def test_batches_change_nothing(monkeypatch, tmp_path):
    weights = tmp_path / "untrained.safetensors"
    save(network(), weights)
    rows = []
    for at_once in (100, 7):
        monkeypatch.setattr(measure_csgnet, "AT_ONCE", at_once)
        found = run(tmp_path / f"{at_once}.json", "synthetic", "--count", 18, "--weights", weights)
        assert found["samples"] == 18
        rows.append([(row["chamfer_px"], row["by_length"]) for row in found["rows"].values()])
    assert rows[0] == rows[1]


def test_counts_spread_over_all_lengths(monkeypatch, weights, tmp_path):
    """Also counts that do not divide the number of programs, 240, which come in the order of their lengths."""
    lengths = []

    def recorded(shapes, choice):
        lengths.append((shapes.tokens != shapes.vocabulary.stop).sum(1))
        return {}

    monkeypatch.setattr(measure_csgnet, "compared", recorded)
    assert run(tmp_path / "row.json", "synthetic", "--count", 150, "--weights", weights)["samples"] == 150
    assert lengths[0].bincount()[3::2].tolist() == [25] * 6


# ---- Table 3, and logos ----


def pictures(*texts: str) -> ImageSet:
    """Shapes in place of furniture, of which nobody has the programs."""
    bits = [np.packbits(execute(parse(text)).image.numpy()) for text in texts]
    return ImageSet(np.stack(bits), {name: ["x"] * len(texts) for name in COLUMNS}, "hand-made")


OFF_GRID = ("c(30,33,17)", "c(35,31,14)", "c(33,36,18)")  # what c(32,32,16) can be refined to


def test_silhouettes(monkeypatch, weights, tmp_path):
    monkeypatch.setattr(measure_csgnet, "silhouettes", lambda split: pictures(*OFF_GRID))
    monkeypatch.setattr(measure_csgnet, "POWELL", 2)
    reinforced = answering(tmp_path / "reinforced.safetensors", ("t(48,48,8)", *TEN))
    hand_made(monkeypatch, 2, train=["c(32,32,16)t(48,48,8)+", "s(8,8,8)"])
    options = ["--weights", weights, "--reinforced", reinforced]
    found = run(tmp_path / "table.json", "silhouettes", *options)
    assert set(found) == HEADER | {"reinforced", "powell_samples"}
    assert (found["samples"], found["powell_samples"], found["data"]) == (3, 2, "hand-made")
    assert found["reinforced"] == sha256(reinforced.read_bytes()).hexdigest()[:12] != found["weights"]
    rows = found["rows"]
    assert set(rows) == {
        "nearest",
        *(f"{name} k={k}" for name in ("supervised", "reinforced") for k in (1, 10)),
    }

    def mean(answer: str, targets=OFF_GRID) -> float:
        return sum(apart(target, answer) for target in targets) / len(targets)

    started = {
        "nearest": mean("c(32,32,16)t(48,48,8)+"), "supervised k=1": mean("c(32,32,16)"),
        "supervised k=10": sum(min(apart(target, each) for each in TEN) for target in OFF_GRID) / 3,
        "reinforced k=1": mean("t(48,48,8)"),
    }  # fmt: skip
    for name, expected in started.items():
        assert rows[name]["chamfer_px"]["0"] == pytest.approx(expected, abs=1e-4)
    assert rows["reinforced k=10"]["chamfer_px"]["0"] == rows["supervised k=10"]["chamfer_px"]["0"]
    for name, row in rows.items():
        assert row["tokens"] == (3 if name == "nearest" else 1)
        for distances in (row["chamfer_px"], row["same_as_powell_px"], row["powell_px"]):
            assert list(distances) == ["0", "1", "2", "4", "10", "None"]
            assert list(distances.values()) == sorted(distances.values(), reverse=True)
        assert row["powell_px"]["0"] == pytest.approx(row["same_as_powell_px"]["0"], abs=1e-4)
        assert row["seconds_each"] >= 0 and row["powell_seconds_each"] > 0
    # Both methods start at the first two of the three; a circle a few pixels away is found exactly.
    one = rows["supervised k=1"]
    assert one["same_as_powell_px"]["0"] == pytest.approx(mean("c(32,32,16)", OFF_GRID[:2]), abs=1e-4)
    assert one["chamfer_px"]["None"] == 0 and one["powell_px"]["None"] < one["powell_px"]["0"] / 2


def test_silhouettes_that_are_embedded(monkeypatch, weights, tmp_path):
    options = ["--weights", weights, "--reinforced", weights]
    monkeypatch.setattr(measure_csgnet, "QUICK", 2)
    hasty = partial(measure_csgnet.refine_by_powell, iterations=1)
    monkeypatch.setattr(measure_csgnet, "refine_by_powell", hasty)
    found = run(tmp_path / "table.json", "silhouettes", "--quick", *options)
    masks = silhouettes(split="test")
    images = masks.images[[0, len(masks) // 2]]
    expected = sum(image_chamfer(image, execute(parse(TEN[0])).image).item() for image in images) / 2
    assert found["data"] == "embedded" and found["samples"] == found["powell_samples"] == 2
    assert found["rows"]["supervised k=1"]["chamfer_px"]["0"] == pytest.approx(expected, abs=1e-4)


def test_logos(monkeypatch, weights, tmp_path):
    monkeypatch.setattr(measure_csgnet, "logos", lambda: pictures(*OFF_GRID))
    options = ["--weights", weights, "--reinforced", weights]
    found = run(tmp_path / "table.json", "logos", *options)
    assert set(found["rows"]) == {"supervised k=10", "reinforced k=10"} and found["samples"] == 3
    expected = sum(min(apart(target, each) for each in TEN) for target in OFF_GRID) / 3
    for row in found["rows"].values():
        assert row["chamfer_px"]["0"] == pytest.approx(expected, abs=1e-4) and row["chamfer_px"]["None"] == 0


# ---- Table 5 ----


def test_detection(monkeypatch, tmp_path):
    """Ten programs name ten primitives, each with the score 0.1; pictures all have the same three."""
    far = ("s(8,8,8)", *(f"t(48,{y},8)" for y in range(16, 49, 8)), "t(40,40,8)", "t(40,48,8)")
    weights = answering(tmp_path / "weights.safetensors", ("c(16,48,8)", "s(24,24,12)", *far))
    hand_made(monkeypatch, 2, test=["c(16,48,8)s(24,24,12)+t(16,32,16)+"] * 4)
    found = run(tmp_path / "table.json", "detection", "--weights", weights)
    assert set(found) == HEADER and set(found["rows"]) == {"k=10", "k=40"} and found["samples"] == 4
    speed = found["rows"]["k=10"].pop("images_a_second")
    # Circles: all right. Triangles: all wrong. Of the two squares of a picture, with equal scores, the first in the
    # vocabulary counts first; it is the right one: right, wrong, right, wrong, …
    assert vocabulary_of(2).index("s(24,24,12)") < vocabulary_of(2).index("s(8,8,8)")
    squares = 100 * sum(hit / (2 * hit - 1) for hit in range(1, 5)) / 4
    expected = {"circle": 100, "square": squares, "triangle": 0, "mean": (100 + squares) / 3}
    assert speed > 0 and found["rows"]["k=10"] == pytest.approx(expected, abs=1e-3)
    assert 0 <= found["rows"]["k=40"]["mean"] <= 100


def test_a_quick_detection_on_embedded_programs(weights, tmp_path):
    found = run(tmp_path / "table.json", "detection", "--quick", "--weights", weights)
    assert found["samples"] == 6 and set(found["rows"]["k=10"]) == {
        "circle", "square", "triangle", "mean", "images_a_second",
    }  # fmt: skip


# ---- what cannot be measured ----


def refused(capsys, out: Path, *options: object) -> str:
    """One line that says why; nothing is written."""
    before = out.exists()
    assert measure_csgnet.main([*map(str, options), "--out", str(out)]) == 1
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and "kept in" not in told.out and out.exists() == before
    return told.err


@pytest.mark.parametrize(
    "options, told",
    [
        (["synthetic", "--weights", "nowhere.safetensors"], "nowhere.safetensors: cannot be read"),
        (["silhouettes", "--reinforced", "nowhere.safetensors"], "nowhere.safetensors: cannot be read"),
        (["synthetic", "--count", "0"], "--count is 0; expected at least 1"),
        (["detection", "--count", "-4"], "--count is -4; expected at least 1"),
        (["silhouettes", "--dimensions", "3"], "silhouettes is of the plane; expected --dimensions 2"),
        (["detection", "--dimensions", "3"], "detection is of the plane"),
        (["logos", "--dimensions", "3"], "logos is of the plane"),
        (
            ["synthetic", "--dimensions", "3"],
            "found a network of the plane with 400 tokens; expected one of space with 6635",
        ),
        (["logos", "--reinforced", "same"], "python -m data_scripts.make_logos"),
    ],
)
def test_errors_name_what_is_wrong(weights, tmp_path, capsys, options, told):
    given = [str(weights) if each == "same" else each for each in options]
    given += [] if "--weights" in given else ["--weights", weights]
    error = refused(capsys, tmp_path / "table.json", *given)
    assert error.startswith("DataError: ") and told in error


def test_weights_of_something_else_are_told(tmp_path, capsys):
    (tmp_path / "text").write_text("mine")
    assert "no safetensors file" in refused(
        capsys, tmp_path / "o.json", "synthetic", "--weights", tmp_path / "text"
    )
    save(network(SPACE), tmp_path / "space")
    error = refused(capsys, tmp_path / "o.json", "detection", "--weights", tmp_path / "space")
    assert "found a network of space with 6635 tokens; expected one of the plane with 400" in error


def test_weights_that_do_not_come_with_the_project_are_told(monkeypatch, tmp_path, capsys):
    original = measure_csgnet.pretrained
    monkeypatch.setattr(measure_csgnet, "pretrained", lambda name: original(name, tmp_path))
    assert "no weights called 'csgnet_2d'" in refused(capsys, tmp_path / "o.json", "synthetic")
    assert "no weights called 'csgnet_3d'" in refused(
        capsys, tmp_path / "o.json", "synthetic", "--dimensions", 3
    )


def test_a_result_that_cannot_be_written_is_told_before_the_work(monkeypatch, weights, tmp_path, capsys):
    monkeypatch.setattr(measure_csgnet, "measure", None)
    (tmp_path / "folder").mkdir()
    assert "is a folder" in refused(capsys, tmp_path / "folder", "synthetic", "--weights", weights)
    error = refused(capsys, weights / "below.json", "synthetic", "--weights", weights)
    assert "a file cannot be read or written" in error


def test_an_interruption_writes_nothing(monkeypatch, weights, tmp_path, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(measure_csgnet, "beam_search", interrupt)
    out = tmp_path / "table.json"
    assert measure_csgnet.main(["detection", "--quick", "--weights", str(weights), "--out", str(out)]) == 130
    assert not out.exists() and "nothing was written" in capsys.readouterr().err


def test_every_split_is_the_one_it_should_be(monkeypatch, weights, tmp_path):
    """Test programs are measured; neighbours come from those of training."""
    asked = []

    def recorded(dimensions, split):
        asked.append(split)
        return csg_programs(dimensions, split)

    monkeypatch.setattr(measure_csgnet, "csg_programs", recorded)
    run(tmp_path / "one.json", "synthetic", "--quick", "--weights", weights)
    assert sorted(asked) == ["test", "train"]


@pytest.mark.parametrize("table", ["synthetic", "detection"])
def test_a_network_with_another_vocabulary_is_told(tmp_path, capsys, table):
    save(network(CSGNetConfig(2, 10, (2,), (16,), (16,), (1,), "none", 4, 8, 0.0)), tmp_path / "ten")
    error = refused(capsys, tmp_path / "o.json", table, "--weights", tmp_path / "ten")
    assert "found a network of the plane with 10 tokens; expected one of the plane with 400" in error


@pytest.mark.parametrize("table", ["synthetic", "silhouettes", "detection"])
def test_nothing_to_measure_is_told(weights, tmp_path, capsys, monkeypatch, table):
    none = csg_programs(2, "test")[:0]
    monkeypatch.setattr(measure_csgnet, "csg_programs", lambda *_: none)
    monkeypatch.setattr(measure_csgnet, "silhouettes", lambda **_: silhouettes("embedded")[:0])
    options = ["--weights", weights, *(["--reinforced", weights] if table == "silhouettes" else [])]
    error = refused(capsys, tmp_path / "o.json", table, *options)
    assert "There is nothing to measure; expected 1 or more" in error


def test_a_device_is_not_replaced(weights, tmp_path, capsys):
    device = tmp_path / "pipe"
    os.mkfifo(device)
    error = refused(capsys, device, "synthetic", "--weights", weights)
    assert "is a device, or the like; expected the name of a file" in error and device.is_fifo()


def test_behind_a_link_the_file_is_written(weights, tmp_path):
    link, file = tmp_path / "link.json", tmp_path / "file.json"
    link.symlink_to(file)
    assert measure_csgnet.main(["detection", "--quick", "--weights", str(weights), "--out", str(link)]) == 0
    assert link.is_symlink() and json.loads(file.read_text())["table"] == "detection"
