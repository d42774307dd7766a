"""What the program VAE is trained to make small (paper, section 6.2): how well lines are predicted, and the KL term.

Only the fields that a line uses count: the command of every line, the cuboids it names, and the numbers of its kind.
One-hots are compared by cross-entropy (weight 1), numbers by absolute difference (weight 50), all summed over the lines
of a program; the KL divergence of the latent code from a standard normal distribution has weight 0.2. A batch counts
with the mean of its programs.

The divergence is the usual one, half of sum(mean^2 + variance - 1 - log variance). The authors' program leaves the half
out and weighs it by 0.1: the same as 0.2 here. It also takes the mean of the leaf term over a block's cuboids, where
this is a sum like the other terms, and skips sizes in a block of one cuboid and `aligned` in one of two.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy

from ..models.program_lines import COMMAND, FIELD
from ..models.program_vae import LineDecoder, Posterior, Predictions, one_hot_fields

ALIGNED_WEIGHT = 0.2  # of aligned cuboids: most are, by five to one and more (the authors' program)


@dataclass(frozen=True)
class LossWeights:
    """one_hot: commands, cuboids, axes, faces, aligned and leaf flags; number: sizes, points, counts; kl."""

    one_hot: float = 1.0
    number: float = 50.0
    kl: float = 0.2


NUMBERS = (
    "size",
    "point",
    "uv",
    "count",
    "distance",
    "root",
)  # absolute differences; the rest are cross-entropies
TERMS = ("command", "cuboids", "aligned", "leaf", "axis", "face", *NUMBERS, "kl")


def program_loss(
    line: LineDecoder, posterior: Posterior, found: Predictions, root: Float[Tensor, "programs 3"]
) -> dict[str, Tensor]:
    """Every term of TERMS, unweighted: summed over the lines of a program, the mean over the programs of the batch.

    line  the network's line decoder;  root  (programs, 3) true sides of the programs' bounding boxes, world units
    The commands and cuboids that later heads are told are the true ones (teacher forcing within the line).
    """
    rows = _rows_by_command(found.targets)
    terms = {"command": _cross_entropy(line.command(found.state), found.targets[:, FIELD["command"]])}
    terms |= _cuboid_terms(line, found, rows)
    terms |= _size_terms(line, found, rows["Cuboid"])
    terms |= _attach_terms(line, found, rows["attach"])
    terms |= _squeeze_terms(line, found, rows["squeeze"])
    terms |= _symmetry_terms(line, found, rows["reflect"], rows["translate"])
    terms["root"] = (found.root - root).abs().sum()
    mean, log_variance = posterior.mean, posterior.log_variance
    terms["kl"] = (mean.square() + log_variance.exp() - 1 - log_variance).sum() / 2
    return {name: terms[name] / len(root) for name in TERMS}


def total_loss(terms: dict[str, Tensor], weights: LossWeights) -> Tensor:
    """The weighted sum of the terms of `program_loss`."""
    one_hots = sum(value for name, value in terms.items() if name not in (*NUMBERS, "kl"))
    numbers = sum(terms[name] for name in NUMBERS)
    return weights.one_hot * one_hots + weights.number * numbers + weights.kl * terms["kl"]


def _rows_by_command(targets: Tensor) -> dict[str, Tensor]:
    commands = targets[:, FIELD["command"]].argmax(-1)
    return {name: (commands == number).nonzero().squeeze(-1) for name, number in COMMAND.items()}


def _cross_entropy(logits: Tensor, one_hot: Tensor) -> Tensor:
    return cross_entropy(logits, one_hot.argmax(-1), reduction="sum")


def _difference(found: Tensor, targets: Tensor, field: str) -> Tensor:
    return (found - targets[:, FIELD[field]]).abs().sum()


def _cuboid_terms(line: LineDecoder, found: Predictions, rows: dict[str, Tensor]) -> dict[str, Tensor]:
    """How well the cuboids are named: one by every statement, two by attach, three by squeeze."""
    pairs = torch.cat([rows["attach"], rows["squeeze"]])
    at = torch.cat([pairs, rows["Cuboid"], rows["reflect"], rows["translate"]])
    targets = found.targets[at]
    logits = line.cuboids(found.state[at], targets[:, FIELD["command"]])
    true = one_hot_fields(targets)
    two, attaches = len(pairs), len(rows["attach"])
    first = _cross_entropy(logits[:, 0], true[:, 0])
    second = _cross_entropy(logits[:two, 1], true[:two, 1])
    third = _cross_entropy(logits[attaches:two, 2], true[attaches:two, 2])
    return {"cuboids": first + second + third}


def _size_terms(line: LineDecoder, found: Predictions, at: Tensor) -> dict[str, Tensor]:
    state, targets = found.state[at], found.targets[at]
    size, aligned = line.size(state, found.size[at])
    weight = aligned.new_tensor(ALIGNED_WEIGHT)
    true = targets[:, FIELD["aligned"]].squeeze(-1)
    leaf = line.leaf(state, found.code[at])
    return {
        "size": _difference(size, targets, "size"),
        "aligned": binary_cross_entropy_with_logits(aligned, true, reduction="sum", pos_weight=weight),
        "leaf": binary_cross_entropy_with_logits(leaf, found.leaf[at], reduction="sum"),
    }


def _attach_terms(line: LineDecoder, found: Predictions, at: Tensor) -> dict[str, Tensor]:
    targets = found.targets[at]
    point, place = line.attach(found.state[at], one_hot_fields(targets)).split(3, -1)
    return {"point": _difference(point, targets, "point") + _difference(place, targets, "place")}


def _squeeze_terms(line: LineDecoder, found: Predictions, at: Tensor) -> dict[str, Tensor]:
    targets = found.targets[at]
    face, uv = line.squeeze(found.state[at], one_hot_fields(targets))
    return {"face": _cross_entropy(face, targets[:, FIELD["face"]]), "uv": _difference(uv, targets, "uv")}


def _symmetry_terms(
    line: LineDecoder, found: Predictions, reflects: Tensor, translates: Tensor
) -> dict[str, Tensor]:
    at = torch.cat([reflects, translates])
    targets = found.targets[at]
    axis, count, distance = line.symmetry(found.state[at], one_hot_fields(targets), found.size[at])
    copies = slice(len(reflects), None)  # only translate says how many, and how far
    return {
        "axis": _cross_entropy(axis, targets[:, FIELD["axis"]]),
        "count": _difference(count[copies, None], targets[copies], "count"),
        "distance": _difference(distance[copies, None], targets[copies], "distance"),
    }
