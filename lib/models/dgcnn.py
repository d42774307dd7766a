"""DGCNN: a cloud of points in, one feature vector out (Wang et al. 2019), as CSG-Stump Net's encoder.

    EdgeConv    each point looks at its k nearest neighbours: h_ij = layers([x_j - x_i, x_i]),  y_i = max_j h_ij
    encoder     three EdgeConvs, each with the neighbours in the features before it; their outputs side by side ->
                a linear layer -> maximum over all points

A layer is linear without a bias, a batch norm, leaky ReLU. (A norm of each point's own numbers in its place would
forget how far a point is from the origin, and from its neighbours.) The first of an EdgeConv is linear in x_j and in
x_i, so it is computed once a point and then gathered, not once an edge: W [x_j - x_i, x_i] = A x_j + (B - A) x_i, where
W = [A, B].
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

SLOPE = 0.2  # of the leaky ReLU


class DGCNN(nn.Module):
    """Points (b, n, 3) to features (b, width).

    width       of the feature
    neighbours  that a point looks at, itself among them; in smaller clouds all points
    Raises ValueError for sizes below 1.
    """

    def __init__(self, width: int = 256, neighbours: int = 20):
        super().__init__()
        if min(width, neighbours) < 1:
            raise ValueError(f"found width {width}, {neighbours} neighbours; expected at least 1 of each")
        self.neighbours = neighbours
        layers = ((3, (64, 64)), (64, (64, 64)), (64, (64,)))
        self.convolutions = nn.ModuleList(EdgeConv(inner, widths) for inner, widths in layers)
        self.last = nn.Linear(3 * 64, width, bias=False)
        self.norm = nn.BatchNorm1d(width)

    def forward(self, points: Float[Tensor, "b n 3"]) -> Float[Tensor, "b width"]:
        """The same for any order of the points."""
        found, x = [], points
        for convolution in self.convolutions:
            x = convolution(x, nearest(x, self.neighbours))
            found.append(x)
        each = _active(self.norm, self.last(torch.cat(found, 2)).flatten(0, 1))
        return each.unflatten(0, points.shape[:2]).amax(1)


class EdgeConv(nn.Module):
    """Features of points (b, n, inner) to new ones (b, n, widths[-1]), from the points near each."""

    def __init__(self, inner: int, widths: tuple[int, ...]):
        super().__init__()
        self.first = nn.Linear(2 * inner, widths[0], bias=False)
        self.norms = nn.ModuleList(nn.BatchNorm1d(width) for width in widths)
        self.others = nn.ModuleList(nn.Linear(a, b, bias=False) for a, b in zip(widths, widths[1:]))

    def forward(
        self, x: Float[Tensor, "b n inner"], near: Int[Tensor, "b n k"]
    ) -> Float[Tensor, "b n width"]:
        """near: the numbers of each point's neighbours."""
        to_other, to_own = self.first.weight.chunk(2, 1)
        other, own = x @ to_other.T, x @ (to_own - to_other).T
        (b, n, k), width = near.shape, other.shape[2]
        rows = near + torch.arange(b, device=near.device).view(-1, 1, 1) * n
        edges = other.flatten(0, 1).index_select(0, rows.flatten()).view(b, n, k, width) + own.unsqueeze(2)
        edges = _active(self.norms[0], edges.flatten(0, 2))
        for linear, norm in zip(self.others, self.norms[1:]):
            edges = _active(norm, linear(edges))
        return edges.view(b, n, k, -1).amax(2)


@torch.no_grad()
def nearest(x: Float[Tensor, "b n d"], k: int) -> Int[Tensor, "b n k"]:
    """The numbers of the k nearest points of each point, itself among them; of all, where there are fewer."""
    x = x.float()
    apart = torch.baddbmm(
        (x * x).sum(-1).unsqueeze(1), x, x.mT, alpha=-2
    )  # squared, less what a row has in common
    return apart.topk(min(k, x.shape[1]), dim=2, largest=False, sorted=False).indices


def _active(norm: nn.Module, x: Float[Tensor, "rows width"]) -> Float[Tensor, "rows width"]:
    return nn.functional.leaky_relu(norm(x), SLOPE, inplace=True)
