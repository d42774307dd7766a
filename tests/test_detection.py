"""Average precision of boxes, and of primitives in programs."""

from fractions import Fraction

import numpy as np
import pytest
import torch

from lib.finding.primitive_detection import KINDS, detection_precision, primitive_boxes
from lib.interpreters.csg import Primitive, Vocabulary, parse, vocabulary_of
from lib.metrics.detection import Boxes, average_precision, box_iou

from .conftest import unchecked
from .csg_programs import mask, random_tokens

PLANE = vocabulary_of(2)
SQUARE, APART, NEAR = (0, 0, 10, 10), (50, 50, 60, 60), (0, 0, 10, 8)  # NEAR overlaps SQUARE by 0.8


def boxes(*rows: tuple, scores: list[float] | None = None) -> Boxes:
    """rows: (picture, corners)"""
    corners = torch.tensor([corners for _, corners in rows], dtype=torch.float32).view(-1, 4)
    numbers = torch.tensor([picture for picture, _ in rows], dtype=torch.long)
    return Boxes(numbers, corners, None if scores is None else torch.tensor(scores, dtype=torch.float32))


def overlap_of(a: list[int], b: list[int]) -> Fraction:
    """By counting the unit squares in both and in either."""
    inside = [{(x, y) for x in range(k[0], k[2]) for y in range(k[1], k[3])} for k in (a, b)]
    return Fraction(len(inside[0] & inside[1]), max(1, len(inside[0] | inside[1])))


def simple_precision(found: list[tuple], true: list[tuple]) -> float:
    """found: (picture, box, score), true: (picture, box); the definition, word for word, on Python's lists."""
    taken, hits = set(), []
    for picture, box, _ in sorted(found, key=lambda each: -each[2]):
        own = [(overlap_of(box, other), -k) for k, (p, other) in enumerate(true) if p == picture]
        overlap, number = max(own, default=(0, 1))
        hits.append(2 * overlap >= 1 and number not in taken)
        taken |= {number} if hits[-1] else set()
    precisions = [Fraction(sum(hits[: k + 1]), k + 1) for k in range(len(hits))]
    return float(sum(max(precisions[k:]) for k, hit in enumerate(hits) if hit) / Fraction(len(true)))


@pytest.mark.parametrize(
    "a, b, expected",
    [
        (SQUARE, SQUARE, 1),
        (SQUARE, APART, 0),
        (SQUARE, (10, 0, 20, 10), 0),  # they touch
        (SQUARE, (5, 0, 15, 10), 1 / 3),
        (SQUARE, (5, 5, 15, 15), 1 / 7),
        (SQUARE, (2, 2, 7, 7), 1 / 4),  # one inside the other
        (SQUARE, (-5, 4, 15, 6), 1 / 6),  # a cross
        ((3, 3, 3, 9), (3, 3, 3, 9), 0),  # both without an area
    ],
)
def test_overlap_of_two_boxes(a, b, expected):
    first, second = (torch.tensor(each, dtype=torch.float32) for each in (a, b))
    assert box_iou(first, second).item() == pytest.approx(expected)
    assert box_iou(second, first) == box_iou(first, second)


def test_overlap_is_that_of_counted_squares():
    corners = np.random.default_rng(0).integers(0, 8, (200, 2, 4))
    corners[..., 2:] += corners[..., :2]
    expected = [float(overlap_of(*pair)) for pair in corners.tolist()]
    found = box_iou(*torch.from_numpy(corners).float().unbind(1))
    assert torch.allclose(found, torch.tensor(expected))


@pytest.mark.parametrize(
    "found, scores, expected",
    [
        ([SQUARE, APART], [0.9, 0.8], 1),  # everything, and nothing else
        ([], [], 0),
        ([SQUARE], [0.9], 1 / 2),  # the other is never found
        ([(20, 20, 30, 30), SQUARE, APART], [0.9, 0.8, 0.7], 2 / 3),  # 0 of 1, 1 of 2, 2 of 3: 2/3 and 2/3
        ([SQUARE, (20, 20, 30, 30), APART], [0.9, 0.8, 0.7], (1 + 2 / 3) / 2),
        ([SQUARE, SQUARE, APART], [0.9, 0.8, 0.7], (1 + 2 / 3) / 2),  # found twice: the second is wrong
        ([SQUARE, NEAR, APART], [0.9, 0.8, 0.7], (1 + 2 / 3) / 2),
        ([NEAR, SQUARE, APART], [0.9, 0.8, 0.7], (1 + 2 / 3) / 2),  # the better box comes too late
        (
            [SQUARE, APART, SQUARE, SQUARE],
            [0.9, 0.8, 0.7, 0.6],
            1,
        ),  # wrong ones after all is found cost nothing
        ([(0, 0, 10, 5)], [1], 1 / 2),  # IoU 0.5 is enough
        ([(0, 0, 10, 4.9)], [1], 0),
    ],
)
def test_two_true_boxes(found, scores, expected):
    true = boxes((0, SQUARE), (0, APART))
    detected = boxes(*((0, corners) for corners in found), scores=scores)
    assert average_precision(detected, true) == pytest.approx(expected)


