"""The two-armed toy obeys its formulas; figures and tables of notebook 10 show what they are given."""

import io
import json

import matplotlib.pyplot as plt
import pytest
import torch
from PIL import Image

from lib.interpreters.csg import execute_many, parse
from lib.training.bandit import estimate, exact_gradient, learn, pull, spread
from lib.viewing.csgnet_curves import TAUGHT, long_runs
from lib.viewing.csgnet_results import SECOND
from lib.viewing.reinforce_figures import (
    answers_figure,
    estimate_figure,
    film,
    long_runs_figure,
    power_figure,
    runs_figure,
    spread_figure,
    tuning_figure,
)
from lib.viewing.silhouette_table import PAPER, table_3

REWARDS = (0.3, 1.7)
THETA = torch.linspace(-3, 3, 13, dtype=torch.float64)
ARMS = torch.ones(13, dtype=torch.long)
DISCS = execute_many([parse(f"c({x},32,8)") for x in (16, 24, 32)]).images


def noise(seed=0):
    return torch.Generator().manual_seed(seed)


def test_the_slope_is_that_of_the_mean_reward():
    theta = THETA.clone().requires_grad_()
    p = theta.sigmoid()
    (p * REWARDS[1] + (1 - p) * REWARDS[0]).sum().backward()
    assert torch.allclose(theta.grad, exact_gradient(THETA, REWARDS))


@pytest.mark.parametrize("baseline", [0.0, 0.9, -3.0])
def test_the_mean_of_the_estimates_is_the_slope_and_their_spread_is_known(baseline):
    p = THETA.sigmoid()
    up, down = (estimate(THETA, arms, REWARDS, baseline) for arms in (ARMS, 0 * ARMS))
    mean = p * up + (1 - p) * down
    assert torch.allclose(mean, exact_gradient(THETA, REWARDS))
    variance = p * (up - mean) ** 2 + (1 - p) * (down - mean) ** 2
    assert torch.allclose(variance.sqrt(), spread(THETA, REWARDS, baseline))


def test_an_estimate_follows_the_log_probability():
    theta = THETA.clone().requires_grad_()
    (1.7 * theta.sigmoid().log()).sum().backward()
    assert torch.allclose(theta.grad, estimate(THETA, ARMS, REWARDS))


def test_arms_are_pulled_by_their_probability():
    theta = torch.full((20_000,), 1.0, dtype=torch.float64)
    share = pull(theta, noise()).double().mean().item()
    assert share == pytest.approx(0.731, abs=0.016)  # five standard errors
    assert torch.equal(pull(theta, noise(3)), pull(theta, noise(3)))


def test_a_baseline_keeps_learners_from_the_worse_arm():
    runs = {kind: learn((0.8, 1.0), 200, 1.0, 100, noise(), kind) for kind in ("none", "running")}
    assert runs["none"].shape == (100, 201) and (runs["none"][:, 0] == 0.5).all()
    assert (runs["running"][:, -1] > 0.9).all() and (runs["none"][:, -1] < 0.5).any()
    with pytest.raises(ValueError, match="'best'; expected one of none, running"):
        learn(REWARDS, 1, 1.0, 1, noise(), "best")


def test_curves_show_their_numbers():
    (ax, other) = runs_figure({"a": torch.rand(5, 4), "b": torch.rand(5, 4)}, "p").axes
    assert len(ax.lines) == 6 and ax.get_title() == "a" and other.get_title() == "b"
    (ax,) = estimate_figure(torch.tensor([[1.0, 3.0], [2.0, 2.0]]), 2.0).axes
    assert [line.get_ydata().tolist() for line in ax.lines[:2]] == [[1.0, 2.0], [2.0, 2.0]]
    figure = spread_figure({"few": torch.tensor([1.0, 3.0]), "more": torch.zeros(9)}, 1.0, "x")
    assert figure.axes[0].get_title(loc="left") == "few: mean 2.000, standard deviation 1.414"
    left, right = power_figure((1, 20)).axes
    assert left.lines[1].get_ydata()[0] == 1
    assert right.lines[0].get_ydata() == pytest.approx(
        1 / (64 * 2**0.5), rel=1e-4
    )  # float32, of numbers near 1
    figure = tuning_figure([0.1] * 20, {0: {"val_cd": 7.0}, 20: {"val_cd": 3.0}})
    assert figure.axes[0].lines[1].get_ydata() == pytest.approx(0.1)
    assert figure.axes[1].lines[0].get_ydata().tolist() == [7.0, 3.0]
    tuning_figure([0.1], {0: {"val_cd": 7.0}}).canvas.draw()  # a single step
    rows = [{"epoch": k, "val_reward": 0.1 * k, "val_cd": 5.0 - k} for k in (1, 2)]
    left, right = long_runs_figure([{"name": "supervised start", "log": rows}]).axes
    assert right.lines[0].get_ydata().tolist() == [4.0, 3.0] and right.get_legend() is not None
    assert not plt.get_fignums()


