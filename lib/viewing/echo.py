"""Telling apart who moved a slider: the reader, or our own code."""


class Echo:
    """`with echo:` around our own changes of widgets; `if echo:` in their observers: this is our echo, not a wish."""

    def __init__(self):
        self._depth = 0

    def __enter__(self) -> None:
        self._depth += 1

    def __exit__(self, *_) -> None:
        self._depth -= 1

    def __bool__(self) -> bool:
        return self._depth > 0
