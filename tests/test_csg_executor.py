"""Laws of executing CSG programs: those of sets, and that a program's shape depends on nothing but the program."""

import numpy as np
import pytest
import torch

from lib.interpreters.csg import (
    KINDS,
    Picture,
    Primitive,
    Program,
    ProgramError,
    Shapes,
    Solid,
    Vocabulary,
    execute,
    execute_many,
    machine,
    parse,
    vocabulary_of,
)
from lib.interpreters.csg.packing import SIDE, count, pack, pack_runs, unpack
from lib.interpreters.csg.primitives import draw
from lib.interpreters.csg.program import LONGEST
from tests.conftest import unchecked
from tests.csg_programs import (
    by_stack,
    chain,
    mask,
    pixels_of,
    random_mixture,
    random_primitive,
    random_program,
    random_tokens,
)


def same(*texts: str) -> bool:
    """Do all these programs make the same shape?"""
    words = execute_many([parse(text) for text in texts]).words
    return bool((words == words[0]).all())


@pytest.fixture(scope="module", params=[2, 3], ids=["plane", "space"])
def triples(request) -> list[tuple[str, str, str]]:
    """Three programs each, single primitives to five tokens: the sets of the laws."""
    rng = np.random.default_rng(request.param)
    how_many = 40 if request.param == 2 else 8
    with unchecked():
        return [
            tuple(random_program(rng, request.param, int(rng.choice([1, 3, 5]))).to_text() for _ in range(3))
            for _ in range(how_many)
        ]


# The laws of sets

