"""The latent space of a program VAE under one's hands: a slider for each main direction, the shape, and its program.

    explorer = LatentExplorer(network, directions)     the last line of a cell shows it
    explorer.set_weight(0, 1.5)                        what the first slider does
    explorer.go_to(program)                            start from a program instead of the mean

Each slider moves the code along one direction by so many standard deviations; the network writes the program of the
code anew, and both shape and text follow. Sliders are used with the mouse or, once the tab key has reached one, with
the arrow keys. On a page without a kernel a live view is blank: put `explorer.figure()` above it.
"""

from collections.abc import Sequence
from html import escape

import ipywidgets as widgets
import torch
from jaxtyping import Float
from matplotlib.figure import Figure
from torch import Tensor

from lib.interpreters.shapeassembly import Program, Shape, execute
from lib.models.exploring import Directions, codes
from lib.models.program_vae import ProgramVAE
from lib.models.writing import write
from lib.viewing.echo import Echo
from lib.viewing.latent_figures import direction_figure, line_count
from lib.viewing.scene import ShapeView

REACH = 3.0  # standard deviations to each side
STEP = 0.1
MEAN = "the mean of the codes"

STYLE = """<style>
.latent-program pre { margin: 0; padding: 6px 8px; font: 12px/1.45 monospace; white-space: pre; tab-size: 2;
  overflow: auto; border: 1px solid #d5d9e0; border-radius: 4px; color: #1b1f27; background: #fff;
  box-sizing: border-box; }
.latent-program .new { background: #fff1c9; display: inline-block; min-width: 100%; }
</style>"""