def test_precision_is_made_falling():
    """Right, wrong, wrong, right, right: precision 1, -, -, 2/4, 3/5; the 2/4 counts as 3/5."""
    true = boxes(*((k, SQUARE) for k in range(3)))
    found = boxes(*((k, SQUARE) for k in (0, 7, 8, 1, 2)), scores=[5, 4, 3, 2, 1])
    assert average_precision(found, true) == pytest.approx((1 + 3 / 5 + 3 / 5) / 3)


def test_the_right_box_in_the_wrong_picture_is_wrong():
    assert average_precision(boxes((1, SQUARE), scores=[1]), boxes((0, SQUARE), (1, APART))) == 0


def test_a_detection_looks_only_at_the_box_it_overlaps_most():
    """As in the benchmark: that one is taken, so the second is wrong, though it overlaps the other enough too."""
    true = boxes((0, SQUARE), (0, (0, 0, 10, 7)))
    found = boxes((0, SQUARE), (0, (0, 0, 10, 9)), scores=[2, 1])
    assert average_precision(found, true) == 1 / 2


def test_equal_scores_keep_their_order():
    true, right, wrong = boxes((0, SQUARE)), (0, SQUARE), (0, APART)
    assert average_precision(boxes(right, wrong, scores=[1, 1]), true) == 1
    assert average_precision(boxes(wrong, right, scores=[1, 1]), true) == 1 / 2


def test_only_the_order_of_scores_counts():
    true = boxes((0, SQUARE), (1, APART))
    found = [(0, APART), (0, SQUARE), (1, APART)]
    results = {
        average_precision(boxes(*found, scores=s), true) for s in ([3, 2, 1], [0.3, 0.2, -7], [1e9, 1, 0])
    }
    assert results == {2 / 3}
    last = boxes(*found[::-1], scores=[1, 2, 3])  # the same, told backwards
    assert average_precision(last, true) == 2 / 3


@pytest.mark.parametrize("seed", range(20))
def test_the_same_as_the_definition_on_lists(seed):
    rng = np.random.default_rng(seed)
    corners = rng.integers(0, 4, (40, 4))
    corners[:, 2:] += corners[:, :2] + 3
    picture, score = rng.integers(0, 4, 40), rng.permutation(40)  # distinct scores
    rows = list(zip(picture.tolist(), corners.tolist(), score.tolist()))
    many = seed + 5
    found = boxes(*((p, c) for p, c, _ in rows[many:]), scores=[float(s) for _, _, s in rows[many:]])
    true = boxes(*((p, c) for p, c, _ in rows[:many]))
    expected = simple_precision(rows[many:], [(p, c) for p, c, _ in rows[:many]])
    assert 0 < expected < 1
    assert average_precision(found, true) == pytest.approx(expected)


def test_a_stricter_overlap_is_never_easier():
    true, found = boxes((0, SQUARE)), boxes((0, NEAR), scores=[1])
    assert [average_precision(found, true, overlap) for overlap in (0.5, 0.79, 0.81)] == [1, 1, 0]


def test_boxes_that_cannot_be_measured_are_named():
    good, empty = boxes((0, SQUARE), scores=[1]), boxes(scores=[])
    with pytest.raises(ValueError, match="found no true boxes"):
        average_precision(good, empty)
    with pytest.raises(ValueError, match="with scores None"):
        average_precision(boxes((0, SQUARE)), good)
    with pytest.raises(ValueError, match="expected a number for each"):
        average_precision(boxes((0, SQUARE), scores=[float("nan")]), good)


@pytest.mark.parametrize("corners, scores", [((2, 4), (1,)), ((1, 3), (1,)), ((1, 4), (2,)), ((4,), (1,))])
def test_boxes_that_are_not_equally_many_are_named(corners, scores):
    with unchecked(), pytest.raises(ValueError, match=r"for 1 boxes; expected \(1, 4\) and \(1,\)"):
        Boxes(torch.zeros(1, dtype=torch.long), torch.zeros(corners), torch.zeros(scores))


def test_boxes_without_four_corners_are_named():
    with unchecked(), pytest.raises(ValueError, match=r"found boxes \(3,\) and \(4,\)"):
        box_iou(torch.zeros(3), torch.zeros(4))


