"""Binary programs for the matrices, given to HiGHS through SciPy.

`layers` is the paper's own problem: one variable for each cell of each matrix. Its two products, W_I with F and W_U
with S, become inequalities between binaries, so nothing is lost; but it grows with cells x primitives x nodes, and
nodes can change places, so that every answer is found many times over.

`choose` picks the nodes out of a list of terms instead: one variable a term. It is exact where the list holds every
term that could be needed (`terms.every`), and otherwise as good as the list.

Costs are weights of wrong points beyond the arrangement's floor. Every literal and node costs a little more, less in
sum than the smallest step between two errors, so that of equally good matrices the simplest are best. Where weights
have no common measure there is no such step, and no such cost.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.optimize import Bounds, LinearConstraint, milp

from .arrangement import Arrangement, Term, distinct

TOLERANCE = 1e-6  # of HiGHS, relative to the largest cost


@dataclass(frozen=True)
class Answer:
    """terms  the best that were found, None where none were in time
    bound  no answer to the program has a smaller error (weight, the floor included)"""

    terms: list[Term] | None
    bound: float


class Program:
    """Minimise cost @ x with rows @ x >= low and 0 <= x <= 1, put together block by block."""

    def __init__(self):
        self.costs, self.integers, self.blocks, self.lows = [], [], [], []
        self.size = 0

    def variables(self, count: int, cost=0.0, integer: bool = True) -> np.ndarray:
        """The places (count) of new variables."""
        self.costs.append(np.broadcast_to(np.asarray(cost, float), count))
        self.integers.append(np.full(count, int(integer)))
        self.size += count
        return np.arange(self.size - count, self.size)

    def at_least(self, low: float | np.ndarray, *blocks: tuple[sparse.sparray, np.ndarray]) -> None:
        """Rows: the sum of matrix @ x[places] over the blocks is at least `low`."""
        parts = [(matrix.tocoo(), places) for matrix, places in blocks]
        rows = np.concatenate([matrix.coords[0] for matrix, _ in parts])
        columns = np.concatenate([places[matrix.coords[1]] for matrix, places in parts])
        data = np.concatenate([matrix.data for matrix, _ in parts]).astype(float)
        count = parts[0][0].shape[0]
        self.blocks.append((rows + sum(len(low) for low in self.lows), columns, data))
        self.lows.append(np.broadcast_to(np.asarray(low, float), count))

    def solve(self, seconds: float) -> tuple[np.ndarray | None, float]:
        """(x or None, a bound that no x is below, -inf at worst); HiGHS stops after `seconds`."""
        cost = np.concatenate(self.costs)
        constraints = []
        if self.lows:
            rows, columns, data = (np.concatenate(parts) for parts in zip(*self.blocks))
            low = np.concatenate(self.lows)
            matrix = sparse.csr_array((data, (rows, columns)), shape=(len(low), self.size))
            constraints = [LinearConstraint(matrix, low)]
        found = milp(
            cost,
            integrality=np.concatenate(self.integers),
            bounds=Bounds(0, 1),
            constraints=constraints,
            options={"time_limit": max(seconds, 0.01), "mip_rel_gap": 0},
        )
        bound = -np.inf if found.mip_dual_bound is None else float(found.mip_dual_bound)
        return found.x, bound


def choose(arrangement: Arrangement, terms: Sequence[Term], nodes: int, seconds: float) -> Answer:
    """At most `nodes` of these terms, that fit together."""
    price = _price(arrangement, nodes)
    program = Program()
    taken = program.variables(len(terms), [price * (len(term) + 1) for term in terms])
    _cover(program, taken, *_alike(arrangement.extents(terms), arrangement.value))
    program.at_least(-nodes, (sparse.csr_array(-np.ones((1, len(terms)))), taken))
    _couple(program, arrangement, taken, [(t, x) for t, term in enumerate(terms) for x in term])
    x, bound = program.solve(seconds)
    constant = arrangement.floor + arrangement.value.clip(min=0).sum()
    chosen = None if x is None else [term for term, one in zip(terms, x[taken]) if one > 0.5]
    return Answer(chosen, error_bound(arrangement, bound + constant))


def _alike(extents: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells that are in the same terms are in or out together: (extents (T, M'), value (M')) of fewer cells."""
    columns, which = distinct(extents.T)
    summed = np.bincount(which, value, len(columns))
    some = columns.any(1) & (summed != 0)
    return columns[some].T, summed[some]


def _cover(program: Program, taken: np.ndarray, extents: np.ndarray, value: np.ndarray) -> None:
    """Cells: one worth having is in only if one of its terms is taken; another is in as soon as one is."""
    cells = program.variables(len(value), -value, integer=False)
    good = value > 0
    if good.any():
        some_term = sparse.csr_array(extents[:, good].T.astype(float))
        program.at_least(0, (some_term, taken), (-sparse.eye_array(int(good.sum())), cells[good]))
    term, cell = np.nonzero(extents[:, ~good])
    if len(term):
        program.at_least(
            0, (selection(cell, int((~good).sum())), cells[~good]), (-selection(term, len(taken)), taken)
        )


