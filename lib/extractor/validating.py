"""Stage 12: is the program good enough to learn from? (paper, section 5.3, "Validating Programs")

reconstruction   F-score against the input of at least 75
semantics        one connected component a block (a block without one is never written: see `ordering`), every part
                 grounded, nothing beyond the bounding volumes
complexity       at most 12 leaf cuboids declared (macros may make more)
"""

import torch

from ..interpreters.shapeassembly import Cuboid, Program, Shape
from ..interpreters.shapeassembly.program import BBOX
from ..metrics.fscore import f_score
from ..metrics.rootedness import is_rooted
from .bounding import centered
from .partgraph import PartGraph

REASONS = {
    "unsound": "boxes or a nesting that cannot be worked with",
    "empty": "no part is left",
    "disconnected": "some parts of a block touch nothing that leads to its bounding box",
    "too many cuboids": "more leaf cuboids are declared than a network should have to write",
    "not finite": "the program runs into numbers that cannot be computed",
    "different shape": "the executed program does not look like the input",
    "outside": "parts stick out of the bounding box of their block",
    "not grounded": "parts do not hang together with the ground",
    "not a program": "the language refuses the text",
}
MIN_F_SCORE = 75.0  # percent (paper, section 5.3)
MAX_LEAVES = 12  # declared leaf cuboids (paper, section 5.3)
STICKS_OUT = 0.05  # share of the box's side (the authors' program)
ALWAYS_ALLOWED = 0.01  # share of the shape's diagonal: thin boxes have no room to miss by five percent


def too_many(program: Program) -> str:
    """What is wrong with the number of leaf cuboids that a program declares, "" if nothing is."""
    blocks = {block.name for block in program.blocks}
    leaves = sum(
        isinstance(statement, Cuboid) and statement.name != BBOX and statement.name not in blocks
        for _, _, statement in program.statements()
    )
    return f"{leaves} leaf cuboids are declared; at most {MAX_LEAVES}" if leaves > MAX_LEAVES else ""


def judge_shape(shape: Shape, graph: PartGraph) -> tuple[str, str, float]:
    """(reason, detail, F-score in percent) of an executed program against its input; reason "" if it passes."""
    score = f_score(shape.cuboids, centered(graph).leaves)  # programs are centered at the origin
    if score < MIN_F_SCORE:
        return "different shape", f"F-score {score:.1f}; at least {MIN_F_SCORE:.0f}", score
    if outside := sticking_out(shape):
        return "outside", f"{', '.join(outside)} beyond the bounding box", score
    if not is_rooted(shape.cuboids):
        return "not grounded", "a part has no chain of parts to the ground", score
    return "", "", score


def sticking_out(shape: Shape) -> list[str]:
    """Names of the leaves that reach beyond the box of their block, or of one around it."""
    parents, diagonal = torch.tensor(shape.parents), shape.boxes.size[0].norm()
    leaf = torch.tensor(shape.is_leaf).nonzero().squeeze(-1)
    beyond, around = torch.zeros(len(leaf), dtype=torch.bool), parents[leaf]
    while (around >= 0).any():
        within = shape.boxes[around.clamp(min=0)]
        offset = torch.einsum(
            "nck,nik->nci", shape.cuboids.corners() - within.center.unsqueeze(1), within.axes
        )
        allowed = torch.maximum(STICKS_OUT * within.size, ALWAYS_ALLOWED * diagonal)
        out = (offset.abs() - within.size.unsqueeze(1) / 2 > allowed.unsqueeze(1)).any(-1).any(-1)
        beyond |= out & (around >= 0)
        around = torch.where(around >= 0, parents[around.clamp(min=0)], -1)
    return [shape.box_names[i] for i in leaf[beyond].tolist()]
