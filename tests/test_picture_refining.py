"""Programs as tensors of numbers, and better numbers by coordinate search and by Powell's method."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from lib.finding.picture_numbers import LEAST, MOST, numbered
from lib.finding.picture_powell import refine_by_powell
from lib.finding.picture_refining import refine
from lib.finding.picture_targets import targets_of
from lib.interpreters.csg import Program, ProgramError, execute_many, parse, sample, vocabulary_of
from lib.metrics.images import BLANK_PX, image_chamfer

from .conftest import unchecked
from .csg_programs import random_program

CIRCLE = parse("c(32,32,16)")
LENGTHS = (1, 3, 5, 7, 9, 13)


def images_of(programs: list[Program]) -> torch.Tensor:
    return execute_many(programs, dimensions=2).images


@pytest.fixture(scope="module")
def programs() -> list[Program]:
    """Of all lengths, with any numbers, also those that refinement does not give."""
    rng = np.random.default_rng(1)
    return [random_program(rng, 2, length) for length in LENGTHS for _ in range(8)]


def sampled(seed: int, lengths: list[int]) -> list[Program]:
    """Random programs of the vocabulary, as a network might write them."""
    rng = np.random.default_rng(seed)
    return [sample(rng, length=length) for length in lengths]


@pytest.fixture(scope="module")
def starts() -> list[Program]:
    with unchecked():
        return sampled(2, [5, 7, 3] * 2)


@pytest.fixture(scope="module")
def targets() -> torch.Tensor:
    """Six pictures that have nothing to do with them: larger programs' and the outlines of a table and a chair."""
    table, chair = torch.zeros((2, 64, 64), dtype=torch.bool)
    table[20:26, 6:58] = table[20:56, 10:14] = table[20:56, 50:54] = True
    chair[8:56, 16:21] = chair[32:38, 16:46] = chair[32:56, 42:46] = True
    with unchecked():
        return torch.cat([images_of(sampled(7, [9] * 4)), table[None], chair[None]])


@pytest.fixture(scope="module")
def refined(starts, targets):
    with unchecked():
        return refine(starts, targets)


def displaced(program: Program, rng: np.random.Generator, most: int) -> Program:
    """Every number changed by up to `most` pixels, within the range of refinement."""
    numbers = program.parameters().view(-1, 3)
    moved = numbers + torch.from_numpy(rng.integers(-most, most + 1, tuple(numbers.shape)))
    return program.with_parameters(moved.maximum(LEAST).minimum(MOST).flatten())


# Programs as tensors


def test_programs_go_there_and_back(programs):
    assert numbered(programs).programs() == programs
    assert numbered(programs[:1]).programs() == programs[:1]
    assert numbered([]).programs() == []


def test_pictures_are_those_of_the_executor(programs):
    assert torch.equal(numbered(programs).images(), images_of(programs))
    assert torch.equal(numbered(programs).words(), execute_many(programs).words)


def test_other_numbers_draw_other_pictures(programs):
    rng = np.random.default_rng(3)
    others = [displaced(program, rng, 5) for program in programs]
    now = replace(numbered(programs), numbers=numbered(others).numbers)
    assert now.programs() == others
    assert torch.equal(now.images(), images_of(others))


def test_rows_are_some_of_the_programs(programs):
    some = torch.tensor([5, 0, 5, 40])
    rows = numbered(programs).rows(some)
    assert rows.programs() == [programs[k] for k in some]
    assert torch.equal(rows.images(), images_of(programs)[some])


def test_what_a_place_is_made_of():
    """a b + c d - * of four primitives, and a program of one."""
    c = "c(32,32,16)"
    below = numbered([parse(f"{c}{c}+{c}{c}-*"), parse(c)]).below
    expected = ["1000", "0100", "1100", "0010", "0001", "0011", "1111"]
    assert ["".join(str(int(k)) for k in row) for row in below[0]] == expected
    assert below[1].nonzero().tolist() == [[0, 0]]  # and nothing where it has ended


