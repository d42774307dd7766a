"""A CSG-Stump of the plane whose matrices are switches on a picture of its three layers: click, and all of it follows.

    widget = StumpWidget(stump)          the last line of a cell shows it
    widget.toggle("F2 in S1")            what a click does; "not F2" is a cell of W_C, "S1 in T" one of W_U
    widget.stump                         the present stump, which `observe` can watch and which can be set

The picture is that of `layers_figure`. The browser (`js/stump.js`, which loads nothing from elsewhere) has the pixels
of the primitives and combines them itself, so it need not wait; Python follows with the stump and its text.
"""

from collections.abc import Sequence
from pathlib import Path

import anywidget
import numpy as np
import torch
import traitlets
from matplotlib.figure import Figure

from lib.interpreters.quoting import quoted
from lib.interpreters.stump import Stump, parse
from lib.interpreters.stump.writing import primitive_text
from lib.viewing.stump_figures import MOST, layers_figure
from lib.viewing.stump_pictures import color_of, picture_window, pictures_of

JS = Path(__file__).parent / "js"
RESOLUTION = 184  # of the pictures: pixels across, a multiple of 8; as many as the shape has on the page
EXAMPLES = "one such as 'not F1', 'F1 in S1' or 'S1 in T'"


class StumpWidget(anywidget.AnyWidget):
    """The three layers of a stump of the plane, with a switch for each cell of its matrices.

    It starts from a Stump or its text. `reset` goes back to that, `undo` to what was before the last change.
    stump   the present one. Setting another one begins anew: there is nothing to undo then.
    text    that, written. Setting another text is setting another stump.
    cells   all switches as "0" and "1": W_C, then W_I row by row, then W_U.    names   what each of them is called.
    window  lowest and highest x and y to show; that of `picture_window` if left out.
    Raises ProgramError for a bad text, TypeError for what is no stump, and ValueError for one of space or with more
    than MOST primitives or nodes.
    """

    _esm = JS / "stump.js"
    _css = JS / "stump.css"
    stump = traitlets.Instance(Stump)
    cells = traitlets.Unicode().tag(sync=True)
    past = traitlets.List(traitlets.Unicode()).tag(sync=True)  # cells as they were, the latest last
    text = traitlets.Unicode().tag(sync=True)
    board = traitlets.Dict().tag(
        sync=True
    )  # what the page draws once: sizes, names, colours, the first cells
    inside = traitlets.Bytes().tag(sync=True)  # the primitives' pictures, see `_packed`

    def __init__(self, stump: Stump | str, window: Sequence | None = None, **options):
        super().__init__(**options)
        self._window = window
        stump = parse(stump) if isinstance(stump, str) else stump
        if not isinstance(stump, Stump):
            raise TypeError(f"found a {type(stump).__name__}; expected a Stump or its text")
        self.stump = stump

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"StumpWidget({self.stump!r})"

    @property
    def names(self) -> list[str]:
        """What `toggle` takes: "not F1" …, "F1 in S1" …, "S1 in T" …."""
        rows, columns = self.stump.intersection.shape
        primitives, nodes = [f"F{k + 1}" for k in range(rows)], [f"S{c + 1}" for c in range(columns)]
        joined = [f"{primitive} in {node}" for primitive in primitives for node in nodes]
        return [
            *(f"not {primitive}" for primitive in primitives),
            *joined,
            *(f"{node} in T" for node in nodes),
        ]

    def toggle(self, name: str) -> None:
        """Flip one cell of a matrix. Raises ValueError where there is no such cell."""
        if name not in self.names:
            raise ValueError(f"there is no cell {quoted(str(name))}; expected {EXAMPLES}")
        place = self.names.index(name)
        self._become(self.cells[:place] + "10"[int(self.cells[place])] + self.cells[place + 1 :])

    def undo(self) -> None:
        """Take back the last change. Raises ValueError when there is none."""
        if not self.past:
            raise ValueError("nothing to undo")
        with self.hold_sync():
            *self.past, self.cells = self.past

    def reset(self) -> None:
        """Back to the first matrices; `undo` brings the present ones back."""
        if self.cells != self.board["start"]:
            self._become(self.board["start"])

    def figure(self) -> Figure:
        """The same as a still picture, for pages without a kernel."""
        return layers_figure(self.stump, window=self._window)

    def _become(self, cells: str) -> None:
        with self.hold_sync():
            self.past, self.cells = [*self.past, self.cells], cells

    @traitlets.validate("stump")
    def _check_stump(self, proposal) -> Stump:
        return _drawable(proposal.value)

    @traitlets.validate("text")
    def _check_text(self, proposal) -> str:
        return _drawable(parse(proposal.value)).to_text()

    @traitlets.observe("text")
    def _on_text(self, change) -> None:
        """Nothing to do where the text has followed the stump."""
        if change.new != self.stump.to_text():
            self.stump = parse(change.new)

    @traitlets.validate("cells")
    def _check_cells(self, proposal) -> str:
        if len(proposal.value) != len(self.names) or not set(proposal.value) <= set("01"):
            raise ValueError(f"found cells {quoted(proposal.value)}; expected {len(self.names)} of 0 and 1")
        return proposal.value

    @traitlets.observe("stump")
    def _on_stump(self, change) -> None:
        """Either a cell was changed, and the stump has followed; or somebody set another stump."""
        follows = isinstance(change.old, Stump) and change.old.primitives is change.new.primitives
        with self.hold_sync():
            self.text = self.stump.to_text()
            if not follows or self.cells != _cells_of(self.stump):
                self._load()

    def _load(self) -> None:
        """Send the page another stump."""
        window = picture_window(self.stump) if self._window is None else self._window
        rows = [
            {"name": primitive.name, "color": color_of(primitive), "title": primitive_text(primitive)}
            for primitive in self.stump.primitives
        ]
        cells, columns = _cells_of(self.stump), len(self.stump.union)
        self.inside = _packed(pictures_of(self.stump, RESOLUTION, window).primitives)
        self.board = {
            "rows": rows,
            "columns": columns,
            "names": self.names,
            "side": RESOLUTION,
            "start": cells,
        }
        self.past, self.cells = [], cells

    @traitlets.observe("cells")
    def _on_cells(self, change) -> None:
        if change.new != _cells_of(self.stump):
            rows, columns = self.stump.intersection.shape
            bits = torch.tensor([cell == "1" for cell in change.new])
            w_c, w_i, w_u = bits.split([rows, rows * columns, columns])
            self.stump = Stump(self.stump.primitives, w_c, w_i.view(rows, columns), w_u)


def _drawable(stump: Stump) -> Stump:
    if stump.dimensions != 2:
        raise ValueError("found a stump of space; expected one of the plane")
    if max(stump.intersection.shape) > MOST:
        rows, columns = stump.intersection.shape
        raise ValueError(f"found {rows} primitives and {columns} nodes; expected at most {MOST} of each")
    return stump


def _cells_of(stump: Stump) -> str:
    """All cells of the three matrices in the order of `StumpWidget.cells`."""
    bits = torch.cat([matrix.flatten() for matrix in stump.matrices])
    return "".join("01"[bit] for bit in bits.tolist())


def _packed(images: np.ndarray) -> bytes:
    """Bit k of byte b of a picture is its pixel 8 b + k, row by row."""
    return np.packbits(images, axis=-1, bitorder="little").tobytes()
