"""A CSG program put together with the mouse: choose a primitive, click where it goes, combine what is on the stack.

    playground = Playground()                    the last line of a cell shows it
    playground = Playground(target=picture)      with a picture to match

Python runs the program, the browser (`js/playground.js`, which loads nothing from elsewhere) only draws the bits that
it is sent. Everything a reader can do with the mouse is also a method; a method raises ProgramError for what cannot be
done, a click shows its message. A half-written program is nothing wrong: it leaves several shapes on the stack.
"""

from collections.abc import Sequence
from pathlib import Path

import anywidget
import numpy as np
import traitlets
from matplotlib.figure import Figure

from lib.interpreters.checks import whole
from lib.interpreters.csg import (
    KINDS,
    OPERATIONS,
    Picture,
    Primitive,
    Program,
    ProgramError,
    trace,
    vocabulary_of,
)  # fmt: skip
from lib.interpreters.csg.primitives import draw
from lib.interpreters.csg.program import STOP, Operation, Statement
from lib.interpreters.csg.tracing import missing, parse_start
from lib.interpreters.csg.vocabulary import CENTERS, SIZES, WORDS
from lib.interpreters.quoting import quoted
from lib.viewing.canvas import image_of, overlap
from lib.viewing.running import MEANING, show_stack

JS = Path(__file__).parent / "js"
CONTEXT = 36  # letters of a long text shown before and after the place of an error
# What the browser may ask for, and how many values may come with it.
ACTIONS = {"push": (1,), "undo": (0,), "redo": (0,), "clear": (0,), "load": (1,), "look": (0, 1)}
TOKEN = "a primitive such as c(32,32,8), or + * -"  # what can be pushed


