"""Whatever a network says, what is written are programs that make sense; and a batch writes what each would alone."""

import dataclasses
import math

import pytest
import torch

from lib.datasets import shapeassembly
from lib.interpreters.shapeassembly import (
    Attach,
    Block,
    Cuboid,
    Program,
    ProgramError,
    Reflect,
    Squeeze,
    Translate,
    execute_many,
    parse,
)  # fmt: skip
from lib.models import writing
from lib.models.pretrained import pretrained
from lib.models.program_lines import COMMAND, COMMANDS, FIELD
from lib.models.program_vae import LineDecoder, ProgramVAE, ProgramVAEConfig
from lib.models.weights import load
from lib.models.writing import MAX_BLOCKS, MODES, reconstruct, sample, write
from lib.models.writing_rules import AUTHORS, Rules
from lib.models.written_blocks import Node, blocks_of
from tests.conftest import unchecked

SMALL = ProgramVAEConfig(hidden=16, head=16)
FLOAT = 2e-6  # numbers of a program have six decimals
NAN, INF = float("nan"), float("inf")


class Noisy(LineDecoder):
    """Says anything: chance decides at every step, now and then with numbers that are none."""

    LIKELY = torch.tensor([0.0, 1.0, 3.0, 0.5, 0.0, 1.5, 0.5])  # of COMMANDS, before the noise

    def __init__(self, seed: int, broken: float = 0.0):
        super().__init__(SMALL)
        self.noise, self.broken = torch.Generator().manual_seed(seed), broken

    def _say(self, *shape):
        said = torch.randn(*shape, generator=self.noise)
        breaks = torch.rand(*shape, generator=self.noise) < self.broken
        bad = torch.tensor([NAN, INF, -INF, 1e30, -1e30, 3e38])
        return torch.where(breaks, bad[torch.randint(len(bad), shape, generator=self.noise)], said)

    def command(self, state):
        return 1.5 * self._say(len(state), 7) + self.LIKELY

    def cuboids(self, state, command):
        return self._say(len(state), 3, 11)

    def size(self, state, size):
        return size * self._say(len(state), 3).abs() / 2, self._say(len(state))

    def attach(self, state, cuboids):
        return 0.5 + self._say(len(state), 6) / 4

    def squeeze(self, state, cuboids):
        return self._say(len(state), 6), 0.5 + self._say(len(state), 2) / 2

    def symmetry(self, state, cuboids, size):
        return self._say(len(state), 3), 3 * self._say(len(state)), self._say(len(state)) / 2

    def leaf(self, state, code):
        return self._say(len(state)) + 1


def noisy(seed: int, broken: float = 0.0) -> ProgramVAE:
    """An untrained network whose bounding boxes have sides of about 1."""
    torch.manual_seed(seed)
    network = ProgramVAE(SMALL).eval()
    network.line = Noisy(seed, broken)
    torch.nn.init.ones_(network.root_size[-1].bias)
    return network


def untrained(seed: int, scale: float) -> ProgramVAE:
    """Random weights, as large as one likes."""
    torch.manual_seed(seed)
    network = ProgramVAE(SMALL).eval()
    with torch.no_grad():
        for weight in network.parameters():
            weight *= scale
    return network


@pytest.fixture(scope="module")
def trained() -> ProgramVAE:
    """The chair network that comes with the project."""
    with unchecked():
        return load(ProgramVAE, pretrained("program_vae_chair"))


def codes(count: int, network: ProgramVAE, seed: int = 0, spread: float = 1.0) -> torch.Tensor:
    noise = torch.Generator().manual_seed(seed)
    return spread * torch.randn(count, network.config.hidden, generator=noise)


