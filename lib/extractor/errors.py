"""What goes wrong with part graphs, said for people."""


class PartGraphError(ValueError):
    """A part graph that makes no sense, or cannot be read.

    file   the file it came from, "" for a graph made in memory
    node   path of the part, such as `chair/chair_back[1]/back_surface[0]`; "" for the whole graph
    found  what is wrong;  expected  what would be right
    """

    def __init__(self, found: str, expected: str = "", node: str = "", file: str = ""):
        self.found, self.expected, self.node, self.file = found, expected, node, str(file)
        place = ", ".join(filter(None, [self.file, node and f"part {node}"]))
        super().__init__(
            ": ".join(filter(None, [place, found])) + (f"; expected {expected}" if expected else "")
        )

    def __reduce__(self):  # travels between processes
        return type(self), (self.found, self.expected, self.node, self.file)

    def in_file(self, file: str) -> "PartGraphError":
        """The same error, saying which file it is about."""
        return type(self)(self.found, self.expected, self.node, file)


class PartGraphWarning(UserWarning):
    """A part graph was read, but something in it was odd: axes that were set straight, or labels nobody knows."""


class RejectedError(ValueError):
    """A part graph for which no valid program was found; `reason` is one of a few fixed words, the text says more."""

    def __init__(self, reason: str, detail: str):
        self.reason, self.detail = reason, detail
        super().__init__(f"{reason}: {detail}")

    def __reduce__(self):
        return type(self), (self.reason, self.detail)
