"""What the complement layer alone costs: the least error of any matrices, however many nodes they have.

With as many nodes as one likes, a choice of cells is a union of intersections as soon as each cell that is in can be
told from each that is out: some F_k holds the one and not the other. Which F_k can, the complement layer decides. That
is a binary program with one variable for each primitive and each cell, no nodes, and so much easier; pairs of cells
are written down only once an answer confuses them. Its answer is a bound for any number of nodes.
"""

import time

import numpy as np
from scipy import sparse

from .arrangement import Arrangement
from .programming import Program, error_bound, selection

AT_ONCE = 1500  # pairs added a round


def separate(arrangement: Arrangement, seconds: float) -> tuple[float, np.ndarray | None]:
    """(no matrices have a smaller error, which literals (2 G) the best complements allow)."""
    deadline = time.perf_counter() + seconds
    bound, allowed = arrangement.floor, None
    good, bad = np.flatnonzero(arrangement.value > 0), np.flatnonzero(arrangement.value < 0)
    pairs = np.empty((0, 2), int)
    while (left := deadline - time.perf_counter()) > 0:
        x, lower = _program(arrangement, pairs).solve(left)
        constant = arrangement.floor + arrangement.value.clip(min=0).sum()
        bound = max(bound, error_bound(arrangement, lower + constant))
        if x is None:
            break
        complement = x[: arrangement.rows] > 0.5
        allowed = np.concatenate([~complement, complement]) | ~np.tile(arrangement.coupled, 2)
        confused = _confused(arrangement, allowed, good, bad, x[arrangement.rows :] > 0.5)
        if not len(confused):
            break
        pairs = np.concatenate([pairs, confused])
    return bound, allowed


def _program(arrangement: Arrangement, pairs: np.ndarray) -> Program:
    """W_C (G) and T (M): of a pair (in, out), T_in - T_out <= the number of literals in use that tell them apart."""
    program = Program()
    complement = program.variables(arrangement.rows)
    cells = program.variables(len(arrangement.value), -arrangement.value)
    if not len(pairs):
        return program
    inside = arrangement.literals[: arrangement.rows].astype(float)
    only_in, only_out = (inside[:, a] * (1 - inside[:, b]) for a, b in (pairs.T, pairs.T[::-1]))
    chosen = sparse.csr_array((only_out - only_in).T)
    ins, outs = (selection(column, len(cells)) for column in pairs.T)
    program.at_least(-only_in.sum(0), (chosen, complement), (-ins, cells), (outs, cells))
    return program


def _confused(arrangement, allowed, good, bad, shape) -> np.ndarray:
    """Pairs (in, out) of cells that no allowed literal tells apart: up to three for each cell, the heaviest first."""
    ins, outs = good[shape[good]], bad[~shape[bad]]
    lacking = (~arrangement.literals[allowed]).astype(np.float32)
    holding = arrangement.literals[allowed].astype(np.float32)
    wrong = holding[:, ins].T @ lacking[:, outs] == 0
    weight = np.minimum.outer(arrangement.value[ins], -arrangement.value[outs]) * wrong
    first = np.argsort(-weight, axis=None, kind="stable")[: min(AT_ONCE, int(wrong.sum()))]
    a, b = np.unravel_index(first, weight.shape)
    return np.stack([ins[a], outs[b]], 1)
