"""A live 3D view of a shape in a notebook cell: drag to turn it, scroll to come nearer, point at a part for its name.

    view = ShapeView(shape)     the last line of a cell shows it
    view.shape = other          moves the boxes; the camera stays, so that a change is seen as one

The drawing is done in the browser (three.js, `js/shape_view.js`, bundled so that nothing is loaded from elsewhere);
Python sends one small buffer of numbers per change. On a page without a kernel a live view is blank: put
`view.figure()` above it.
"""

from pathlib import Path

import anywidget
import numpy as np
import traitlets
from matplotlib.figure import Figure

from lib.viewing.figure import show

BUNDLE = Path(__file__).parent / "js" / "shape_view.bundle.js"


def box_buffer(shape) -> bytes:
    """The leaves of a shape as float32, 18 numbers a box: size 3, center 3, axes 9 (rows), colour 3 in 0..1."""
    boxes = shape.cuboids.detach()
    columns = [boxes.size, boxes.center, boxes.axes.reshape(len(boxes), 9)]
    numbers = [column.cpu().double().numpy() for column in columns]
    return np.hstack([*numbers, shape.colors / 255.0]).astype("<f4").tobytes()


class ShapeView(anywidget.AnyWidget):
    """A widget that shows one shape made of boxes (`shape.cuboids`, `shape.colors`, `shape.names`).

    height: of the view, CSS pixels; its width is that of the cell. `shape` is None until one is given.
    """

    _esm = BUNDLE
    boxes = traitlets.Bytes(b"").tag(sync=True)
    names = traitlets.List(traitlets.Unicode()).tag(sync=True)
    height = traitlets.Int(400).tag(sync=True)

    def __init__(self, shape=None, height: int = 400, **options):
        super().__init__(height=height, **options)
        self._shape = None
        if shape is not None:
            self.shape = shape

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"ShapeView({len(self.names)} boxes)"

    @property
    def shape(self):
        """The shape in view. Setting another one keeps the camera where it is."""
        return self._shape

    @shape.setter
    def shape(self, shape) -> None:
        with self.hold_sync():  # one message: names and boxes belong together
            self._shape, self.names, self.boxes = shape, list(shape.names), box_buffer(shape)

    def download(self, name: str, content: bytes | str) -> None:
        """Let the reader's browser save a file of this name."""
        content = content.encode() if isinstance(content, str) else content
        self.send({"download": name}, [content])

    def figure(self, **options) -> Figure:
        """A still picture of the same shape; `options` are those of `lib.viewing.figure.show`."""
        return show(self.shape, size=options.pop("size", 4.0), **options)