def test_limits():
    numbers = torch.tensor([[-3, 70, 2], [8, 56, 32], [7, 57, 33], [30, 31, 64]]).view(1, 4, 1, 3)
    found = numbered([CIRCLE]).limited(numbers)
    assert found.flatten(0, 2).tolist() == [[8, 56, 8], [8, 56, 32], [8, 56, 32], [30, 31, 32]]
    found = numbered([parse("c(3,60,40)")]).limited(numbers)  # it may stay where it is, beyond the limits
    assert found.flatten(0, 2).tolist() == [[3, 60, 8], [8, 56, 32], [7, 57, 33], [30, 31, 40]]


@pytest.mark.parametrize("wrong", ["c(32,32,16)", parse("sp(32,32,32,16)"), None, torch.tensor([0, 399])])
def test_what_is_no_program_of_the_plane_is_named(wrong):
    target = images_of([CIRCLE])
    with unchecked():
        with pytest.raises(ProgramError, match="expected Programs of the plane"):
            numbered([CIRCLE, wrong])
        with pytest.raises(ProgramError, match="expected Programs of the plane"):
            refine([wrong], target)
        with pytest.raises(ProgramError, match="expected Programs of the plane"):
            refine_by_powell(wrong, target[0])


# Distances to known targets


def test_distances_to_targets_are_chamfer_distances(programs, unchecked_shapes):
    """To the last bit, blank and full ones included."""
    images = images_of(programs)
    images = torch.cat([images, torch.zeros_like(images[:1]), torch.ones_like(images[:1])])
    rng = np.random.default_rng(4)
    which, other = (torch.from_numpy(rng.integers(len(images), size=400)) for _ in range(2))
    which[:40], other[20:60] = len(images) - 1, len(images) - 2
    found = targets_of(images).chamfer(which, images[other])
    expected = image_chamfer(images[which], images[other])
    assert torch.equal(found, expected) and (expected == BLANK_PX).any()


def test_some_of_the_targets(targets):
    rows = torch.tensor([3, 3, 1])
    found = targets_of(targets).rows(rows).chamfer(torch.arange(3), targets[:3])
    assert torch.equal(found, image_chamfer(targets[rows], targets[:3]))


# Coordinate search


def test_it_never_gets_worse(refined):
    steps = refined.distances.diff(dim=0)
    assert (steps <= 0).all()
    assert (
        refined.distances[-1] < refined.distances[0]
    ).float().mean() > 0.9  # and with these nearly always better
    assert (steps[-1] == 0).all()  # the last sweep found nothing


def test_structure_and_kinds_stay(refined, starts):
    assert [p.structure for p in refined.programs] == [p.structure for p in starts]


def test_numbers_stay_in_range(refined):
    numbers = torch.cat([program.parameters().view(-1, 3) for program in refined.programs])
    assert (numbers >= LEAST).all() and (numbers <= MOST).all()


def test_distances_are_those_of_the_programs(refined, starts, targets):
    """At every sweep, to the last bit."""
    form = numbered(starts)
    assert len(refined.history) == len(refined.distances)
    for numbers, distances in zip(refined.history, refined.distances):
        drawn = images_of(replace(form, numbers=numbers).programs())
        assert torch.equal(image_chamfer(targets, drawn), distances)
    assert torch.equal(image_chamfer(targets, images_of(refined.programs)), refined.distances[-1])


def test_a_batch_is_as_one_by_one(refined, starts, targets, unchecked_shapes):
    for k in range(0, len(starts), 3):
        alone = refine(starts[k : k + 1], targets[k : k + 1])
        assert alone.programs[0] == refined.programs[k]
        assert torch.equal(alone.distances[:, 0], refined.distances[: len(alone.distances), k])


def test_the_order_of_the_batch_does_not_matter(refined, starts, targets, unchecked_shapes):
    assert refine(starts[::-1], targets.flip(0)).programs == refined.programs[::-1]