def selection(columns: np.ndarray, width: int) -> sparse.csr_array:
    """A matrix with one 1 a row, in these columns."""
    return sparse.csr_array(
        (np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=(len(columns), width)
    )


def _couple(
    program: Program, arrangement: Arrangement, users: np.ndarray, uses: list[tuple[int, int]]
) -> None:
    """W_C: users[i] uses literal x, for each (i, x); a coupled row is complemented for all nodes or for none."""
    complement = program.variables(arrangement.rows)
    uses = [(i, x) for i, x in uses if arrangement.coupled[x % arrangement.rows]]
    for way, sign in ((0, -1), (1, 1)):  # used <= 1 - W_C inside, used <= W_C outside
        some = [(i, x % arrangement.rows) for i, x in uses if x // arrangement.rows == way]
        if some:
            user, row = np.array(some).T
            rows = sign * selection(row, arrangement.rows)
            program.at_least(min(sign, 0), (rows, complement), (-selection(user, len(users)), users))


def layers(arrangement: Arrangement, nodes: int, seconds: float) -> Answer:
    """The paper's problem: W_C (G), W_I (2 G, C), a row for each way to use a primitive, W_U (C), and S (M, C), T (M).

    S_c <= F_k where W_I selects it; S_c <= W_U; T <= the sum of S_c; and for cells that should be out
    T >= W_U - the number of selected F_k that the cell lacks. W_U and the counts of literals fall from node to node.
    """
    literals, cells = arrangement.literals.shape
    price = _price(arrangement, nodes)
    program = Program()
    good = arrangement.value > 0
    shape = program.variables(cells, -arrangement.value, integer=False)
    united = program.variables(nodes, price)
    selected = program.variables(literals * nodes, price).reshape(literals, nodes)
    held = []
    for c in range(nodes):
        lacks = sparse.csr_array((~arrangement.literals).T.astype(float))  # (M, 2 G)
        held.append(_node(program, lacks, good, shape, united[c : c + 1], selected[:, c]))
        if c:
            one = sparse.csr_array(np.ones((1, 1)))
            all_literals = sparse.csr_array(np.ones((1, literals)))
            program.at_least(0, (one, united[c - 1 : c]), (-one, united[c : c + 1]))
            program.at_least(0, (all_literals, selected[:, c - 1]), (-all_literals, selected[:, c]))
    identity = sparse.eye_array(int(good.sum()))
    program.at_least(0, *[(identity, node) for node in held], (-identity, shape[good]))
    uses = [(x * nodes + c, x) for x in range(literals) for c in range(nodes)]
    _couple(program, arrangement, selected.reshape(-1), uses)
    x, bound = program.solve(seconds)
    terms = None if x is None else _read(x[united] > 0.5, x[selected] > 0.5)
    constant = arrangement.floor + arrangement.value.clip(min=0).sum()
    return Answer(terms, error_bound(arrangement, bound + constant))


def _node(program, lacks, good, shape, united, selected) -> np.ndarray:
    """One node's S of the cells that are good to have: their places."""
    held = program.variables(int(good.sum()), integer=False)
    every = sparse.csr_array(np.ones((len(held), 1)))
    program.at_least(0, (every, united), (-sparse.eye_array(len(held)), held))
    cell, literal = lacks[good].nonzero()
    program.at_least(-1, (-selection(cell, len(held)), held), (-selection(literal, len(selected)), selected))
    bad = sparse.eye_array(int((~good).sum()))
    every = sparse.csr_array(-np.ones((bad.shape[0], 1)))
    program.at_least(0, (bad, shape[~good]), (every, united), (lacks[~good], selected))
    return held


def _read(united: np.ndarray, selected: np.ndarray) -> list[Term]:
    return [tuple(np.flatnonzero(column).tolist()) for column, one in zip(selected.T, united) if one]


def _price(arrangement: Arrangement, nodes: int) -> float:
    """Of a literal or a node; all that can be selected together cost half a step."""
    return (arrangement.step or 0.0) / 2 / (nodes * (arrangement.rows + 1))


def error_bound(arrangement: Arrangement, cost: float) -> float:
    """The least error of matrices that cost at least this much: errors are the floor and a multiple of the step."""
    slack = TOLERANCE * max(1.0, abs(cost))
    if arrangement.step is None or cost == -np.inf:
        return float(max(arrangement.floor, cost - slack))
    steps = np.ceil((cost - slack - arrangement.floor) / arrangement.step - 0.5)
    return float(arrangement.floor + max(0.0, steps) * arrangement.step)
