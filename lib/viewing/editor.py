"""A program under one's hands: its text, its shape in 3D, and a slider for each of its numbers.

Text, sliders and shape say the same thing at all times. A slider rewrites its number in the text; an edit of the
text moves the sliders. A text that is no program shows its error, with line and column, beside the last good shape.
Everything a reader can do with the mouse is also a method, and that is how it is tested.
"""

from html import escape
from itertools import groupby

import ipywidgets as widgets
from matplotlib.figure import Figure

from lib.interpreters.shapeassembly import Program, ProgramError, execute, parse
from lib.viewing.echo import Echo
from lib.viewing.naming import Knob, knobs, write_number
from lib.viewing.scene import ShapeView

STEP = 0.001  # of a slider
# A browser's slider moves to its nearest step by itself and reports that: so small a change is nobody's wish.
SNAP = 0.5 * STEP + 1e-9

STYLE = """<style>
.program-text textarea { font: 12px/1.45 monospace; white-space: pre; tab-size: 2; }
.program-sliders { border: 1px solid #d5d9e0; border-radius: 4px; }
.program-error pre { margin: 0; padding: 6px 8px; font: 12px/1.4 monospace; color: #8f1d14; background: #fdecea;
  border-left: 3px solid #c0392b; white-space: pre-wrap; word-break: normal; }
</style>"""


def describe_error(error: ProgramError, text: str) -> str:
    """The message, and where the error names a place the offending line with a caret under the token."""
    lines = text.splitlines()
    if not error.line or error.line > len(lines):
        return str(error)
    line = lines[error.line - 1].replace("\t", " ")  # one column a character, as columns are counted
    before = line[: (error.column or 1) - 1]
    cut = len(before) - len(before.lstrip())  # the indentation says nothing here
    mark = "^" * max(1, len(error.token)) if error.column else ""
    return f"{error}\n\n  {line[cut:].rstrip()}\n  {' ' * (len(before) - cut)}{mark}"