def test_it_is_deterministic(refined, starts, targets, unchecked_shapes):
    again = refine(starts, targets)
    assert again.programs == refined.programs and torch.equal(again.distances, refined.distances)


def test_no_sweeps_change_nothing(starts, targets):
    none = refine(starts, targets, sweeps=0)
    assert none.programs == starts
    assert torch.equal(none.distances, image_chamfer(targets, images_of(starts))[None])


def test_a_few_sweeps_are_the_first_of_many(refined, starts, targets, unchecked_shapes):
    two = refine(starts, targets, sweeps=2)
    assert torch.equal(two.distances, refined.distances[:3])
    assert torch.equal(two.history[2], refined.history[2])


def test_what_is_refined_stays(refined, targets, unchecked_shapes):
    again = refine(refined.programs, targets)
    assert again.programs == refined.programs and len(again.distances) == 2


def test_the_target_itself_stays(starts):
    found = refine(starts, images_of(starts))
    assert found.programs == starts and (found.distances == 0).all()


def test_a_displaced_program_finds_back(unchecked_shapes):
    """Every center and size is changed by up to 2 px. Most find back exactly, the others end near."""
    rng = np.random.default_rng(5)
    truth = sampled(5, [3] * 24)
    start = [displaced(program, rng, 2) for program in truth]
    found = refine(start, images_of(truth)).distances
    assert (found[0] > 0.3).float().mean() > 0.9
    assert (found[-1] == 0).float().mean() > 0.6  # 78 % of 40 programs, 65 % of 40 with five tokens
    assert found[-1].mean() < 0.1 * found[0].mean()


def test_one_primitive_finds_back_from_afar(unchecked_shapes):
    target = images_of([parse("c(20,41,11)"), parse("s(45,17,19)"), parse("t(31,30,27)")])
    found = refine([parse("c(48,16,8)"), parse("s(16,48,8)"), parse("t(16,40,8)")], target)
    assert found.distances[-1].tolist() == [0, 0, 0]


def test_numbers_off_the_range_are_allowed_at_the_start(programs, unchecked_shapes):
    found = refine(programs[:16], images_of(programs[16:32]), sweeps=2)
    assert (found.distances.diff(dim=0) <= 0).all()
    assert [p.structure for p in found.programs] == [p.structure for p in programs[:16]]


@pytest.mark.parametrize(
    "start, target, powells",
    [
        ("c(32,32,40)c(32,32,8)-", "c(32,32,40)c(36,32,8)-", 0),  # a radius above the networks' 32
        ("c(4,32,12)s(40,40,12)+", "c(4,32,12)s(43,40,12)+", 0),  # a center left of their 8
        ("c(20,20,3)c(44,44,20)+", "c(20,20,3)c(44,40,20)+", 0),  # a radius below their 8
    ],
)
def test_what_is_off_the_range_stays_while_the_rest_moves(start, target, powells, unchecked_shapes):
    picture = images_of([parse(target)])
    found = refine([parse(start)], picture)
    assert found.distances[0, 0] > 0.3 and found.distances[-1, 0] == 0
    assert found.programs == [parse(target)]
    better, distances = refine_by_powell(parse(start), picture[0])
    assert distances[-1] == powells and better.statements[0] == parse(target).statements[0]


def test_what_is_no_list_of_programs_or_no_image_is_refused():
    picture = images_of([CIRCLE])
    for programs, targets in (((CIRCLE), picture), ([CIRCLE], None), ([CIRCLE], picture.numpy())):
        with unchecked(), pytest.raises(ValueError, match="expected"):
            refine(programs, targets)
    for target in (None, [1], picture, picture[0].float()):
        with unchecked(), pytest.raises(ValueError, match=r"expected a bool tensor \(64, 64\)"):
            refine_by_powell(CIRCLE, target)
    with unchecked(), pytest.raises(ValueError, match="found 1.5 sweeps"):
        refine([CIRCLE], picture, 1.5)


