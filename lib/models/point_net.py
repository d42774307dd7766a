"""PointNet: a cloud of points in, a class out, and on the way features that say what shape it is (Qi et al. 2017).

    points (b, n, 3) -> input transform -> shared layers (b, n, width) -> maximum over points -> head -> logits

Every point goes through the same layers, and the maximum forgets their order: neither order nor number of the points
matters. It is smaller than the paper's (256 features, not 1,024) and has its input transform only, no feature
transform and no dropout. Clouds are centred at their mean point and not scaled: how large a shape is says something.
"""

from dataclasses import dataclass
from pathlib import Path

from jaxtyping import Float
from torch import Tensor, nn

PRETRAINED = Path(__file__).parents[2] / "pretrained" / "point_net.safetensors"  # see the card beside it


@dataclass(frozen=True)
class PointNetConfig:
    """labels: names of the classes; the rest: widths of the layers, the last of `widths` being that of the features."""

    labels: tuple[str, ...]
    widths: tuple[int, ...] = (32, 64, 128, 256)
    transform_widths: tuple[int, ...] = (16, 32, 64)
    head_width: int = 128


class PointNet(nn.Module):
    """Points (b, n, 3), world units, to features and to one logit a label."""

    def __init__(self, config: PointNetConfig):
        super().__init__()
        self.config = config
        features, transform = config.widths[-1], config.transform_widths[-1]
        self.to_transform = _layers(3, *config.transform_widths)
        self.transform = nn.Linear(transform, 9)
        nn.init.zeros_(self.transform.weight)  # begins as the identity
        nn.init.zeros_(self.transform.bias)
        self.to_features = _layers(3, *config.widths)
        self.head = _layers(features, config.head_width)
        self.logits = nn.Linear(config.head_width, len(config.labels))

    def features(self, points: Float[Tensor, "b n 3"]) -> Float[Tensor, "b features"]:
        """The greatest answer of each feature to any of the points: the same for any order of them."""
        points = points - points.mean(1, keepdim=True)
        turn = self.transform(_greatest(self.to_transform, points)).view(-1, 3, 3)
        return _greatest(self.to_features, points + points @ turn)

    def forward(self, points: Float[Tensor, "b n 3"]) -> Float[Tensor, "b labels"]:
        """Logits, one a label."""
        return self.logits(self.head(self.features(points)))


def _layers(*widths: int) -> nn.Sequential:
    """Linear, batch norm and ReLU from each width to the next."""
    steps = []
    for wide, next_wide in zip(widths, widths[1:]):
        steps += [nn.Linear(wide, next_wide, bias=False), nn.BatchNorm1d(next_wide), nn.ReLU()]
    return nn.Sequential(*steps)


def _greatest(layers: nn.Sequential, points: Float[Tensor, "b n k"]) -> Float[Tensor, "b width"]:
    """The layers on every point of every cloud at once, then the maximum over each cloud's points."""
    return layers(points.flatten(0, 1)).unflatten(0, points.shape[:2]).amax(1)
