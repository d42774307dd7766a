"""Programs -> tables of attach instructions, grouped into waves that a batch machine can run.

ShapeAssembly is an assembly language: squeeze, reflect and translate expand to `Cuboid` and `attach`. Which attach
case applies, which earlier attachments count, and which cuboids are touched depends on the text alone, never on
the numbers; so all of it is decided here, once. An instruction waits only for earlier ones that touch its cuboids;
those that need not wait for each other form a *wave* and run together, across all blocks of all programs.
"""

from dataclasses import dataclass

import numpy as np

from .program import AXES, BBOX, FACES, Attach, Block, Cuboid, Reflect, Squeeze, Translate

# Every coordinate is an index into the vector (0, 1/2, 1, parameters…): squeezes and copies need the constants.
ZERO, HALF, ONE, FIRST_PARAMETER = 0, 1, 2, 3
MOVE, GROW, ONE_EARLIER, MORE_EARLIER = range(4)  # the cases of `attaching`
TURNING = (ONE_EARLIER, MORE_EARLIER)  # these need to know the earlier attachments


@dataclass
class Group:
    """Instructions `start` … `stop` of a table: one wave, one case, independent of one another."""

    case: int
    start: int
    stop: int
    earlier: np.ndarray  # (instructions, most) earlier records of the moved cuboid, -1 where a row has fewer


@dataclass
class Table:
    """Instructions sorted into groups. `columns[name]` has a row per instruction; `order` tells where each row
    stood in the program."""

    groups: list[Group]
    columns: dict[str, np.ndarray]
    order: np.ndarray


class Expansion:
    """The cuboids of one compiled block: row numbers in the machine, and what the copies are copies of."""

    def __init__(self):
        self.rows: dict[str, int] = {}  # bbox first, then declared cuboids, then clones
        self.source: dict[str, str] = {}  # clone -> declared cuboid
        self.flip: dict[str, int] = {}  # clone made by a reflect -> axis


class Compiler:
    """Collects the instructions of many blocks, then sorts them into waves.

    A *record* is one end of one attach: number 2 i for the moved cuboid of instruction i, 2 i + 1 for the other.
    """

    BUILD = ("moved", "still", "x1", "y1", "z1", "x2", "y2", "z2")  # coordinates: value indices
    COPY = ("moved", "still", "copied", "source", "bbox", "axis", "mirrored", "distance", "step", "steps")

    def __init__(self):
        self.sizes: list[tuple[int, int, int]] = []  # (cuboids, 3) value indices
        self.clones: list[int] = []  # cuboid rows of clones …
        self.sources: list[int] = []  # … and of what they copy
        self.parameter_count = 0
        self._build: list[tuple] = []  # (wave, case, *BUILD)
        self._copy: list[tuple] = []  # (wave, case, *COPY)
        self._build_earlier: dict[int, list[int]] = {}  # instruction that turns a cuboid -> records before it
        self._copy_earlier: dict[int, list[int]] = {}

    def add(self, block: Block) -> Expansion:
        """Compile one block; its parameters follow those of the blocks before."""
        state = _BlockState()
        for statement in block.statements:
            _EXPANSIONS[statement.command](self, statement, FIRST_PARAMETER + self.parameter_count, state)
            self.parameter_count += len(statement.numbers)
        return state.names

    def build_table(self) -> Table:
        """The attaches that build the blocks."""
        order = _wave_order(self._build)
        return _table(self._build, self.BUILD, order, _renumber(self._build_earlier, np.argsort(order), 0))

    def copy_table(self, build: Table) -> Table:
        """The attaches of clones, after all building is done. Numbered on from the building instructions."""
        order = _wave_order(self._copy)
        table = _table(
            self._copy, self.COPY, order, _renumber(self._copy_earlier, np.argsort(order), len(build.order))
        )
        table.columns["copied"] = np.argsort(build.order)[table.columns["copied"]]
        return table

    def _cuboid(self, statement: Cuboid, first: int, state: "_BlockState") -> None:
        state.declare(statement.name, len(self.sizes), statement.aligned)
        self.sizes.append((first, first + 1, first + 2))

    def _attach(self, statement: Attach, first: int, state: "_BlockState") -> None:
        self._instruction(statement.moved, statement.still, range(first, first + 6), state)

    def _squeeze(self, statement: Squeeze, first: int, state: "_BlockState") -> None:
        """Paper, Appendix B: centers of two opposite faces, each onto a face of its partner at (u, v)."""
        axis, far = divmod(FACES.index(statement.face), 2)
        side, other = (ZERO, ONE) if far else (ONE, ZERO)
        for partner, end in ((statement.first, side), (statement.second, other)):
            point = [HALF, HALF, HALF]
            point[axis] = end
            place = [first, first + 1]
            # On a neighbour the facing side lies opposite; the bbox is met from inside.
            place.insert(axis, end if partner == BBOX else (ONE if end == ZERO else ZERO))
            self._instruction(statement.moved, partner, (*point, *place), state)

    def _instruction(self, moved: str, still: str, coordinates, state: "_BlockState") -> None:
        number = len(self._build)
        wave, earlier = state.schedule(moved, still, number)
        case = _case(len(earlier), state.aligned[moved])
        rows = state.names.rows
        self._build.append((wave, case, rows[moved], rows[still], *coordinates))
        if case in TURNING:
            self._build_earlier[number] = earlier

    def _reflect(self, statement: Reflect, first: int, state: "_BlockState") -> None:
        clone = self._clone(statement, state, 1, 1, ZERO)
        state.names.flip[clone] = AXES.index(statement.axis)

    def _translate(self, statement: Translate, first: int, state: "_BlockState") -> None:
        for step in range(1, statement.count + 1):
            self._clone(statement, state, step, statement.count, first)

    def _clone(
        self, statement: Reflect | Translate, state: "_BlockState", step: int, steps: int, distance: int
    ) -> str:
        """A copy of a cuboid, attached wherever its source was moved by an attach (paper, Appendix B)."""
        rows, source = state.names.rows, statement.source
        clone = f"cube{len(rows) - 1}"
        axis, mirrored = AXES.index(statement.axis), int(isinstance(statement, Reflect))
        self.clones.append(len(self.sizes))
        self.sources.append(rows[source])
        state.names.source[clone] = source
        rows[clone] = len(self.sizes)
        self.sizes.append(self.sizes[rows[source]])
        records = []
        for wave, (copied, still) in enumerate(state.moves[source]):
            case = _case(wave, state.aligned[source])
            if case in TURNING:
                self._copy_earlier[len(self._copy)] = list(records)
            records.append(2 * len(self._copy))
            entry = (
                rows[clone],
                rows[still],
                copied,
                rows[source],
                rows[BBOX],
                axis,
                mirrored,
                distance,
                step,
                steps,
            )
            self._copy.append((wave, case, *entry))
        return clone


