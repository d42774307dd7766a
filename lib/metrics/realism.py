"""Do generated shapes look like the training set? Fréchet distance, and how often a classifier is fooled.

(ShapeAssembly paper, section 7.1, Table 2 and Appendix E.) Both look at surface points (`clouds`) through a PointNet,
which the caller brings: a trained one for the Fréchet distance, one trained for the very question for the share of
fooled (`lib.training.realism`). The released program computes neither, and its PointNet is not released, so that these
numbers are comparable among themselves and with the paper's in kind only.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

AT_ONCE = 32  # clouds: what a layer makes of them stays in the cache


@dataclass(frozen=True)
class Realism:
    """Of the held-out shapes, in percent: fooled, the generated ones that are called real; doubted, the real ones that
    are called generated. Both are 50 where nothing tells the two apart, and 0 where everything does.

    Section 7.1 and Appendix E name neither clearly: the share is called "% fool", higher being better; the text first
    counts test shapes that are classified as generated, then held-out ones that are incorrectly classified as fake.
    A classifier is fooled by a generated shape that it takes for a real one: `fooled` is what we compare with Table 2.
    `doubted` is the text's letter. held_out: shapes of each kind that were judged, in each of `epochs` epochs.
    """

    fooled: float
    doubted: float
    held_out: int
    epochs: int


def realism(
    generated_called_real: Bool[Tensor, "epochs n"], real_called_real: Bool[Tensor, "epochs n"]
) -> Realism:
    """Shares over the held-out shapes, averaged over the last epochs of the classifiers' training."""
    if not generated_called_real.numel():
        raise ValueError("no verdict of a classifier was given; expected at least one epoch and one shape")
    return Realism(
        fooled=100 * generated_called_real.double().mean().item(),
        doubted=100 * (1 - real_called_real.double().mean().item()),
        held_out=generated_called_real.shape[1],
        epochs=generated_called_real.shape[0],
    )


def cloud_features(
    network: nn.Module, points: Float[Tensor, "shapes n 3"]
) -> Float[Tensor, "shapes features"]:
    """What `network.features` says of each cloud, in evaluation mode; on the device of the network."""
    return in_parts(network, network.features, points)


def in_parts(network: nn.Module, answer, points: Float[Tensor, "shapes n 3"]) -> Float[Tensor, "shapes k"]:
    """answer(part of the points) for all of them, without gradient, the network in evaluation mode meanwhile."""
    like, training = next(network.parameters()), network.training
    network.eval()
    try:
        with torch.no_grad():
            return torch.cat([answer(part.to(like)) for part in points.split(AT_ONCE)])
    finally:
        network.train(training)


def frechet_distance(a: Float[Tensor, "n features"], b: Float[Tensor, "m features"]) -> float:
    """Fréchet distance, squared, of the two normal distributions with the means and covariances of two feature sets.

        |mean a - mean b|² + trace(A) + trace(B) - 2 trace((A B)^½)        (Dowson & Landau 1982; Heusel et al. 2017)

    In squared units of the features; 0 for equal sets. Computed in float64. Where the rows of X are centred and divided
    by the root of n - 1, A is XᵀX, and the last trace is the sum of the singular values of X Yᵀ (X may be replaced by
    the triangle of its QR decomposition). So no root is taken of a product of covariances, which is not symmetric and,
    with fewer shapes than features, not regular: the usual sources of complex numbers and lost digits.
    Few shapes give too large a distance: compare what was measured with the same numbers of shapes.
    Raises ValueError for fewer than two shapes, different numbers of features, or features that are not finite.
    """
    _check(a, b)
    a, b = a.double(), b.double()
    apart = (a.mean(0) - b.mean(0)).square().sum()
    one, other = _root(a), _root(b)
    shared = torch.linalg.svdvals(one @ other.T).sum()
    distance = apart + one.square().sum() + other.square().sum() - 2 * shared
    return max(0.0, distance.item())  # rounding may leave -1e-13 for equal sets


def _root(features: Float[Tensor, "n features"]) -> Float[Tensor, "rows features"]:
    """R with RᵀR = the covariance, with no more rows than features."""
    centred = (features - features.mean(0)) / (len(features) - 1) ** 0.5
    return torch.linalg.qr(centred, mode="r").R


def _check(a: Tensor, b: Tensor) -> None:
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"found {a.shape[1]} and {b.shape[1]} features a shape; expected equal numbers")
    for features in (a, b):
        if len(features) < 2:
            raise ValueError(f"found the features of {len(features)} shapes; expected at least 2")
        if not features.isfinite().all():
            raise ValueError("found features that are not finite numbers")