LAWS = {
    "union commutes": ("{a}{b}+", "{b}{a}+"),
    "intersection commutes": ("{a}{b}*", "{b}{a}*"),
    "union is associative": ("{a}{b}+{c}+", "{a}{b}{c}++"),
    "intersection is associative": ("{a}{b}*{c}*", "{a}{b}{c}**"),
    "intersection distributes": ("{a}{b}{c}+*", "{a}{b}*{a}{c}*+"),
    "union distributes": ("{a}{b}{c}*+", "{a}{b}+{a}{c}+*"),
    "idempotence": ("{a}", "{a}{a}+", "{a}{a}*"),
    "absorption": ("{a}", "{a}{a}{b}+*", "{a}{a}{b}*+"),
    "De Morgan": ("{a}{b}{c}+-", "{a}{b}-{a}{c}-*", "{a}{b}-{c}-"),
    "De Morgan, the other": ("{a}{b}{c}*-", "{a}{b}-{a}{c}-+"),
    "taking away what is not there": ("{a}{b}-", "{a}{a}{b}*-", "{a}{b}-{b}-"),
    "intersection by subtraction": ("{a}{b}*", "{a}{a}{b}--"),
    "in two and together again": ("{a}", "{a}{b}-{a}{b}*+"),
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_sets(law, triples, unchecked_shapes):
    for a, b, c in triples:
        assert same(*(side.format(a=a, b=b, c=c) for side in law)), (a, b, c)


def test_subtraction_does_not_commute(triples, unchecked_shapes):
    assert not all(same(f"{a}{b}-", f"{b}{a}-") for a, b, _ in triples)


def test_a_without_itself_is_blank(triples, unchecked_shapes):
    for a, b, _ in triples:
        blank, left, right = execute_many([parse(text) for text in (f"{a}{a}-", f"{a}{b}-", f"{b}{a}{b}+-")])
        assert blank.on == right.on == 0 and not blank.words.any()
        assert left.on == execute(parse(a)).on - execute(parse(f"{a}{b}*")).on


def test_areas_add_up(triples, unchecked_shapes):
    for a, b, _ in triples:
        on = execute_many([parse(text) for text in (a, b, f"{a}{b}+", f"{a}{b}*", f"{a}{b}-")]).on
        assert on[0] + on[1] == on[2] + on[3] and on[0] == on[4] + on[3]


# Against the definition, pixel by pixel


@pytest.mark.parametrize("kind", KINDS)
def test_primitives_are_drawn_and_cut_off_by_the_canvas(kind, unchecked_shapes):
    """All sizes, centers up to the rim of the canvas: much of the larger ones lies outside."""
    rng = np.random.default_rng(4)
    dimensions = KINDS[kind].dimensions
    some = [random_primitive(rng, dimensions) for _ in range(1200 if dimensions == 2 else 120)]
    some = [primitive for primitive in some if primitive.kind == kind]
    rims = [
        (0, 63, 63, 64, 64),
        (0, 0, 0, 1, 1),
        (63, 63, 63, 2, 64),
        (63, 0, 31, 64, 2),
        (31, 32, 0, 63, 63),
    ]
    fields = KINDS[kind].fields
    some += [Primitive(kind, (*rim[:dimensions], *rim[3 : 3 + len(fields) - dimensions])) for rim in rims]
    assert len(some) > 30
    for primitive, pixels in zip(some, unpack(draw(some, dimensions)).reshape(-1, *[SIDE] * dimensions)):
        np.testing.assert_array_equal(pixels, mask(primitive), err_msg=str(primitive))


@pytest.mark.parametrize("dimensions, each", [(2, 60), (3, 4)])
def test_programs_with_any_primitives(dimensions, each, unchecked_shapes):
    """Both ways, the pixels' and the machine's, for a batch of all lengths."""
    rng = np.random.default_rng(5)
    programs = [random_program(rng, dimensions, n) for n in (13, 1, 7, 3, 11, 5, 9) for _ in range(each)]
    shapes = execute_many(programs)
    assert shapes.valid.all() and len(shapes) == len(programs)
    pixels = shapes.images if dimensions == 2 else shapes.grids
    for program, shape, made in zip(programs, shapes, pixels):
        expected = pixels_of(program)
        np.testing.assert_array_equal(made, expected, err_msg=str(program))
        np.testing.assert_array_equal(shape.image if dimensions == 2 else shape.grid, expected)
        assert shape.on == expected.sum() and shape.program == program
    assert shapes.on.tolist() == [shape.on for shape in shapes]
    assert len({tuple(shape.words.tolist()) for shape in shapes}) > len(shapes) // 2  # they are not all blank


def test_which_way_the_axes_point():
    image = execute(parse("t(20,40,12)")).image
    assert image[40 - 12, 20] and not image[40 + 11, 20]  # [y, x], y down: the apex is above the center
    grid = execute(parse("cy(20,32,40,2,20)")).grid
    assert grid[20, 32, 40 - 9 : 40 + 10].all() and grid[20].sum() == 3 * 19  # [x, y, z], standing


# A shape depends on nothing but its program


@pytest.mark.parametrize("dimensions, each", [(2, 40), (3, 6)])
def test_a_batch_equals_one_by_one(dimensions, each, unchecked_shapes):
    rng = np.random.default_rng(6)
    vocabulary = vocabulary_of(dimensions)
    tokens = random_mixture(rng, (1, 3, 5, 7, 9, 11, 13), each, vocabulary)
    shapes = execute_many(tokens, dimensions=dimensions)
    assert shapes.valid.all() and shapes.vocabulary is vocabulary
    programs = [vocabulary.program(row) for row in tokens]
    together = execute_many(programs)
    assert torch.equal(together.words, shapes.words)
    assert torch.equal(execute_many(programs[::-1]).words.flip(0), shapes.words)
    for row, program, words in zip(tokens, programs, shapes.words):
        assert torch.equal(execute(program).words, words)
        assert torch.equal(execute_many(row[None], vocabulary).words[0], words)


@pytest.mark.parametrize("dimensions, each", [(2, 40), (3, 4)])
def test_padding_and_what_follows_the_stop_do_not_matter(dimensions, each, unchecked_shapes):
    rng = np.random.default_rng(7)
    vocabulary = vocabulary_of(dimensions)
    tokens = random_mixture(rng, (1, 3, 7), each, vocabulary)
    tokens = torch.cat([tokens, torch.full_like(tokens, vocabulary.stop)], 1)
    expected = execute_many(tokens, vocabulary)
    noise = torch.from_numpy(rng.integers(len(vocabulary), size=tokens.shape))
    after = (tokens == vocabulary.stop).cumsum(1) > 1  # behind the first `$`
    noisy = torch.where(after, noise, tokens)
    assert (noisy != tokens).any(1).all()
    for other in (noisy, tokens[:, :8], tokens[:, :7]):
        shapes = execute_many(other, vocabulary)
        assert torch.equal(shapes.words, expected.words) and shapes.valid.all()
        assert [shape.program for shape in shapes] == [shape.program for shape in expected]


@pytest.mark.parametrize("dimensions, each", [(2, 30), (3, 3)])
@pytest.mark.parametrize("workspace", [1, 64, 1000, 5000, 100_000])
def test_a_batch_of_any_size(dimensions, each, workspace, monkeypatch, unchecked_shapes):
    """However little the machine works on in one go, down to one program after the other."""
    rng = np.random.default_rng(8)
    vocabulary = vocabulary_of(dimensions)
    tokens = random_mixture(rng, (1, 3, 5, 13), each, vocabulary)
    tokens[::7] = torch.from_numpy(rng.integers(len(vocabulary), size=tokens[::7].shape))  # not valid
    expected = execute_many(tokens, vocabulary)
    monkeypatch.setitem(machine._WORKSPACE, "cpu", workspace)
    shapes = execute_many(tokens, vocabulary)
    assert torch.equal(shapes.words, expected.words) and torch.equal(shapes.valid, expected.valid)
    assert 0 < expected.valid.sum() < len(expected)


@pytest.mark.parametrize("dtype", [torch.uint8, torch.int8, torch.int16, torch.int32, torch.uint16])
def test_tokens_of_any_whole_type(dtype, unchecked_shapes):
    """Also those that cannot hold the number of the vocabulary's own `$`."""
    tokens = random_tokens(np.random.default_rng(9), 50, 7, vocabulary_of(2)) if dtype.itemsize > 1 else (
        torch.arange(120)[:, None]
    )  # fmt: skip
    assert torch.equal(execute_many(tokens.to(dtype)).words, execute_many(tokens).words)
    assert execute_many(tokens.to(dtype)).valid.all()


def test_tokens_laid_out_in_any_way():
    tokens = random_tokens(np.random.default_rng(10), 50, 7, vocabulary_of(2))
    expected = execute_many(tokens).words
    assert torch.equal(execute_many(tokens.t().contiguous().t()).words, expected)
    assert torch.equal(execute_many(tokens.repeat_interleave(2, 0)[::2]).words, expected)
    assert torch.equal(execute_many(tokens[:1].expand(3, 7)).words, expected[:1].expand(3, 64))


def test_execution_leaves_its_input_alone():
    tokens = random_mixture(np.random.default_rng(11), (3, 7), 20, vocabulary_of(2))
    before, canvases = tokens.clone(), vocabulary_of(2).canvases().clone()
    shapes = execute_many(tokens)
    shapes.words.fill_(-1)  # nor do its results share memory with what is kept
    assert torch.equal(tokens, before) and torch.equal(vocabulary_of(2).canvases(), canvases)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("length", [3, 13, 257, LONGEST])
def test_deep_programs(side, length, unchecked_shapes):
    vocabulary = Vocabulary(
        parse(text).primitives[0] for text in ("c(24,32,16)", "s(40,32,20)", "t(32,32,24)")
    )
    program = parse(chain(length, side, "c(24,32,16)"))
    rng = np.random.default_rng(12)
    tokens = program.tokens(vocabulary).repeat(6, 1)
    draws = tokens < 3
    tokens[draws] = torch.from_numpy(rng.integers(3, size=int(draws.sum())))
    shapes = execute_many(tokens, vocabulary)
    assert shapes.valid.all()
    for row, image in zip(tokens.tolist(), shapes.images):
        np.testing.assert_array_equal(image, by_stack(row, vocabulary)[0])


def test_shallow_programs_of_any_length(unchecked_shapes):
    """Balanced trees: the stack never holds more than a few shapes."""
    text = "c(24,32,16)s(40,32,20)-"
    for operation in "+*-+*-+*":
        text = text + text.replace("c(24", "t(30") + operation
        program = parse(text)
        np.testing.assert_array_equal(execute(program).image, pixels_of(program))


# Batches of nothing


def test_an_empty_batch_is_empty():
    for dimensions in (2, 3):
        shapes = execute_many([], dimensions=dimensions)
        assert len(shapes) == 0 == shapes.on.numel() == shapes.valid.numel() and list(shapes) == []
        pixels = shapes.images if dimensions == 2 else shapes.grids
        assert pixels.shape == (0, *[SIDE] * dimensions)
        for length in (0, 3):
            assert len(execute_many(torch.zeros((0, length), dtype=torch.int64), dimensions=dimensions)) == 0


@pytest.mark.parametrize(
    "tokens", [torch.zeros((3, 0)).long(), torch.full((3, 5), 399), torch.full((3, 5), 398)]
)
def test_rows_that_are_no_programs_make_blank_shapes(tokens):
    shapes = execute_many(tokens)
    assert len(shapes) == 3 and not shapes.valid.any() and not shapes.on.any() and not shapes.images.any()
    with pytest.raises(ProgramError):
        shapes[1]


# What comes back


def test_shapes_are_a_sequence(unchecked_shapes):
    tokens = random_mixture(np.random.default_rng(13), (1, 3, 5), 4, vocabulary_of(2))
    tokens[2] = 0  # not valid
    shapes = execute_many(tokens)
    assert len(shapes) == 12 and isinstance(shapes[0], Picture)
    for part in (slice(3, 7), slice(-4, None), slice(3, None, 2), slice(9, 3)):
        some = shapes[part]
        assert isinstance(some, Shapes) and len(some) == len(range(12)[part])
        assert torch.equal(some.words, shapes.words[part]) and torch.equal(some.images, shapes.images[part])
        for shape, place in zip(some, range(12)[part]):
            assert shape.program == shapes[place].program and torch.equal(shape.image, shapes[place].image)
    assert torch.equal(shapes[-1].words, shapes[11].words) and torch.equal(
        shapes[np.int64(4)].words, shapes[4].words
    )
    assert repr(shapes) == "Shapes(12 of 2D programs, 11 valid)"
    assert shapes.valid.tolist() == [place != 2 for place in range(12)]


def test_a_shape_says_what_it_is():
    shape = execute(parse("c(32,32,2)"))
    assert (shape.dimensions, shape.on, repr(shape)) == (2, 9, "Picture('c(32,32,2)', 9 of 4096 ON)")
    solid = execute(parse("cu(8,8,8,4)"))
    assert isinstance(solid, Solid) and solid.dimensions == 3
    assert repr(solid) == "Solid('cu(8,8,8,4)', 27 of 262144 ON)"


def test_programs_come_from_anything_that_gives_them(unchecked_shapes):
    programs = [parse("c(24,32,12)"), parse("c(24,32,12)s(36,32,12)-")]
    expected = execute_many(programs).words
    for same_programs in (tuple(programs), iter(programs), (p for p in programs), dict.fromkeys(programs)):
        assert torch.equal(execute_many(same_programs).words, expected)


# Packing


def random_pixels(*shape: int, seed: int = 14) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).random(shape) < 0.5)