def check_text(block: Block, rules: Rules) -> None:
    """The rules that can be read off the text; order and grounding are checked by Program itself."""
    sides, joined = set(), set()
    size = block.statements[0].numbers
    assert sum(isinstance(s, Cuboid) for s in block.statements) <= 11
    for s in block.statements[1:]:
        if isinstance(s, Cuboid):
            assert all(0.01 <= side <= most for side, most in zip(s.numbers, size))
            continue
        assert all(0 <= number <= 1 for number in s.numbers)
        meets = []  # (partner, which side of the bbox that would be)
        if isinstance(s, Attach):
            meets = [(s.still, s.numbers[4] > 0.5)]
            assert s.still != "bbox" or min(s.numbers[4], 1 - s.numbers[4]) <= rules.near + FLOAT
        elif isinstance(s, Squeeze):
            meets = [(s.first, s.face == "top"), (s.second, s.face == "bot")]
            assert s.face in ("top", "bot") or "bbox" not in (s.first, s.second)
        elif isinstance(s, Translate):
            assert 1 <= s.count <= rules.most
        for partner, side in meets:
            meeting = (s.moved, side) if partner == "bbox" else frozenset((s.moved, partner))
            seen = sides if partner == "bbox" else joined
            assert meeting not in seen or (partner == "bbox" and rules.same_side)
            seen.add(meeting)


def check_steps(block: Block, rules: Rules) -> None:
    """After every line all cuboids are in their bounding box; reflections are of the negative side."""
    statements = block.statements
    stops = [i for i, s in enumerate(statements) if i and not isinstance(s, Cuboid)]
    shapes = execute_many([Program.unchecked((Block("b", statements[: stop + 1]),)) for stop in stops])
    limit = (1 + rules.outside) / 2 * torch.tensor(statements[0].numbers, dtype=torch.float64) + FLOAT
    for stop, shape in zip(stops, shapes):
        assert (shape.cuboids.corners().abs() <= limit).all()
        if isinstance(s := statements[stop], Reflect):
            center = dict(zip(shape.names, shape.cuboids.center))[f"b/{s.source}"]
            assert center["XYZ".index(s.axis)] <= FLOAT


def check(programs: list[Program], rules: Rules, every: int = 1) -> None:
    """The law of writing; the steps of every so many programs are run one by one."""
    assert execute_many(programs).valid.all() if programs else True
    for number, program in enumerate(programs):
        assert parse(program.to_text()) == program
        assert len(program.blocks) <= MAX_BLOCKS
        filled = {s.name: s.numbers for _, _, s in program.statements() if isinstance(s, Cuboid)}
        for block in program.blocks:
            assert len(block.statements) > 1
            assert block.name == "Program_0" or filled[block.name] == block.statements[0].numbers
            moved = {s.moved for s in block.statements if isinstance(s, Attach | Squeeze)}
            assert {s.name for s in block.statements[1:] if isinstance(s, Cuboid)} <= moved  # all stand
            check_text(block, rules)
            if number % every == 0:
                check_steps(block, rules)


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("mode", ["reject", "skip"])
@pytest.mark.parametrize("rules", [Rules(), AUTHORS], ids=["paper", "authors"])
def test_every_program_makes_sense_whatever_the_network_says(mode, rules):
    """2,000 programs in all: four times five networks, one hundred codes each; most say broken numbers at times."""
    found = []
    for seed in range(5):
        network = noisy(seed, broken=seed * 1e-3)
        while len(found) < 100 * (seed + 1):
            found += write(network, codes(200, network, len(found)), mode, rules).accepted
    check(found, rules, every=10)
    used = {s.command for program in found for _, _, s in program.statements()}
    assert used == {"Cuboid", "attach", "squeeze", "reflect", "translate"}
    assert max(len(program.blocks) for program in found) > 1


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("scale", [1.0, 3.0, 1e4, 1e12])
def test_untrained_networks_of_any_weight_do_no_harm(mode, scale):
    network = untrained(int(math.log10(scale)), scale)
    written = write(network, codes(20, network, spread=3.0), mode)
    assert [program is None for program in written.programs] == [reason != "" for reason in written.reasons]
    if mode != "none":
        check(written.accepted, Rules())


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("mode", ["reject", "skip"])
def test_a_trained_network_far_from_what_it_knows(trained, mode):
    written = write(trained, codes(60, trained, spread=3.0), mode)
    assert len(written.accepted) > (2 if mode == "reject" else 40)
    check(written.accepted, Rules(), every=3)


