"""What the checkers of the exercises may say."""


def hints(verdict: str) -> bool:
    """Whether it is a hint, and short enough to be read."""
    return verdict.startswith("not yet: ") and len(verdict) < 400