class Playground(anywidget.AnyWidget):
    """A program of the plane under construction; its stack, and the picture on top of it.

    It starts from a text, half written or whole, or from a Program.
    text     what is written so far.       program  that as a Program, or None while it is half written.
    tokens   its tokens, as texts.         stack    the pictures on the stack, bottom first.
    iou      of the top with the target, or None.
    Raises ProgramError when the text it starts from cannot be the start of a program.
    """

    _esm = JS / "playground.js"
    _css = JS / "playground.css"
    kind = traitlets.Enum(("c", "s", "t"), "c").tag(sync=True)  # of the primitive that a click adds
    size = traitlets.Enum(tuple(SIZES), 16).tag(sync=True)
    # What the page says: tokens, messages, which buttons work and why not.
    view = traitlets.Dict().tag(sync=True)
    pictures = traitlets.Bytes(b"").tag(sync=True)  # the stack in view, top first, 512 bytes each
    # The primitive at each of the 7 x 7 centers, 512 bytes each.
    stencils = traitlets.Bytes(b"").tag(sync=True)
    # For each center why the primitive cannot stand there; "" where it can.
    refused = traitlets.List().tag(sync=True)
    goal = traitlets.Bytes(b"").tag(sync=True)

    def __init__(self, text: str | Program = "", target=None, **options):
        self._past: list[tuple[Statement, ...]] = []
        self._future: list[tuple[Statement, ...]] = []
        self._statements = _in_the_plane(_written(text))
        self._steps = trace(self._statements)
        self._target = None if target is None else image_of(target)
        super().__init__(goal=b"" if target is None else _packed(self._target), **options)
        self.on_msg(self._on_message)
        self.observe(self._choose, ("kind", "size"))
        self._choose()
        self.look()

    def __repr__(self) -> str:  # what a page shows where widgets do not live
        return f"Playground({self.text!r})"

    @property
    def text(self) -> str:
        return "".join(self.tokens)

    @property
    def tokens(self) -> list[str]:
        return [str(statement) for statement in self._statements]

    @property
    def program(self) -> Program | None:
        return self.stack[0].program if len(self.stack) == 1 else None

    @property
    def stack(self) -> tuple[Picture, ...]:
        return self._steps[-1].stack if self._steps else ()

    @property
    def iou(self) -> float | None:
        if self._target is None or not self.stack:
            return None
        return overlap(image_of(self.stack[-1]), self._target)

    def push(self, token: str) -> None:
        """Add a token: one of the networks' primitives such as "c(32,32,8)", or + * -. Else raises ProgramError."""
        if not isinstance(token, str):
            raise ProgramError(f"the token is a {type(token).__name__}", expected=TOKEN)
        if token == STOP:
            found = f"'{STOP}' ends what a network writes; here a program ends with its last token"
            raise ProgramError(found, expected=TOKEN)
        statements = parse_start(token) if token not in OPERATIONS else (Operation(token),)
        if len(statements) != 1:
            raise ProgramError(f"{len(statements)} tokens in {quoted(token)}", expected="one")
        reason = self._why_not(statements[0])
        if reason:
            raise ProgramError(reason)
        self._become(self._statements + statements)

    def load(self, text: str | Program) -> None:
        """Replace the program, also by a half-written one. Raises ProgramError for what cannot begin a program."""
        self._become(_in_the_plane(_written(text)))

    def clear(self) -> None:
        """Start anew; `undo` brings the program back."""
        self._become(())

    def undo(self) -> None:
        """Take back the last change. Raises ProgramError when there is none."""
        self._travel(self._past, self._future, "undo")

    def redo(self) -> None:
        """Make the change again that was taken back. Raises ProgramError when there is none."""
        self._travel(self._future, self._past, "redo")

    def look(self, place: int | None = None) -> None:
        """Show the stack as it was after the token at a place, counted from 0; after the last one if left out."""
        last = len(self._steps) - 1
        shown = last if place is None else whole(place)
        if place is not None and shown not in range(last + 1):
            some = f"a place from 0 to {last}" if self._steps else "no place: the program is empty"
            raise ProgramError(f"there is no token {place!r:.40}", expected=some)
        self._show(shown)

    def figure(self) -> Figure:
        """The stack after each token as a still picture, for pages without a kernel."""
        return show_stack(self._statements)

    def _become(self, statements: tuple[Statement, ...]) -> None:
        if statements != self._statements:
            steps = trace(statements)
            self._past.append(self._statements)
            self._future.clear()
            self._statements, self._steps = statements, steps
        self.look()

    def _travel(self, here: list, there: list, what: str) -> None:
        if not here:
            raise ProgramError(f"nothing to {what}")
        there.append(self._statements)
        self._statements = here.pop()
        self._steps = trace(self._statements)
        self.look()

    def _why_not(self, statement: Statement) -> str:
        """Why a token cannot come next; empty where it can."""
        if isinstance(statement, Operation) and len(self.stack) < 2:
            shapes = "1 shape" if self.stack else "no shape"
            return f"'{statement}' combines two shapes, the stack holds {shapes}"
        if isinstance(statement, Primitive) and str(statement) not in vocabulary_of(2).texts:
            return f"{statement} is no word of the networks: {_misfit(statement)}"
        return ""

    def _choose(self, _=None) -> None:
        """Send the chosen primitive at every center, for the preview under the mouse."""
        choices = [Primitive(self.kind, (x, y, self.size)) for y in CENTERS for x in CENTERS]
        with self.hold_sync():
            self.refused = [self._why_not(choice) for choice in choices]
            self.stencils = draw(choices, 2).numpy().astype("<i8").tobytes()

    def _show(self, place: int, error: ProgramError | None = None, typed: str | None = None) -> None:
        """Tell the page everything, in one message."""
        self._shown = place
        stack = self._steps[place].stack[::-1] if self._steps else ()
        with self.hold_sync():
            self.pictures = b"".join(shape.words.numpy().astype("<i8").tobytes() for shape in stack)
            self.view = {
                "tokens": self.tokens,
                "shown": place,
                "entries": [_plain(shape.program.infix()) for shape in stack],
                "operations": {symbol: self._why_not(Operation(symbol)) for symbol in OPERATIONS},
                "meaning": {symbol: f"{name}: {MEANING[symbol]}" for symbol, name in OPERATIONS.items()},
                "undo": bool(self._past),
                "redo": bool(self._future),
                "status": self._status(),
                "valid": self.program is not None,
                "iou": self.iou,
                "error": _explain(error, typed) if error else None,
            }

    def _status(self) -> str:
        """Is it a program, and what is missing?"""
        if not self._statements:
            return "Empty: click a point of the canvas to put a primitive on the stack."
        lacking = missing(self._statements)
        if lacking:
            operations = "one more operation" if lacking == 1 else f"{lacking} more operations"
            return f"{len(self.stack)} shapes on the stack: {operations}, to leave one."
        if self.iou == 1:
            return f"A valid program of {_count(self._statements)}, and it draws the target to the pixel!"
        return f"A valid program of {_count(self._statements)}."

    def _on_message(self, _, message: dict, buffers: Sequence[bytes] = ()) -> None:
        """What the browser asks for. Whatever is wrong with it is said on the page."""
        action, values = _asked(message)
        if action not in ACTIONS:
            return
        try:
            _check_values(action, values)
            getattr(self, action)(*values)
        except ProgramError as error:
            self._show(self._shown, error, values[0] if action == "load" and error.column else None)