def test_answers_are_laid_over_their_targets():
    (ax,) = answers_figure(
        DISCS, {"one": DISCS, "two": DISCS.roll(1, 0)}, {"one": [0, 0, 0], "two": [1, 2, 3]}
    ).axes
    assert len(ax.images) == 6
    colors = [len({tuple(c) for c in image.get_array().reshape(-1, 3).tolist()}) for image in ax.images]
    assert colors == [2, 2, 2, 3, 4, 4]  # the first two discs do not meet
    texts = [text.get_text() for text in ax.texts]
    assert {"one", "two", "0.0", "3.0", "both", "only in the target"} <= set(texts)


def test_a_film_has_a_frame_for_each_moment():
    data = film(DISCS, [DISCS.roll(k, 0) for k in range(3)], ["a", "b", "c"])
    picture = Image.open(io.BytesIO(data))
    assert picture.format == "PNG" and picture.n_frames == 3 and picture.info["loop"] == 0
    assert len(data) < 50_000
    for moments, captions in (([], []), ([DISCS], ["a", "b"])):
        with pytest.raises(ValueError, match="captions; expected one each"):
            film(DISCS, moments, captions)


def test_saved_results_are_shown_or_missed(tmp_path):
    assert long_runs(folder=tmp_path) is None and "measure_csgnet silhouettes" in table_3(tmp_path)
    runs = [{"name": "from scratch", "log": [{"epoch": 1, "val_reward": 0.5, "val_cd": 2.0}]}]
    (tmp_path / "reinforce_curves.json").write_text(json.dumps({"runs": runs}))
    assert long_runs(folder=tmp_path) == runs and long_runs(TAUGHT, tmp_path) is None
    ours = {n: 2.5 for n in ("0", "1", "2", "4", "10", "None")}
    found = {"samples": 16, "data": "embedded", "rows": {name: {"chamfer_px": ours} for name in PAPER}}
    (tmp_path / "silhouettes.json").write_text(json.dumps(found))
    lines = table_3(tmp_path).splitlines()
    assert len(lines) == 2 + 2 * len(PAPER) and len({len(line) for line in lines[1:]}) == 1
    assert lines[-1].split() == ["paper", "1.14", "0.50", "0.44", "0.42", "0.42", "0.41"]
    (tmp_path / SECOND).mkdir()
    (tmp_path / SECOND / "silhouettes.json").write_text(json.dumps(found).replace("2.5", "2.75"))
    lines = table_3(tmp_path).splitlines()
    assert len(lines) == 2 + 3 * len(PAPER) - 1  # remembering has no seed
    assert lines[-2].split() == ["seed", "1", *["2.75"] * 6] and lines[-3].split()[-1] == "2.50"
    (tmp_path / SECOND / "silhouettes.json").unlink()
    powell = {"same_as_powell_px": ours, "powell_px": ours, "seconds_each": 0.1, "powell_seconds_each": 2.0}
    found["rows"]["reinforced k=10"] |= powell
    (tmp_path / "silhouettes.json").write_text(json.dumps(found | {"powell_samples": 9}))
    lines = table_3(tmp_path).splitlines()
    assert lines[-3] == "reinforced k=10, 9 of these:" and "2 s each" in lines[-1]