@pytest.mark.parametrize("shape", [(64,), (5, 64), (2, 3, 64), (2, 64, 64, 64), (0, 64)])
def test_pack_and_back(shape):
    pixels = random_pixels(*shape)
    words = pack(pixels)
    assert words.shape == shape[:-1] and words.dtype == torch.int64
    assert torch.equal(unpack(words), pixels) and torch.equal(pack(unpack(words)), words)


def test_bit_k_is_pixel_k():
    """Also bit 63, where the word becomes negative."""
    assert pack(torch.eye(64).bool()).tolist() == [1 << k for k in range(63)] + [-(1 << 63)]
    assert pack(torch.ones(64).bool()).item() == -1 and pack(torch.zeros(64).bool()).item() == 0


def test_packed_operations_are_those_of_pixels():
    a, b = random_pixels(20, 64), random_pixels(20, 64, seed=15)
    assert torch.equal(unpack(pack(a) | pack(b)), a | b)
    assert torch.equal(unpack(pack(a) & pack(b)), a & b)
    assert torch.equal(unpack(pack(a) & ~pack(b)), a & ~b)


def test_words_may_lie_anywhere():
    words = pack(random_pixels(4, 6, 64))
    assert torch.equal(unpack(words.t()), unpack(words).transpose(0, 1))
    assert torch.equal(unpack(words[:, ::2]), unpack(words)[:, ::2])


@pytest.mark.parametrize("density", [0, 0.01, 0.5, 0.99, 1])
def test_count(density):
    pixels = torch.from_numpy(np.random.default_rng(16).random((7, 3, 64, 64)) < density)
    assert torch.equal(count(pack(pixels)), pixels.sum((-1, -2)))


def test_runs_are_cut_off_by_the_canvas():
    ends = torch.arange(-70, 140, 3)
    first, last = torch.meshgrid(ends, ends, indexing="ij")
    pixels = torch.arange(64)
    expected = (first[..., None] <= pixels) & (pixels <= last[..., None])
    assert torch.equal(unpack(pack_runs(first, last)), expected)


def test_a_program_made_of_one_primitive_is_that_primitive():
    for dimensions in (2, 3):
        vocabulary = vocabulary_of(dimensions)
        places = torch.arange(0, len(vocabulary) - 4, 1 if dimensions == 2 else 97)
        assert torch.equal(execute_many(places[:, None], vocabulary).words, vocabulary.canvases()[places])
        assert Program((vocabulary.primitives[0],)) == execute_many(places[:1, None], vocabulary)[0].program
