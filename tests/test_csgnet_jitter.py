"""Pictures that are moved and stretched a little; the table of what that brings."""

import json

import pytest
import torch

from lib.interpreters.csg import execute_many, parse
from lib.training.csgnet_jitter import jittered
from lib.viewing.jitter_table import FURNITURE, RANDOM, WITHOUT, jitter_table


def noise(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def squares(count: int) -> torch.Tensor:
    return execute_many([parse("s(24,40,20)")]).images.repeat(count, 1, 1)


def test_a_share_is_changed_and_the_rest_is_not():
    images = squares(2000)
    for share in (0.0, 0.25, 1.0):
        changed = (jittered(images, share, noise()) != images).any((1, 2)).double().mean().item()
        assert changed == pytest.approx(share, abs=0.04)


def test_what_is_changed_is_moved_and_stretched_by_so_much():
    found = jittered(squares(2000), 1.0, noise())
    for side, (first, last) in ((1, (25, 54)), (2, (9, 38))):  # rows y, columns x
        on = found.any(3 - side)
        low, high = on.byte().argmax(1), 63 - on.flip(1).byte().argmax(1)
        # By up to 3 pixels, and as it is stretched about the middle of the canvas, an edge by less than 1 more.
        assert {int((low - first).abs().max()), int((high - last).abs().max())} == {3, 4}
        moved = (low + high).double() / 2 - (first + last) / 2
        assert abs(moved.mean()) < 0.2 and moved.std() == pytest.approx(3 / 3**0.5, abs=0.1)
        assert set((high - low + 1).tolist()) == {29, 30, 31}
    assert torch.equal(found, found & found.any(1, keepdim=True) & found.any(2, keepdim=True))


def test_directions_have_amounts_of_their_own():
    found = jittered(squares(500), 1.0, noise())
    down, right = (found.any(3 - side).byte().argmax(1).double() for side in (1, 2))
    assert abs(torch.corrcoef(torch.stack([down, right]))[0, 1]) < 0.2


def test_a_seed_decides():
    images = squares(20)
    first, again, other = (jittered(images, 0.5, noise(seed)) for seed in (1, 1, 2))
    assert torch.equal(first, again) and not torch.equal(first, other)
    assert jittered(images[:0], 0.5, noise()).shape == (0, 64, 64)


def test_edges_repeat():
    everything = torch.ones(50, 64, 64, dtype=torch.bool)
    assert jittered(everything, 1.0, noise()).all()


def test_the_table_has_a_line_for_each_network(tmp_path):
    for number, place in enumerate((WITHOUT, f"{WITHOUT}/seed_1", "", "seed_1")):
        folder = tmp_path / place
        folder.mkdir(parents=True, exist_ok=True)
        random = {name: {"chamfer_px": number + k / 10} for k, name in enumerate(RANDOM)}
        furniture = {name: {"chamfer_px": {"0": 10.0 * number + k}} for k, name in enumerate(FURNITURE)}
        (folder / "synthetic_2d.json").write_text(json.dumps({"rows": random}))
        (folder / "silhouettes.json").write_text(json.dumps({"rows": furniture}))
    lines = jitter_table(tmp_path).splitlines()
    assert [line.split()[-5:] for line in lines[2:]] == [
        [f"{n:.2f}", f"{n + 0.1:.2f}", f"{n + 0.2:.2f}", f"{10 * n:.2f}", f"{10 * n + 1:.2f}"]
        for n in range(4)
    ]
    assert lines[3].startswith("without, seed 1") and lines[4].startswith("with jitter, seed 0")
    (tmp_path / "seed_1" / "silhouettes.json").unlink()
    with pytest.raises(ValueError, match="seed_1/silhouettes.json"):
        jitter_table(tmp_path)