_EXPANSIONS = {
    "Cuboid": Compiler._cuboid,
    "attach": Compiler._attach,
    "squeeze": Compiler._squeeze,
    "reflect": Compiler._reflect,
    "translate": Compiler._translate,
}


class _BlockState:
    """What has happened to each cuboid of a block so far."""

    def __init__(self):
        self.names = Expansion()
        self.aligned: dict[str, bool] = {}
        self.records: dict[str, list[int]] = {}  # every attach it took part in
        self.moves: dict[str, list[tuple[int, str]]] = {}  # (instruction, partner) of those that moved it
        self.written: dict[str, int] = {}  # wave of its last change
        self.read: dict[str, int] = {}  # wave in which it last served as a partner

    def declare(self, name: str, row: int, aligned: bool) -> None:
        self.names.rows[name] = row
        self.aligned[name] = aligned
        self.records[name], self.moves[name] = [], []
        self.written[name] = self.read[name] = -1

    def schedule(self, moved: str, still: str, number: int) -> tuple[int, list[int]]:
        """Wave of an attach, and the earlier records of the cuboid it moves; notes the attach as done."""
        wave = 1 + max(self.written[moved], self.read[moved], self.written[still])
        earlier = list(self.records[moved])
        self.written[moved] = wave
        self.read[still] = max(self.read[still], wave)
        self.records[moved].append(2 * number)
        self.records[still].append(2 * number + 1)
        self.moves[moved].append((number, still))
        return wave, earlier


def _case(earlier: int, aligned: bool) -> int:
    if earlier == 0:
        return MOVE
    if aligned:
        return GROW
    return ONE_EARLIER if earlier == 1 else MORE_EARLIER


def _wave_order(instructions: list[tuple]) -> np.ndarray:
    keys = np.array([entry[:2] for entry in instructions], dtype=np.int64).reshape(-1, 2)
    return np.lexsort((keys[:, 1], keys[:, 0]))


def _renumber(earlier: dict[int, list[int]], position: np.ndarray, first: int) -> dict[int, list[int]]:
    """Record numbers after sorting; keys stay the instructions' numbers before it."""
    return {
        i: [2 * (first + int(position[r // 2])) + r % 2 for r in records] for i, records in earlier.items()
    }


def _table(
    instructions: list[tuple], names: tuple[str, ...], order: np.ndarray, earlier: dict[int, list[int]]
) -> Table:
    entries = np.array(instructions, dtype=np.int64).reshape(-1, 2 + len(names))[order]
    columns = {name: entries[:, 2 + i] for i, name in enumerate(names)}
    starts = np.flatnonzero(np.diff(entries[:, :2], axis=0, prepend=-1).any(1))
    groups = [
        Group(
            int(entries[start, 1]),
            int(start),
            int(stop),
            _padded([earlier.get(i, []) for i in order[start:stop].tolist()]),
        )
        for start, stop in zip(starts, [*starts[1:], len(entries)])
    ]
    return Table(groups, columns, order)


def _padded(lists: list[list[int]]) -> np.ndarray:
    most = max(map(len, lists))
    if not most:
        return np.zeros((len(lists), 0), dtype=np.int64)
    return np.array([[*records, *[-1] * (most - len(records))] for records in lists], dtype=np.int64).reshape(
        len(lists), most
    )