def test_the_box_is_that_of_the_pixels():
    for primitive, box in zip(PLANE.primitives, primitive_boxes(PLANE).tolist()):
        rows, columns = np.nonzero(mask(primitive))
        assert box == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]


def test_boxes_of_known_primitives():
    """A circle's diameter is 2 r - 1; what is off the canvas is not seen."""
    primitives = [Primitive("c", (32, 40, 8)), Primitive("s", (32, 32, 8)), Primitive("c", (0, 63, 5))]
    expected = [[25, 33, 40, 48], [26, 26, 38, 38], [0, 59, 5, 64]]
    assert primitive_boxes(Vocabulary(primitives)).tolist() == expected


def rows_of(*texts: str) -> torch.Tensor:
    return torch.stack([parse(text).tokens(PLANE, 9) for text in texts])


TRUTH = rows_of("c(16,16,8)s(32,32,16)+t(32,32,16)-", "c(48,48,8)t(24,24,16)+s(16,48,8)+")


def test_the_truth_detects_itself():
    result = detection_precision(TRUTH.unsqueeze(1), TRUTH, PLANE)
    assert result == {"circle": 1, "square": 1, "triangle": 1, "mean": 1}


def test_random_truth_detects_itself(unchecked_shapes):
    truth = random_tokens(np.random.default_rng(1), 200, 7, PLANE)
    assert detection_precision(truth.unsqueeze(1).expand(-1, 3, -1), truth, PLANE)["mean"] == 1


def test_operations_and_order_do_not_matter():
    otherwise = rows_of("t(32,32,16)s(32,32,16)c(16,16,8)*-", "t(24,24,16)s(16,48,8)c(48,48,8)-*")
    assert detection_precision(otherwise.unsqueeze(1), TRUTH, PLANE)["mean"] == 1


def test_a_primitive_in_more_programs_comes_first():
    """The wrong circle stands in one program of three, the right ones in two or three: they are taken first."""
    wrong = rows_of("c(16,48,8)", "c(16,16,12)")
    beams = torch.stack([TRUTH, wrong, TRUTH], 1)
    assert detection_precision(beams, TRUTH, PLANE)["circle"] == 1
    most_wrong = torch.stack([TRUTH, wrong, wrong], 1)  # 0 of 1, 0 of 2, then both right ones: 1 of 3, 2 of 4
    result = detection_precision(most_wrong, TRUTH, PLANE)
    assert result["circle"] == pytest.approx(1 / 2)
    assert result["square"] == result["triangle"] == 1
    assert result["mean"] == pytest.approx((1 / 2 + 1 + 1) / 3)


def test_a_program_that_names_a_primitive_twice_detects_it_once():
    twice = rows_of("c(16,16,8)c(16,16,8)+s(32,32,16)+t(32,32,16)-", "c(48,48,8)t(24,24,16)+s(16,48,8)+")
    assert detection_precision(twice.unsqueeze(1), twice, PLANE)["circle"] == 1


def test_what_stands_after_the_end_is_no_detection():
    beams = TRUTH.clone()
    beams[:, -1] = PLANE.index("c(16,48,8)")
    assert detection_precision(beams.unsqueeze(1), TRUTH, PLANE)["circle"] == 1


def test_nothing_detected_is_no_precision():
    stops = torch.full((2, 5, 9), PLANE.stop)
    assert set(detection_precision(stops, TRUTH, PLANE).values()) == {0}


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_that_no_true_program_has_is_named(kind):
    texts = [f"{each}(32,32,16)" for each in KINDS if each != kind]
    truth = rows_of(f"{texts[0]}{texts[1]}+")
    with pytest.raises(ValueError, match=f"found no {KINDS[kind]} in any true program"):
        detection_precision(truth.unsqueeze(1), truth, PLANE)


@pytest.mark.parametrize(
    "beams, truth, message",
    [
        (TRUTH, TRUTH, r"programs \(2, 9\) and true ones"),
        (TRUTH[:, None], TRUTH[:1], r"true ones \(1, 9\)"),
        (TRUTH[:, None, :][:, :0], TRUTH, r"programs \(2, 0, 9\)"),
        (TRUTH[:, None] + 400, TRUTH, "other tokens than 0 to 399"),
        (-TRUTH[:, None], TRUTH, "other tokens than 0 to 399"),
        (TRUTH[:, None].float(), TRUTH, "other tokens than 0 to 399 of torch.int64"),
    ],
)
def test_what_does_not_fit_is_named(beams, truth, message):
    with unchecked(), pytest.raises(ValueError, match=message):
        detection_precision(beams, truth, PLANE)


def test_primitives_of_space_have_no_boxes():
    with pytest.raises(ValueError, match="expected a vocabulary of the plane"):
        primitive_boxes(Vocabulary([Primitive("sp", (32, 32, 32, 8))]))