@pytest.mark.usefixtures("unchecked_shapes")
def test_without_rules_what_is_no_program_is_told():
    written = write(noisy(1, 1e-3), codes(300, noisy(1)), "none")
    assert {"a number that is not finite"} < set(written.reasons)
    for program, reason in zip(written.programs, written.reasons):
        assert (program is None) == bool(reason)
    assert any("stands on nothing" in reason for reason in written.reasons)


@pytest.mark.usefixtures("unchecked_shapes")
@pytest.mark.parametrize("mode", MODES)
def test_a_batch_writes_what_each_code_would_alone(trained, mode):
    latent = codes(12, trained, seed=4)
    together = write(trained, latent, mode).programs
    for code, program in zip(latent, together):
        (alone,) = write(trained, code[None], mode).programs
        assert (alone and alone.structure) == (program and program.structure)
        if alone:  # sums come in another order: the last decimals differ
            assert torch.allclose(alone.parameters(), program.parameters(), atol=1e-4)


@pytest.mark.usefixtures("unchecked_shapes")
def test_samples_are_the_same_however_many_are_asked_for(trained, monkeypatch):
    monkeypatch.setattr(writing, "CODES_AT_ONCE", 24)
    few, many = (sample(trained, count, 1, "skip") for count in (3, 30))
    assert many.programs[:3] == few.programs and len(many.programs) == 30
    assert sample(trained, 3, 2, "skip").programs != few.programs
    assert many.rejection_rate == many.rejected / (many.rejected + 30)
    assert sample(trained, 0).rejection_rate == 0


@pytest.mark.usefixtures("unchecked_shapes")
def test_a_network_that_writes_nothing_is_told(monkeypatch):
    monkeypatch.setattr(writing, "MOST_REJECTED", 300)
    with pytest.raises(
        RuntimeError, match="512 codes rejected, 0 programs found; expected a trained network"
    ):
        sample(untrained(0, 1.0), 1)


@pytest.mark.usefixtures("unchecked_shapes")
def test_reconstructions_are_one_for_each_program(trained):
    programs = list(shapeassembly("chair"))[:6]
    written = reconstruct(trained, programs)
    assert len(written.programs) == 6 and len(written.accepted) >= 5
    check(written.accepted, Rules())


def test_wrong_arguments_are_told():
    network = noisy(0)
    with pytest.raises(ValueError, match="unknown mode 'all': choose one of reject, skip, none"):
        write(network, codes(1, network), "all")
    with pytest.raises(ValueError, match=r"shape \(2, 5\); expected \(programs, 16\)"):
        write(network, torch.zeros(2, 5))
    assert write(network, torch.zeros(0, 16)).programs == []


def test_codes_that_are_not_finite_give_no_program():
    latent = torch.tensor([[NAN] * 16, [INF] * 16, [0.0] * 16])
    reasons = write(noisy(0), latent, "skip").reasons
    assert reasons[:2] == ["its bounding box is not finite"] * 2 != reasons[1:]


class Stubborn(Noisy):
    """One cuboid as large as the bbox; then, for ever, an attach that takes it half way out."""

    def command(self, state):
        self.step = getattr(self, "step", -1) + 1
        return torch.eye(7)[[COMMAND["Cuboid"] if self.step == 0 else COMMAND["attach"]]].repeat(
            len(state), 1
        )

    def size(self, state, size):
        return size, torch.ones(len(state))

    def attach(self, state, cuboids):
        return torch.tensor([[0.0, 0.0, 0.0, 0.5, 0.0, 0.5]]).repeat(len(state), 1)


def stubborn(mode: str) -> tuple[writing.Written, list[str]]:
    """What it writes, and the commands that it read on the way."""
    network, reads = noisy(0), []
    network.line = Stubborn(0)
    read = network.read_previous
    network.read_previous = lambda lines, *rest: (
        reads.append(COMMANDS[int(lines[0, FIELD["command"]].argmax())]) or read(lines, *rest)
    )
    return write(network, torch.zeros(1, 16), mode), reads


@pytest.mark.usefixtures("unchecked_shapes")
def test_a_line_that_is_skipped_is_read_only_after_ten():
    written, reads = stubborn("skip")
    assert reads[:13] == ["start", "Cuboid", *["Cuboid"] * 10, "attach"]  # the second is the bbox
    assert len(reads) == 101 and "no cuboid stands on the bounding box" in written.reasons[0]