class ProgramEditor(widgets.VBox):
    """Text on the left, the shape on the right, sliders below.

    program  the last good program.      shape  what it makes.
    text     what stands in the editor.  error  why that is no program (a ProgramError), or None.
    Raises ProgramError when the program it starts from is none.
    """

    def __init__(self, program: str | Program, height: int = 400):
        text = program if isinstance(program, str) else program.to_text()
        self.program, self.error = parse(text), None
        self.shape = execute(self.program)
        self._echo = Echo()  # are we the ones who move the text or a slider now?
        self._view = ShapeView(self.shape, height=height)
        self._text = widgets.Textarea(text, layout={"width": "98%", "height": f"{height}px"})
        self._error = widgets.HTML()
        self._sliders: dict[str, widgets.FloatSlider] = {}
        self._panel = widgets.VBox(layout={"height": "230px", "overflow": "auto", "padding": "2px 6px"})
        self._text.observe(self._on_text, "value")
        self._rebuild_sliders()
        super().__init__(self._arrange())
        parts = {"editor": self, "text": self._text, "error": self._error, "sliders": self._panel}
        for name, part in parts.items():  # the names by which styles and tests find them in the page
            part.add_class(f"program-{name}")

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"ProgramEditor({len(self._sliders)} parameters, {len(self.shape.names)} boxes)"

    @property
    def text(self) -> str:
        return self._text.value

    @property
    def view(self) -> ShapeView:
        """The live 3D view."""
        return self._view

    def set_text(self, text: str) -> None:
        """Replace the program's text. A text that is no program sets `error`; program and shape stay as they were."""
        with self._echo:
            self._text.value = text
        self._read(text)

    def set_parameter(self, name: str, value: float) -> None:
        """Give the parameter of this name (`program.parameter_names()`) another value, in text, slider and shape.

        Raises KeyError for a name the program does not have, ValueError while the text is no program.
        """
        if self.error:
            raise ValueError(f"the text has an error, repair that first: {self.error}")
        if name not in self._sliders:
            raise KeyError(f"{name!r} is no parameter of this program")
        self.set_text(write_number(self.text, list(self._sliders).index(name), value))

    def figure(self, **options) -> Figure:
        """A still picture of the shape, for pages without a kernel; options of `lib.viewing.figure.show`."""
        return self._view.figure(**options)

    def _read(self, text: str) -> None:
        """Make program, shape, view and sliders follow a text."""
        try:
            program = parse(text)
            shape = execute(program)
        except ProgramError as error:
            self.error = error
        else:
            same, self.error = program.structure == self.program.structure, None
            self.program, self.shape = program, shape
            self._view.shape = shape
            self._move_sliders() if same else self._rebuild_sliders()
        self._tell()

    def _tell(self) -> None:
        """Show the error, if there is one; sliders would overwrite a text under repair, so they wait."""
        message = escape(describe_error(self.error, self.text)) if self.error else ""
        self._error.value = f"<pre>{message}</pre>" if message else ""
        if self._panel.children and self._waiting != bool(self.error):
            self._waiting = bool(self.error)
            for slider in self._sliders.values():
                slider.disabled = self._waiting

    def _move_sliders(self) -> None:
        with self._echo:
            for slider, value in zip(self._sliders.values(), self.program.parameters().tolist(), strict=True):
                if abs(slider.value - value) > SNAP:
                    slider.min, slider.max = min(slider.min, value), max(slider.max, value)
                    slider.value = value

    def _rebuild_sliders(self) -> None:
        old, self._waiting, self._sliders = list(self._sliders.values()), False, {}
        layout, style = widgets.Layout(width="98%"), widgets.SliderStyle(description_width="210px")
        groups = []
        for block, members in groupby(knobs(self.program), key=lambda knob: knob.block):
            sliders = [self._slider(knob, layout, style) for knob in members]
            columns = {"grid_template_columns": "repeat(auto-fill, minmax(400px, 1fr))", "flex": "0 0 auto"}
            groups += [widgets.HTML(f"<b>{escape(block)}</b>"), widgets.GridBox(sliders, layout=columns)]
        self._panel.children = groups
        for slider in old:
            slider.close()

    def _slider(self, knob: Knob, layout, style) -> widgets.FloatSlider:
        """One slider. Layout and style are shared: a widget more a slider would double the time to build them."""
        slider = widgets.FloatSlider(
            knob.value, min=knob.low, max=knob.high, step=STEP, description=knob.label, readout_format=".3f",
            layout=layout, style=style, tooltip=knob.name,
        )  # fmt: skip
        slider.observe(lambda change: self._on_slider(knob.name, change["new"]), "value")
        slider.add_class("program-slider")
        self._sliders[knob.name] = slider
        return slider

    def _on_text(self, change) -> None:
        if not self._echo:
            self._read(change["new"])

    def _on_slider(self, name: str, value: float) -> None:
        present = dict(zip(self._sliders, self.program.parameters().tolist(), strict=True))[name]
        if not self._echo and not self.error and abs(value - present) > SNAP:
            self.set_parameter(name, value)

    def _arrange(self) -> list[widgets.Widget]:
        saves = {
            "GLB": lambda: ("shape.glb", self.shape.to_glb()),
            "OBJ": lambda: ("shape.obj", self.shape.to_obj()),
            "program": lambda: ("program.txt", self.program.to_text()),
        }
        buttons = [self._button(kind, make) for kind, make in saves.items()]
        left = widgets.VBox([self._text, self._error], layout={"width": "44%"})
        right = widgets.VBox([self._view, widgets.HBox(buttons)], layout={"width": "56%"})
        return [widgets.HTML(STYLE), widgets.HBox([left, right]), self._panel]

    def _button(self, kind: str, make) -> widgets.Button:
        button = widgets.Button(description=f"Save {kind}", icon="download", layout={"width": "auto"})
        button.on_click(lambda _: self._view.download(*make()))
        button.add_class(f"save-{kind.lower()}")
        return button
