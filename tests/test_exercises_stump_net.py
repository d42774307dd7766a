"""The checkers of notebook 12 are quiet while unanswered, hint at wrong answers, and accept right ones only."""

import pytest
import torch

from lib.exercises.stump_net import TENTH, check_cover, check_low_rank, check_pull, check_reach, check_use
from tests.verdicts import hints

CHECKS = [check_reach, check_low_rank, check_pull, check_use, check_cover]


def cover(inside):
    kept, held = torch.zeros(len(inside), dtype=torch.bool), torch.zeros_like(inside[0])
    while held.sum() < 0.99 * inside.any(0).sum():
        best = (inside & ~held).sum(1).argmax()
        kept[best], held = True, held | inside[best]
    return kept


RIGHT = [
    (check_reach, (0.0242, 0.364)),
    (check_low_rank, lambda p, n, g: (p * g) @ n.T),
    (check_pull, [-0.2, 0.0, 0.3]),
    (check_use, lambda w_i, w_u: ((w_i & w_u).any(1).sum(), w_u.sum())),
    (check_cover, cover),
    (check_low_rank, lambda p, n, g: p.mul_(g) @ n.T),  # changes what it is given
    (check_low_rank, lambda p, n, g: ((p * g) @ n.T).half()),
    (check_low_rank, lambda p, n, g: ((p * g) @ n.T).to_sparse()),
    (check_use, lambda w_i, w_u: [w_i[:, w_u].any(1).float().sum(), w_u.float().sum()]),
]


class Silent(Exception):
    def __str__(self):
        raise RuntimeError("no words")


def fails(error):
    def answer(*given):
        raise error

    return answer


WRONG = [
    (check_reach, (0.364, 0.0242), "sharpness 150, the slope is 0.000"),
    (check_reach, (0.0242,), "two distances"),
    (check_low_rank, lambda p, n, g: p @ n.T, "the numbers are not"),
    (check_low_rank, lambda p, n, g: ((p * g) @ n.T).T, "tensor (4, 2)"),
    (check_low_rank, lambda p, n: p, "failed"),
    (check_pull, [0.1, 0.2], "no point is on the surface"),
    (check_pull, [0.0, 0.2], "point inside"),
    (check_pull, [-0.1, 0.2], "no point is on the surface"),
    (check_use, lambda w_i, w_u: (w_i.any(1).sum(), w_u.sum()), "not united"),
    (check_use, lambda w_i, w_u: 3, "two numbers"),
    (check_cover, lambda inside: torch.ones(len(inside), dtype=torch.bool), "would do"),
    (check_cover, lambda inside: torch.zeros(len(inside), dtype=torch.bool), "hold 0.0%"),
    (check_cover, lambda inside: inside, "bool tensor"),
    (check_cover, lambda inside: cover(inside).byte(), "found uint8 (5,)"),
    (check_cover, lambda inside: cover(inside).to("meta"), "failed"),
    (check_cover, fails(Silent()), "the function failed: Silent"),
    (check_cover, fails(ValueError("two\nlines")), "the function failed: two lines"),
    (check_low_rank, lambda p, n, g: (p.zero_(), torch.zeros(len(p), len(n)))[1], "the numbers are not"),
    (check_low_rank, lambda p, n, g: (g.fill_(1), p @ n.T)[1], "the numbers are not"),
    (check_use, lambda w_i, w_u: (w_i.zero_(), w_u.zero_(), (0, 0))[2], "gave 0, 0"),
    (check_use, lambda w_i, w_u: (w_i[:, w_u].any(1).sum() + 0.4, w_u.sum()), "not united"),
    (check_use, lambda w_i, w_u: "33", "two numbers"),
]


@pytest.mark.parametrize("check, answer", RIGHT)
def test_right_answers(check, answer):
    assert check(answer) == "ok"


@pytest.mark.parametrize("check, answer, says", WRONG)
def test_wrong_answers_get_a_hint(check, answer, says):
    verdict = check(answer)
    assert hints(verdict) and says in verdict


def test_where_the_slope_is_a_tenth():
    x = torch.tensor(TENTH, dtype=torch.float64, requires_grad=True)
    torch.sigmoid(-x).backward()
    assert -x.grad.item() == pytest.approx(0.25 / 10)
