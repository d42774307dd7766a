"""Every committed notebook has been run from top to bottom, is small, says what it answers, and names no local path."""

import json
import re
from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
CHAPTERS = sorted(NOTEBOOKS.glob("[0-9][0-9]_*.ipynb"))
SOLUTIONS = sorted((NOTEBOOKS / "solutions").glob("*.ipynb"))
LARGEST_FILE = 2_000_000  # bytes
LONGEST_CELL = 25  # lines
LOCAL_PATH = re.compile(r"(?<![\w.:/])(/(home|root|Users|tmp|work|opt|private|mnt)/\w|[A-Z]:\\Users)")
EXERCISE = re.compile(r"\bExercise\b")


def text_of(source) -> str:
    """A notebook file keeps text as a string or as a list of lines."""
    return "".join(source)


def code_cells(notebook: dict) -> list[dict]:
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [cell for cell in cells if text_of(cell["source"]).strip()]


def output_texts(cell: dict) -> list[str]:
    """Every text of a code cell's outputs; pictures are left out."""
    texts = []
    for output in cell.get("outputs", []):
        texts += [text_of(output.get("text", "")), text_of(output.get("traceback", ""))]
        data = output.get("data", {})
        texts += [json.dumps(value) for kind, value in data.items() if not kind.startswith("image/")]
    return texts


def run_problems(notebook: dict) -> list[str]:
    counts = [cell["execution_count"] for cell in code_cells(notebook)]
    in_order = counts == list(range(1, len(counts) + 1))
    return [] if in_order else [f"cells were not run once each, top to bottom: {counts}"]


def path_problems(notebook: dict) -> list[str]:
    problems = []
    for i, cell in enumerate(notebook["cells"], start=1):
        for text in [text_of(cell["source"]), *output_texts(cell)]:
            problems += [f"cell {i} names a local path: {match[0]}…" for match in LOCAL_PATH.finditer(text)]
    return problems


def semicolon_problems(notebook: dict) -> list[str]:
    """nbval runs cells without a history, and IPython then hides nothing: the outputs would differ."""
    sources = [text_of(cell["source"]).rstrip() for cell in code_cells(notebook)]
    return [f"a cell ends with ';', end it with plt.show(): {s[-40:]!r}" for s in sources if s.endswith(";")]


def length_problems(notebook: dict) -> list[str]:
    lengths = [
        (i, len(text_of(cell["source"]).splitlines())) for i, cell in enumerate(notebook["cells"], start=1)
    ]
    code = {i for i, cell in enumerate(notebook["cells"], start=1) if cell["cell_type"] == "code"}
    return [
        f"cell {i} has {n} lines; move code to lib/" for i, n in lengths if i in code and n > LONGEST_CELL
    ]


def opening_problems(notebook: dict, number: str) -> list[str]:
    first = notebook["cells"][0] if notebook["cells"] else {"cell_type": "none", "source": ""}
    text = text_of(first["source"])
    if first["cell_type"] != "markdown" or not re.match(rf"# {number} · \S", text):
        return [f"the first cell should begin with '# {number} · Title'"]
    has_question = re.search(r"^[*_]*Question:[*_]* *\S", text, re.MULTILINE)
    return [] if has_question else ["the first cell should hold a line '**Question:** …'"]


def figure_problems(notebook: dict) -> list[str]:
    outputs = [output for cell in code_cells(notebook) for output in cell.get("outputs", [])]
    return [] if any("image/png" in output.get("data", {}) for output in outputs) else ["no figure"]


def problems_of(notebook: dict, number: str | None) -> list[str]:
    """Everything wrong with a notebook; `number` is None for solutions, which need no question and no figure."""
    checks = (run_problems, path_problems, length_problems, semicolon_problems)
    problems = [problem for check in checks for problem in check(notebook)]
    if number is not None:
        problems += opening_problems(notebook, number) + figure_problems(notebook)
    return problems


@pytest.mark.parametrize(
    "path", CHAPTERS + SOLUTIONS, ids=lambda path: path.relative_to(NOTEBOOKS).as_posix()
)
def test_notebook_is_clean(path):
    assert path.stat().st_size < LARGEST_FILE, "over 2 MB"
    number = path.name[:2] if path in CHAPTERS else None
    assert problems_of(json.loads(path.read_text(encoding="utf-8")), number) == []


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda path: path.name)
def test_exercises_have_solutions(path):
    text = "\n".join(
        text_of(cell["source"]) for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]
    )
    if EXERCISE.search(text):
        assert (NOTEBOOKS / "solutions" / path.name).exists(), f"write notebooks/solutions/{path.name}"


@pytest.mark.parametrize("path", SOLUTIONS, ids=lambda path: path.name)
def test_solutions_belong_to_a_chapter(path):
    assert (NOTEBOOKS / path.name).exists(), f"there is no notebooks/{path.name}"


def code(source, count=1, outputs=()):
    return {"cell_type": "code", "source": source, "execution_count": count, "outputs": list(outputs)}


OPENING = {"cell_type": "markdown", "source": ["# 01 · Title\n", "\n", "**Question:** why?"]}
FIGURE = code("plot()", outputs=[{"output_type": "display_data", "data": {"image/png": "/tmp/x"}}])
BAD = {
    "not run": [OPENING, FIGURE, code("x", None)],
    "run twice": [OPENING, FIGURE, code("x", 3)],
    "path in source": [OPENING, FIGURE, code("open('/home/me/x')", 2)],
    "path in output": [OPENING, FIGURE, code("x", 2, [{"output_type": "stream", "text": ["at /tmp/x"]}])],
    "path in result": [
        OPENING,
        FIGURE,
        code("x", 2, [{"output_type": "r", "data": {"text/plain": "'/root/x'"}}]),
    ],
    "long cell": [OPENING, FIGURE, code("x\n" * 26, 2)],
    "semicolon": [OPENING, FIGURE, code("plt.plot([1, 2]);\n", 2)],
    "other number": [{"cell_type": "markdown", "source": "# 02 · Title\n**Question:** why?"}, FIGURE],
    "no question": [{"cell_type": "markdown", "source": "# 01 · Title"}, FIGURE],
    "no figure": [OPENING, code("x")],
    "empty": [],
}


@pytest.mark.parametrize("cells", BAD.values(), ids=BAD)
def test_the_checker_says_no(cells):
    assert problems_of({"cells": cells}, "01") != []


def test_the_checker_says_yes():
    assert problems_of({"cells": [OPENING, FIGURE, code("x = 'a/tmp/b'", 2), code("", None)]}, "01") == []