def test_a_line_that_leaves_the_bounding_box_is_rejected():
    written, reads = stubborn("reject")
    assert written.reasons == ["cuboids leave their bounding box"] and len(reads) == 3
    assert written.accepted == []


@pytest.mark.usefixtures("unchecked_shapes")
def test_the_limit_of_blocks_is_reached_and_kept(monkeypatch):
    monkeypatch.setattr(writing, "MAX_BLOCKS", 4)
    network = noisy(3)
    network.line.leaf = lambda state, code: -torch.ones(len(state))
    programs = write(network, codes(60, network), "skip").accepted
    assert max(len(program.blocks) for program in programs) == 4


def cuboid(name: str) -> Cuboid:
    return Cuboid(name, (0.5, 0.5, 0.5), True)


def attach(moved: str, still: str = "bbox") -> Attach:
    return Attach(moved, still, (0.5, 0, 0.5, 0.5, 0, 0.5))


def test_what_stands_on_nothing_is_left_out_with_what_is_in_it():
    inner = Node(0, [cuboid("bbox"), cuboid("cube0"), attach("cube0")])
    empty = Node(0, [cuboid("bbox"), cuboid("cube0")])
    lines = [cuboid("bbox"), cuboid("cube0"), cuboid("cube1"), cuboid("cube2")]
    root = Node(0, [*lines, attach("cube1"), attach("cube2", "cube1"), Reflect("cube2", "X")])
    root.children = {1: inner, 2: inner, 3: empty}  # of cube0, cube1, cube2
    assert Program(blocks_of(root)).to_text() == (
        "Assembly Program_0 {\n\tbbox = Cuboid(0.5, 0.5, 0.5, True)\n\tProgram_1 = Cuboid(0.5, 0.5, 0.5, True)\n"
        "\tcube1 = Cuboid(0.5, 0.5, 0.5, True)\n\tattach(Program_1, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)\n"
        "\tattach(cube1, Program_1, 0.5, 0, 0.5, 0.5, 0, 0.5)\n\treflect(cube1, X)\n}\n"
        "Assembly Program_1 {\n\tbbox = Cuboid(0.5, 0.5, 0.5, True)\n\tcube0 = Cuboid(0.5, 0.5, 0.5, True)\n"
        "\tattach(cube0, bbox, 0.5, 0, 0.5, 0.5, 0, 0.5)\n}\n"
    )


def test_what_stands_on_nothing_cannot_be_used():
    root = Node(0, [cuboid("bbox"), cuboid("cube0"), Reflect("cube0", "X")])
    with pytest.raises(ProgramError, match="reflect names cube0, which stands on nothing"):
        blocks_of(root)


@pytest.mark.usefixtures("unchecked_shapes")
def test_drawn_choices_keep_the_rules_and_follow_their_seed(trained):
    latent = codes(40, trained, 1)
    likely, again = (write(trained, latent, "skip").programs for _ in range(2))
    drawn, same, other = (
        write(trained, latent, "skip", temperature=1.0, seed=seed).programs for seed in (0, 0, 1)
    )
    assert likely == again and drawn == same
    assert drawn != other and drawn != likely
    check([program for program in drawn + other if program], Rules(), every=20)
    with pytest.raises(ValueError, match="a temperature of -1"):
        write(trained, latent, temperature=-1)


def test_rules_are_a_value():
    assert (
        Rules() == Rules() and dataclasses.replace(Rules(), near=0.1, outside=0.5, same_side=True) == AUTHORS
    )


@pytest.mark.parametrize(
    "wrong", [{"count": -1}, {"count": 1, "spread": math.nan}, {"count": 1, "spread": -1.0}]
)
def test_samples_that_make_no_sense_are_told(trained, wrong):
    with pytest.raises(ValueError, match="expected 0 or more"):
        sample(trained, **wrong)


def test_of_no_programs_there_are_no_reconstructions(trained):
    assert reconstruct(trained, []).programs == []
