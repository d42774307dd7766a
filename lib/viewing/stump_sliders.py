"""A stump of space under one's hands: choose a primitive, move its numbers, see the solid.

    widget = StumpSliders(stump, cloud)      the last line of a cell shows it
    widget.choose(2)                         what the menu does: the third primitive
    widget.set("half x", 0.1)                what a slider does
    widget.stump                             the present stump; widget.text that, as OpenSCAD's language has it

The picture is that of `figure()`, made anew after each move; beyond the cloud's box nothing is drawn.
"""

import io

import ipywidgets as widgets
import torch
import trimesh
from jaxtyping import Float
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.checks import check_points, whole
from lib.interpreters.stump import ProgramError, Stump, layers
from lib.models.reconstructing import surface
from lib.viewing.figure import show
from lib.viewing.stump_net_figures import plain

REACH, STEP = 0.7, 0.005  # of a slider
AXES = {"half": "xyz", "translation": "xyz", "rotation": "wxyz"}


class StumpSliders(widgets.VBox):
    """A menu of primitives, a slider for each number of the chosen one, the solid beside them.

    cloud  the points (n, 3) that the stump was found in: its box is what is drawn
    Raises TypeError for what is no stump, and ValueError for one of the plane, and another cloud.
    """

    def __init__(self, stump: Stump, cloud: Float[Tensor, "n 3"]):
        if not isinstance(stump, Stump):
            raise TypeError(f"found a {type(stump).__name__}; expected a Stump")
        if stump.dimensions != 3:
            raise ValueError(f"found a stump of {stump.dimensions} dimensions; expected one of space")
        self.stump = self._first = stump.to(torch.float32)
        self._cloud, self.chosen = check_points(cloud, "xyz").float(), 0
        names = [f"F{k + 1} {primitive.name}" for k, primitive in enumerate(stump.primitives)]
        self._menu = widgets.Dropdown(
            options=[(name, k) for k, name in enumerate(names)], description="primitive"
        )
        self._menu.observe(lambda change: self.choose(change["new"]), "value")
        self._reset = widgets.Button(description="As found", icon="undo", layout={"width": "auto"})
        self._reset.on_click(lambda _: self.reset())
        self._sliders, self._box, self._image = {}, widgets.VBox(), widgets.Image(format="png", width=380)
        self.choose(0)
        left = widgets.VBox([self._menu, self._box, self._reset], layout={"width": "50%"})
        super().__init__([widgets.HBox([left, self._image])])
        self.add_class("stump-sliders")

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"StumpSliders({self.stump!r})"

    @property
    def text(self) -> str:
        """The present stump in OpenSCAD's language."""
        return self.stump.to_openscad()

    def choose(self, number: int) -> None:
        """Show the sliders of this primitive. Raises ValueError for one that is not there."""
        if whole(number) is None or not 0 <= number < len(self.stump.primitives):
            raise ValueError(f"found primitive {number}; expected 0 to {len(self.stump.primitives) - 1}")
        self.chosen = number
        self._sliders = {name: self._slider(name, value) for name, value in self.numbers.items()}
        self._box.children = list(self._sliders.values())
        self._menu.value = number
        self._draw()

    def set(self, name: str, value: float) -> None:
        """Move one number of the chosen primitive. Raises KeyError for a name that it does not have.

        Raises ProgramError where the numbers make no primitive, such as a rotation of zeros; nothing is moved then.
        """
        self._sliders[name].value = value

    def reset(self) -> None:
        """All as it was found."""
        self.stump = self._first
        self.choose(self.chosen)

    def surface(self) -> trimesh.Trimesh:
        """The present solid, closed at the cloud's box."""
        stump = self.stump
        return surface(lambda points: layers.signed(stump.distances(points), *stump.matrices), self._cloud)

    def figure(self) -> Figure:
        """The present solid, and the chosen primitive's place as a dot."""
        place = self.stump.primitives[self.chosen].translation.detach().numpy()[None]
        return show(plain(self.surface()), size=3.6, points=place)

    @property
    def numbers(self) -> dict[str, float]:
        """Names and values of the chosen primitive's numbers, in text order."""
        primitive, names = self.stump.primitives[self.chosen], []
        for key in primitive.written:
            axes = AXES.get(key, "") if primitive.widths[key] > 1 else ""
            names += [f"{key} {axis}" for axis in axes] or [key]
        return dict(zip(names, primitive.numbers.detach().tolist(), strict=True))

    def _slider(self, name: str, value: float) -> widgets.FloatSlider:
        wide = max(REACH, 1.2 * abs(value), 1.0 if name.startswith("rotation") else 0.0)
        low = STEP if name.split()[0] in ("half", "radius", "height", "slope") else -wide
        slider = widgets.FloatSlider(
            value, min=min(low, value), max=wide, step=STEP, description=name, continuous_update=False,
            readout_format=".3f", style={"description_width": "110px"},
        )  # fmt: skip
        slider.observe(lambda _: self._moved(), "value")
        return slider

    def _moved(self) -> None:
        primitives, old = list(self.stump.primitives), self.stump.primitives[self.chosen]
        numbers = torch.tensor([slider.value for slider in self._sliders.values()])
        try:
            primitives[self.chosen] = old.with_numbers(numbers)
            self.stump = Stump(primitives, *self.stump.matrices)
        except ProgramError:
            self.choose(self.chosen)  # the sliders as they were
            raise
        self._draw()

    def _draw(self) -> None:
        buffer = io.BytesIO()
        self.figure().savefig(buffer, format="png")
        self._image.value = buffer.getvalue()