class LatentExplorer(widgets.VBox):
    """Sliders and the program's text on the left, the shape on the right.

    network, directions   what to explore; one slider a direction
    start                 the program, or the code (latent,), that sliders at 0 stand for; None: the directions' mean
    program, shape        of the present code; the last good ones where a code gives no program
    weights               (directions,) where the sliders are, standard deviations      code   (latent,)
    """

    def __init__(
        self,
        network: ProgramVAE,
        directions: Directions,
        start: Program | Float[Tensor, " latent"] | None = None,
        height: int = 400,
    ):
        self.network, self.directions = network, directions
        self.program: Program | None = None
        self.shape: Shape | None = None
        self._echo = Echo()  # are we the ones who move the sliders now?
        self._height = height
        self._noise = torch.Generator().manual_seed(0)
        self._view = ShapeView(height=height)
        self._text = widgets.HTML()
        self._status = widgets.HTML()
        self._sliders = [self._slider(number) for number in range(len(directions))]
        self._set_base(start)
        super().__init__(self._arrange())
        self.add_class("latent-explorer")

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"LatentExplorer({len(self.directions)} directions, {self.weights.tolist()})"

    @property
    def weights(self) -> Float[Tensor, " directions"]:
        """Where the sliders are, standard deviations."""
        return torch.tensor([slider.value for slider in self._sliders])

    @property
    def code(self) -> Float[Tensor, " latent"]:
        """The present latent code."""
        return self.directions.code(self.weights, self._base)

    @property
    def view(self) -> ShapeView:
        """The live 3D view."""
        return self._view

    @property
    def text(self) -> str:
        """The present program as text."""
        return self.program.to_text() if self.program else ""

    @property
    def status(self) -> str:
        """What stands below the sliders, without markup."""
        return self._said

    def set_weight(self, number: int, value: float) -> None:
        """Move one slider. Raises IndexError for one that is not there, ValueError for a number outside its range."""
        if not 0 <= number < len(self._sliders):
            raise IndexError(f"found direction {number}; expected 0 to {len(self._sliders) - 1}")
        self.set_weights([*self.weights[:number].tolist(), value, *self.weights[number + 1 :].tolist()])

    def set_weights(self, weights: Sequence[float]) -> None:
        """Move all sliders. Raises ValueError for another number of weights, and for one outside -3 to 3."""
        weights = [float(weight) for weight in weights]
        if len(weights) != len(self._sliders) or not all(abs(weight) <= REACH for weight in weights):
            raise ValueError(
                f"found weights {weights}; expected {len(self._sliders)} from {-REACH:g} to {REACH:g}"
            )
        with self._echo:
            for slider, weight in zip(self._sliders, weights):
                slider.value = weight
        self._follow()

    def reset(self) -> None:
        """All sliders to 0."""
        self.set_weights([0.0] * len(self._sliders))

    def surprise(self) -> None:
        """All sliders to random places, as the codes are spread; the same sequence of places for every explorer."""
        drawn = torch.randn(len(self._sliders), generator=self._noise).clamp(-REACH, REACH)
        self.set_weights(((drawn / STEP).round() * STEP).tolist())

    def go_to(self, start: Program | Float[Tensor, " latent"] | None) -> None:
        """Let sliders at 0 stand for another program or code; None: the mean of the codes."""
        self._set_base(start)

    def figure(self, **options) -> Figure:
        """A still picture for pages without a kernel: steps along the first directions, see `direction_figure`."""
        return direction_figure(self.network, self.directions, self._base, **options)

    def _set_base(self, start) -> None:
        if isinstance(start, Program):
            start = codes(self.network, [start])[0]
        mean = self.directions.mean
        base = mean if start is None else start.detach().to(mean)
        if base.shape != mean.shape or not base.isfinite().all():
            raise ValueError(
                f"found a code of shape {tuple(base.shape)}; expected {len(mean)} finite numbers"
            )
        self._base = base
        self.reset()

    def _follow(self) -> None:
        """Let the network write the present code, and show what it wrote."""
        with torch.inference_mode():  # a tenth faster than without gradients only
            written = write(self.network, self.code[None], "skip")
        program, before = written.programs[0], self.program
        if program is None:
            return self._say(f"This code gives no program ({written.reasons[0]}); the last one is shown.")
        self.program, self.shape = program, execute(program)
        self._view.shape = self.shape
        self._text.value = self._as_html(before)
        self._say(_described(program, self.shape, before))

    def _say(self, sentence: str) -> None:
        self._said = sentence
        self._status.value = f'<span role="status" aria-live="polite">{escape(sentence)}</span>'

    def _as_html(self, before: Program | None) -> str:
        """The program; lines whose structure the program before did not have at that place are marked."""
        known = {} if before is None else {block.name: block.statements for block in before.blocks}
        lines = []
        for block in self.program.blocks:
            lines.append(escape(f"Assembly {block.name} {{"))
            old = [statement.structure for statement in known.get(block.name, ())]
            for number, statement in enumerate(block.statements):
                same = before is None or number < len(old) and old[number] == statement.structure
                text = f"\t{escape(statement.to_text())}"
                lines.append(text if same else f'<mark class="new">{text}</mark>')
            lines.append("}")
        label = 'tabindex="0" role="region" aria-label="The program the network writes for this code"'
        return f'<pre {label} style="height:{self._height // 2}px">' + "\n".join(lines) + "</pre>"

    def _slider(self, number: int) -> widgets.FloatSlider:
        share = f"{self.directions.share[number].item():.0%}"
        slider = widgets.FloatSlider(
            0.0, min=-REACH, max=REACH, step=STEP, description=f"Direction {number + 1} ({share})",
            tooltip=f"Standard deviations along main direction {number + 1}, which has {share} of the codes' variance",
            readout_format="+.1f", layout={"width": "98%"}, style={"description_width": "120px"},
        )  # fmt: skip
        slider.observe(self._on_slider, "value")
        slider.add_class("latent-slider")
        return slider

    def _on_slider(self, _) -> None:
        if not self._echo:
            self._follow()

    def _arrange(self) -> list[widgets.Widget]:
        buttons = [
            self._button("All to 0", "undo", self.reset, "reset"),
            self._button("Surprise me", "random", self.surprise, "surprise"),
            self._button("Save GLB", "download", self._save_shape, "save-glb"),
            self._button("Save program", "download", self._save_program, "save-program"),
        ]
        rows = widgets.HBox(buttons, layout={"flex_flow": "row wrap"})
        self._text.add_class("latent-program")
        left = widgets.VBox([*self._sliders, rows, self._status, self._text], layout={"width": "50%"})
        right = widgets.VBox([self._view], layout={"width": "50%"})
        return [widgets.HTML(STYLE), widgets.HBox([left, right])]

    def _button(self, text: str, icon: str, action, name: str) -> widgets.Button:
        button = widgets.Button(description=text, icon=icon, layout={"width": "auto"})
        button.on_click(lambda _: action())
        button.add_class(f"latent-{name}")
        return button

    def _save_shape(self) -> None:
        self._view.download("shape.glb", self.shape.to_glb())

    def _save_program(self) -> None:
        self._view.download("program.txt", self.text)


def _described(program: Program, shape: Shape, before: Program | None) -> str:
    """One sentence: how large a program is, and whether its structure is that of the program before."""
    blocks = f"{len(program.blocks)} block{'s' if len(program.blocks) > 1 else ''}"
    count = f"{len(shape.names)} cuboids, {line_count(program)} lines in {blocks}"
    if before is None:
        return f"{count}."
    same = before.structure == program.structure
    return f"{count}; {'the same structure as' if same else 'another structure than'} before."
