"""Checkers for the notebooks' exercises, a module a notebook.

A checker takes the reader's answer and returns one line: "not answered yet", a hint that starts with "not yet:", or
"ok". It never raises for a wrong answer.
"""

UNANSWERED = "not answered yet"
OK = "ok"


def hint(text: str) -> str:
    """A line that says what is missing."""
    return f"not yet: {text}"
