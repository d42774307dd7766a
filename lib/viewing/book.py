"""The book: every notebook executed and rendered to pages that read well without a network.

    python -m lib.viewing.book            notebooks/[0-9][0-9]_*.ipynb -> build/book/index.html

    build/book/index.html                 what there is, how long it took, every figure
    build/book/00_tour.html               a chapter
    build/book/figures/00_tour_5_0.png    a figure: the same file in its chapter and on the index

A notebook runs in its own kernel, in memory: the committed file is never changed. A live widget has no life on a
page, so a line says where to find it; notebooks place a static figure above each. Formulas become MathML, which
browsers draw by themselves.
"""

import os
import re
import shutil
import sys
import time
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import nbformat
from jinja2 import pass_context
from latex2mathml.converter import convert as latex_to_mathml
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbconvert import HTMLExporter
from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath
from nbconvert.preprocessors import ExtractOutputPreprocessor
from nbformat import NotebookNode
from pygments.formatters import HtmlFormatter
from tqdm import tqdm

REPOSITORY = Path(__file__).parents[2]
STYLE = Path(__file__).with_suffix(".css")
CELL_TIMEOUT = 600  # seconds
WIDGET = "application/vnd.jupyter.widget-view+json"
WIDGET_NOTE = (
    '<p class="widget">A live widget stands here: <code>make lab</code> opens the notebook that has it.</p>'
)
PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><link rel="stylesheet" href="book.css"></head>
<body><main>
{body}
</main></body></html>
"""
INTRODUCTION = (
    "Neural networks write shapes as small programs. This book reads, runs, changes and measures the languages "
    "they write in, beginning with ShapeAssembly. Each chapter is a notebook, "
    "executed on this computer just now; <code>make lab</code> opens them for you to change."
)


@dataclass
class Chapter:
    """One notebook on its way into the book. `problem` is empty when every cell ran."""

    path: Path
    title: str = ""
    question: str = ""
    seconds: float = 0.0
    problem: str = ""
    body: str = ""
    figures: dict[str, bytes] = field(default_factory=dict)  # file name -> PNG

    @property
    def number(self) -> str:
        return self.path.stem[:2]

    @property
    def page(self) -> str:
        return self.path.stem + ".html"


def first_cell(notebook: NotebookNode) -> tuple[str, str]:
    """(title, question) from a first cell such as "# 01 · Title" and "**Question:** how ...?"; "" where absent."""
    text = notebook.cells[0].source if notebook.cells else ""
    title = re.search(r"^# +(?:\d\d *· *)?(.+)$", text, re.MULTILINE)
    question = re.search(r"^[*_]*Question:[*_]* *(.+?)[*_]*$", text, re.MULTILINE)
    return (title.group(1).strip() if title else "", question.group(1).strip() if question else "")


def execute(notebook: NotebookNode, folder: Path) -> str:
    """Run every cell of `notebook` in place, in a fresh kernel started in `folder`; return the problem, or ""."""
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    client = NotebookClient(
        notebook,
        timeout=CELL_TIMEOUT,
        store_widget_state=False,  # a page cannot use it
        resources={"metadata": {"path": str(folder)}},
        extra_arguments=[
            "--IPKernelApp.log_level=40"
        ],  # errors only: kernels warn about their local connection
    )
    try:
        client.execute()
    except CellExecutionError as error:
        return f"{failed_cell(notebook)}: {error.ename}: {error.evalue}"
    except CellTimeoutError:
        return f"{failed_cell(notebook)}: still running after {CELL_TIMEOUT} s"
    except DeadKernelError:
        return f"{failed_cell(notebook)}: Python died (out of memory?)"
    return ""


def failed_cell(notebook: NotebookNode) -> str:
    """Name the last code cell that was started, by its place and its first line."""
    code = [(i, cell) for i, cell in enumerate(notebook.cells, start=1) if cell.cell_type == "code"]
    place, cell = next(
        ((i, cell) for i, cell in code if any(each.output_type == "error" for each in cell.outputs)),
        next(((i, cell) for i, cell in code if cell.execution_count is None), code[-1]),
    )
    return f"cell {place} ({cell.source.strip().splitlines()[0]!r})"


class MathRenderer(IPythonRenderer):
    """Markdown in which $...$ and $$...$$ become MathML instead of waiting for a script from the network."""

    def block_math(self, body: str) -> str:
        return mathml(body, "block")

    def inline_math(self, body: str) -> str:
        return mathml(body, "inline")


def mathml(latex: str, display: str) -> str:
    """MathML for a formula; one that the converter does not know is shown as it was written."""
    try:
        return latex_to_mathml(latex, display=display)
    except Exception:  # the converter has no common error class
        return f"<code>{escape(latex)}</code>"


class PageExporter(HTMLExporter):
    """A notebook's cells as plain HTML, figures in files of their own, nothing loaded from elsewhere."""

    def __init__(self):
        super().__init__(template_name="basic", embed_images=True)
        names = "{unique_key}_{cell_index}_{index}{extension}"
        self.register_preprocessor(ExtractOutputPreprocessor(output_filename_template=names), enabled=True)

    @pass_context
    def markdown2html(self, context, source: str) -> str:
        attachments = context.get("cell", {}).get("attachments", {})
        folder = context["resources"]["metadata"]["path"]  # where a picture named in the text is looked for
        renderer = MathRenderer(escape=False, attachments=attachments, embed_images=True, path=folder)
        return MarkdownWithMath(renderer=renderer).render(source)