@pytest.mark.parametrize("fill", [False, True])
def test_a_blank_or_full_target_is_16_px_from_everything(fill):
    found = refine([CIRCLE], torch.full((1, 64, 64), fill))
    assert found.programs == [CIRCLE] and set(found.distances.flatten().tolist()) == {BLANK_PX}


def test_a_blank_program_may_become_a_picture():
    start = parse("c(16,16,8)c(40,40,8)*")  # nothing: they do not meet
    found = refine([start], images_of([CIRCLE]))
    assert found.distances[0] == BLANK_PX and found.distances[-1] < 8


def test_nothing_to_refine():
    found = refine([], torch.zeros((0, 64, 64), dtype=torch.bool))
    assert found.programs == [] and found.distances.shape == (1, 0)


ONE = images_of([CIRCLE])


@pytest.mark.parametrize(
    "arguments, message",
    [
        (([CIRCLE] * 2, ONE), "found 2 programs and 1 targets"),
        (([CIRCLE], ONE[0]), r"\(64, 64\); expected a bool tensor \(n, 64, 64\)"),
        (([CIRCLE], ONE[:, :32]), r"found images torch.bool \(1, 32, 64\)"),
        (([CIRCLE], ONE[None]), r"found images torch.bool \(1, 1, 64, 64\)"),
        (([CIRCLE], ONE.float()), "found images torch.float32"),
        (([CIRCLE], ONE.tolist()), "found images list"),
        (([CIRCLE], ONE, -1), "found -1 sweeps"),
    ],
)
def test_what_does_not_fit_is_named(arguments, message):
    with unchecked(), pytest.raises(ValueError, match=message):
        refine(*arguments)


# Powell's method


def test_powell_s_distances_fall_and_belong_to_its_program(unchecked_shapes):
    start, target = parse("c(24,24,12)s(40,40,12)+"), images_of([parse("c(27,22,14)s(38,43,11)+")])[0]
    program, distances = refine_by_powell(start, target, iterations=2)
    assert distances[0] == image_chamfer(target, images_of([start])[0])
    assert distances[-1] == image_chamfer(target, images_of([program])[0])
    assert distances == sorted(distances, reverse=True) and distances[-1] < distances[0]
    assert 2 <= len(distances) <= 3
    assert program.structure == start.structure


def test_powell_without_iterations_changes_nothing():
    start = parse("c(24,24,12)")
    assert refine_by_powell(start, ONE[0], 0) == (
        start,
        [image_chamfer(ONE[0], images_of([start])[0]).item()],
    )


def test_powell_finds_one_primitive(unchecked_shapes):
    program, distances = refine_by_powell(parse("c(24,40,12)"), ONE[0])
    assert program == CIRCLE and distances[-1] == 0


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((CIRCLE, ONE[0], -1), "found -1 iterations"),
        ((CIRCLE, ONE[0].float()), r"torch.float32 \(64, 64\); expected a bool tensor"),
        ((CIRCLE, ONE[0, :32]), r"found images torch.bool \(32, 64\)"),
        ((CIRCLE, ONE), r"found images torch.bool \(1, 64, 64\)"),
    ],
)
def test_powell_names_what_does_not_fit(arguments, message):
    with unchecked(), pytest.raises(ValueError, match=message):
        refine_by_powell(*arguments)


def test_coordinate_search_comes_at_least_as_near_as_powell(targets, unchecked_shapes):
    """On average, from programs that have nothing to do with the target."""
    starts = sampled(8, [3] * 3)
    powell = [refine_by_powell(*pair)[1][-1] for pair in zip(starts, targets[3:])]
    assert refine(starts, targets[3:]).distances[-1].mean() <= np.mean(powell)


def test_the_vocabulary_s_range_is_the_range_of_refinement():
    """Every primitive of the networks' vocabulary is within the limits, and the limits are reached."""
    numbers = torch.tensor([primitive.numbers for primitive in vocabulary_of(2).primitives])
    assert torch.equal(numbers.amin(0)[[0, 2]], LEAST[[0, 2]]) and torch.equal(
        numbers.amax(0)[[0, 2]], MOST[[0, 2]]
    )