def _asked(message) -> tuple[str, object]:
    """What a message asks for, "" where it does not say so, and the values that come with it."""
    asked = message if isinstance(message, dict) else {}
    action = asked.get("do")
    return action if isinstance(action, str) else "", asked.get("with", [])


def _check_values(action: str, values) -> None:
    """Raises ProgramError unless as many values come with an action as it takes."""
    if not isinstance(values, (list, tuple)):
        raise ProgramError(f"{action} came with a {type(values).__name__}", expected="a list of values")
    if len(values) not in ACTIONS[action]:
        expected = " or ".join(map(str, ACTIONS[action]))
        raise ProgramError(f"{action} came with {len(values)} values", expected=expected)


def _written(text: str | Program) -> tuple[Statement, ...]:
    """The statements of a Program, or of a text that may be half written. Raises ProgramError for what begins none."""
    return text.statements if isinstance(text, Program) else parse_start(text)


def _misfit(primitive: Primitive) -> str:
    """Why a primitive is not in the vocabulary of the plane."""
    if primitive.dimensions != 2:
        return "it is in space"
    x, y, size = primitive.numbers
    if x in CENTERS and y in CENTERS and size in SIZES:
        return f"the {KINDS[primitive.kind].name} would stick out of the canvas"
    return WORDS


def _count(statements: tuple[Statement, ...]) -> str:
    return f"{len(statements)} token{'s' if len(statements) > 1 else ''}"


def _plain(infix: str) -> str:
    """An infix text without the outermost brackets."""
    return infix[1:-1] if infix.startswith("(") else infix


def _packed(image: np.ndarray) -> bytes:
    """512 bytes: bit k of byte b of a row is the pixel x = 8 b + k. Raises ValueError unless it is 64 x 64."""
    if image.shape != (64, 64):
        raise ValueError(f"the target is {image.shape}; expected (64, 64)")
    return np.packbits(image, axis=1, bitorder="little").tobytes()


def _in_the_plane(statements: tuple[Statement, ...]) -> tuple[Statement, ...]:
    """The statements themselves. Raises ProgramError for those of space."""
    for place, statement in enumerate(statements):
        if isinstance(statement, Primitive) and statement.dimensions != 2:
            raise ProgramError(
                f"'{statement}' is in space", place, str(statement), "c(x,y,r), s(x,y,r) or t(x,y,r)"
            )
    return statements


def _explain(error: ProgramError, typed: str | None) -> dict:
    """The message, the typed text around the bad token with a mark under it, and where in the text it stands."""
    start = (error.column or 1) - 1
    end = start + max(1, len(error.token))
    if typed is None or not error.column:
        return {"message": str(error), "excerpt": "", "start": 0, "end": 0}
    typed, first = " ".join(typed.splitlines()), max(0, start - CONTEXT)
    before = "…" if first else ""
    line = before + typed[first : end + CONTEXT] + ("…" if end + CONTEXT < len(typed) else "")
    mark = " " * (len(before) + start - first) + "^" * (end - start)
    return {"message": str(error), "excerpt": f"{line}\n{mark}", "start": start, "end": end}