def render(chapter: Chapter, notebook: NotebookNode) -> None:
    """Fill in the chapter's body and figures from its executed notebook."""
    number = 0
    for output in (each for cell in notebook.cells for each in cell.get("outputs", [])):
        data = output.get("data", {})
        if WIDGET in data:
            output.data = NotebookNode({"text/html": WIDGET_NOTE})
        if "image/png" in data:
            number += 1
            alt = NotebookNode(alt=f"Figure {number} of chapter {chapter.number}, {chapter.title}")
            output.metadata["image/png"] = NotebookNode(output.metadata.get("image/png", {})) | alt
    about = {"name": chapter.title, "path": str(chapter.path.parent)}
    resources = {"unique_key": chapter.path.stem, "output_files_dir": "figures", "metadata": about}
    chapter.body, made = PageExporter().from_notebook_node(notebook, resources)
    chapter.figures = {Path(name).name: content for name, content in made["outputs"].items()}


def make_chapter(path: Path) -> Chapter:
    """Read, execute and render one notebook. A failure is told in `problem`; what ran is still rendered."""
    chapter = Chapter(path, title=path.stem)
    started = time.monotonic()
    try:
        notebook = nbformat.read(path, as_version=4)
        title, chapter.question = first_cell(notebook)
        chapter.title = title or path.stem
        chapter.problem = execute(notebook, path.parent)
        render(chapter, notebook)
    except Exception as error:  # whatever one notebook does, the others still run
        chapter.problem = f"{type(error).__name__}: {error}"
    chapter.seconds = time.monotonic() - started
    return chapter


def table_row(chapter: Chapter) -> str:
    took = f"{chapter.seconds:.0f} s" if not chapter.problem else '<strong class="problem">failed</strong>'
    link = f'<a href="{chapter.page}">{escape(chapter.title)}</a>'
    return (
        f"<tr><td>{chapter.number}</td><td>{link}</td><td>{escape(chapter.question)}</td><td>{took}</td></tr>"
    )


def gallery(chapter: Chapter) -> str:
    """One linked thumbnail for each figure, the very file its chapter shows."""
    return "\n".join(
        f'<a href="{chapter.page}"><img loading="lazy" src="figures/{name}" alt="A figure of chapter {chapter.number}">'
        f"<span>{chapter.number} · {escape(chapter.title)}</span></a>"
        for name in chapter.figures
    )


def index_page(chapters: list[Chapter]) -> str:
    """The whole index: introduction, table of chapters, gallery."""
    rows, figures = "\n".join(map(table_row, chapters)), "\n".join(map(gallery, chapters))
    body = f"""<h1>Shape Programs</h1>
<p>{INTRODUCTION}</p>
<table class="chapters"><thead><tr><th></th><th>Notebook</th><th>The question it answers</th><th>Took</th></tr></thead>
<tbody>{rows}</tbody></table>
<h2>Every figure</h2>
<div class="gallery">{figures}</div>"""
    return PAGE.format(title="Shape Programs", body=body)


def chapter_page(chapter: Chapter, before: Chapter | None, after: Chapter | None) -> str:
    """A chapter with its way back and on, and its problem on top if it has one."""
    links = ['<a href="index.html">Contents</a>']
    links += [f'<a href="{before.page}">← {escape(before.title)}</a>'] if before else []
    links += [f'<a href="{after.page}">{escape(after.title)} →</a>'] if after else []
    way = f"<nav>{' '.join(links)}</nav>"
    problem = (
        f'<p class="problem">This notebook stopped at {escape(chapter.problem)}</p>'
        if chapter.problem
        else ""
    )
    return PAGE.format(
        title=f"{chapter.number} · {escape(chapter.title)}", body=f"{way}{problem}{chapter.body}{way}"
    )


def write_book(chapters: list[Chapter], folder: Path) -> Path:
    """Write all pages and figures; an older book in `folder` is replaced. Returns the index's path."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "figures").mkdir(parents=True)
    highlighting = HtmlFormatter(style="default").get_style_defs(".highlight")
    (folder / "book.css").write_text(STYLE.read_text(encoding="utf-8") + highlighting, encoding="utf-8")
    for before, chapter, after in zip([None, *chapters], chapters, [*chapters[1:], None], strict=False):
        (folder / chapter.page).write_text(chapter_page(chapter, before, after), encoding="utf-8")
        for name, content in chapter.figures.items():
            (folder / "figures" / name).write_bytes(content)
    index = folder / "index.html"
    index.write_text(index_page(chapters), encoding="utf-8")
    return index


def make_book(notebooks: Path, folder: Path) -> int:
    """Execute and render every numbered notebook; print what happened. Returns 0 when every cell of all ran, else 1."""
    paths = sorted(notebooks.glob("[0-9][0-9]_*.ipynb"))
    if not paths:
        print(f"no notebook called NN_name.ipynb in {notebooks}", file=sys.stderr)
        return 1
    os.environ["PYTHONPATH"] = str(REPOSITORY)  # kernels start in notebooks/; lib/ is one level up
    chapters = []
    for path in (bar := tqdm(paths, unit="notebook")):
        bar.set_description(path.stem)
        chapters.append(make_chapter(path))
    index = write_book(chapters, folder)
    print(report(chapters, index))
    return 1 if any(chapter.problem for chapter in chapters) else 0


def report(chapters: list[Chapter], index: Path) -> str:
    """What a person wants to know at the end: times, problems, where the book is, what next."""
    lines = [f"  {chapter.path.stem:<32} {chapter.seconds:6.1f} s" for chapter in chapters]
    lines += [f"FAILED {each.path.name}, {each.problem}" for each in chapters if each.problem]
    figures = sum(len(chapter.figures) for chapter in chapters)
    return "\n".join(
        [
            *lines,
            f"The book, {figures} figures: {index}",
            "Open it in a browser. To change and run the notebooks yourself: make lab (JupyterLab).",
        ]
    )


if __name__ == "__main__":
    raise SystemExit(make_book(REPOSITORY / "notebooks", REPOSITORY / "build" / "book"))
