"""The stump widget in a real browser: a click flips a cell, all pictures follow, and the text can be taken along."""

import json
from statistics import median

import pytest

from lib.interpreters.stump import parse
from lib.viewing.stump_pictures import pictures_of
from lib.viewing.stump_widget import RESOLUTION
from tests.browser import CHROMIUM_FLAGS, ROOT, jupyterlab, playwright_and_chromium
from tests.test_browser import KERNEL_IDLE, PATIENCE, START_ALL_CELLS, listen
from tests.test_browser_playground import notebook

pytestmark = pytest.mark.browser

PLATE = """F1 = square(half=(0.5, 0.3))
F2 = not circle(radius=0.15, translation=(-0.2, 0.0))
F3 = triangle(left=0.3, right=0.3, height=0.4, translation=(0.1, 0.2))
S1 = F1 & F2
S2 = F3
T = S1
"""
CELLS = [
    f"from lib.viewing.stump_widget import StumpWidget\nwidget = StumpWidget({PLATE!r})\nwidget",
]
LARGE = "".join(
    [*(f"F{k} = circle(radius=0.2, translation=({k / 10}, {k % 3 / 10}))\n" for k in range(1, 13)),
     *(f"S{c} = F{max(1, c - 1)} & F{c + (c == 1)}\n" for c in range(1, 13)),
     f"T = {' | '.join(f'S{c}' for c in range(1, 13))}\n"]
)  # fmt: skip
WATCH = """(root) => {
    window.clicked = window.drawn = 0;
    document.addEventListener("click", () => { window.clicked = performance.now() }, true);
    new MutationObserver(() => { window.drawn = performance.now() })
        .observe(root, { attributes: true, attributeFilter: ["data-draws"] });
}"""
ON = """(canvas) => {
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let on = 0;
    for (let k = 3; k < data.length; k += 4) on += data[k] > 0;
    return on;
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A notebook with one widget, after its first cell has run."""
    sync_api, chromium = playwright_and_chromium()
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "stump.ipynb").write_text(json.dumps(notebook(CELLS)))
    with (
        jupyterlab(folder, tmp_path_factory.mktemp("lab")) as address,
        sync_api.sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        context = browser.new_context(viewport={"width": 1200, "height": 1000})
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        listen(page)
        page.goto(address.format(notebook="stump.ipynb"))
        page.wait_for_selector(".jp-Notebook")
        page.wait_for_function(KERNEL_IDLE)
        page.evaluate(START_ALL_CELLS)
        page.wait_for_function("() => window.cellsRun !== null")
        page.locator(".stump-widget[data-draws]").wait_for()
        yield page
        browser.close()


@pytest.fixture
def widget(page):
    """The widget with the matrices of the beginning."""
    root = page.locator(".stump-widget")
    root.scroll_into_view_if_needed()
    reset = root.get_by_role("button", name="Reset")
    if reset.is_enabled():
        reset.click()
        wait_for_text(root, PLATE)
    return root


def switch(root, name: str):
    return root.get_by_role("button", name=name, exact=True)


def wait_for_text(root, text: str) -> None:
    """Until Python has followed."""
    root.page.wait_for_function("text => document.querySelector('.stump-text').value === text", arg=text)


def drawn(root) -> dict[str, int]:
    """How many pixels each picture of a node has."""
    names = [canvas.get_attribute("aria-label") for canvas in root.locator("canvas").all()]
    return dict(zip(names, [canvas.evaluate(ON) for canvas in root.locator("canvas").all()]))


def expected(text: str) -> dict[str, int]:
    """The same, computed by Python."""
    pictures = pictures_of(parse(text), RESOLUTION)
    groups = {"O": pictures.primitives, "F": pictures.complements, "S": pictures.nodes}
    counts = {
        f"{letter}{k + 1}": int(p.sum()) for letter, group in groups.items() for k, p in enumerate(group)
    }
    return counts | {"T, the shape": int(pictures.shape.sum())}


def test_all_pictures_are_those_that_python_computes(widget):
    assert drawn(widget) == expected(PLATE)
    (ROOT / "build").mkdir(exist_ok=True)
    widget.page.screenshot(path=ROOT / "build" / "browser_stump.png")


def test_a_click_changes_the_shape_and_the_stump(widget, capsys):
    widget.evaluate(WATCH)
    times = []
    changes = [("F2 = not circle", "F2 = circle", "not F2"), ("T = S1", "T = S1 | S2", "S2 in T"),
               ("S2 = F3", "S2 = F1 & F3", "F1 in S2"), ("S1 = F1 & F2", "S1 = F2", "F1 in S1")]  # fmt: skip
    text = PLATE
    for old, new, name in changes:
        text = text.replace(old, new)
        switch(widget, name).click()
        widget.page.wait_for_function("() => window.drawn > window.clicked")
        times.append(widget.page.evaluate("window.drawn - window.clicked"))
        assert drawn(widget) == expected(text)
        wait_for_text(widget, text)
    with capsys.disabled():
        print(
            f"\n  click to picture: median {median(times):.0f} ms, slowest {max(times):.0f} ms of {len(times)}"
        )
    assert switch(widget, "S2 in T").get_attribute("aria-pressed") == "true"
    widget.page.screenshot(path=ROOT / "build" / "browser_stump_changed.png")


def test_undo_and_reset(widget):
    undo, reset = (widget.get_by_role("button", name=name) for name in ("Undo", "Reset"))
    assert reset.is_disabled()
    switch(widget, "S1 in T").click()
    assert "T is nothing" in widget.locator(".stump-status").inner_text()
    switch(widget, "F3 in S1").click()
    wait_for_text(widget, PLATE.replace("F2\n", "F2 & F3\n").replace("T = S1", "T = nothing"))
    undo.click()
    wait_for_text(widget, PLATE.replace("T = S1", "T = nothing"))
    assert drawn(widget) == expected(PLATE.replace("T = S1", "T = nothing"))
    reset.click()
    wait_for_text(widget, PLATE)
    assert drawn(widget) == expected(PLATE)
    undo.click()  # a reset, too, can be taken back
    wait_for_text(widget, PLATE.replace("T = S1", "T = nothing"))


def test_keys_walk_from_switch_to_switch(widget):
    page = widget.page
    switch(widget, "not F1").focus()
    for key in ("ArrowRight", "ArrowDown", "ArrowRight", "Enter"):
        page.keyboard.press(key)
    wait_for_text(widget, PLATE.replace("S2 = F3", "S2 = F2 & F3"))
    for key in ("ArrowDown", "ArrowDown", "ArrowDown", "Space"):  # the last one leads nowhere
        page.keyboard.press(key)
    wait_for_text(widget, PLATE.replace("S2 = F3", "S2 = F2 & F3").replace("T = S1", "T = S1 | S2"))
    page.keyboard.press("Backspace")
    wait_for_text(widget, PLATE.replace("S2 = F3", "S2 = F2 & F3"))
    assert page.locator(".jp-Notebook .jp-Cell").count() == 1, "a key reached the notebook"


def test_the_text_is_copied(widget):
    switch(widget, "F3 in S2").click()
    empty = PLATE.replace("S2 = F3", "S2 = everything")
    wait_for_text(widget, empty)
    widget.get_by_role("button", name="Copy as text").click()
    widget.get_by_role("button", name="Copied").wait_for()
    assert widget.page.evaluate("navigator.clipboard.readText()") == empty


def run_cell(page, source: str) -> None:
    """Put a cell below the others and run it."""
    page.evaluate(f"""() => {{
        const {{ content }} = window.jupyterapp.shell.currentWidget;
        const place = content.model.sharedModel.cells.length;
        content.model.sharedModel.insertCell(place, {{ cell_type: "code", source: {json.dumps(source)} }});
        content.activeCellIndex = place;
        window.jupyterapp.commands.execute("notebook:run-cell");
    }}""")


def test_python_flips_a_cell_too(widget):
    run_cell(widget.page, "widget.toggle('not F2')")
    wait_for_text(widget, PLATE.replace("F2 = not", "F2 ="))
    assert drawn(widget) == expected(PLATE.replace("F2 = not", "F2 ="))
    assert switch(widget, "not F2").get_attribute("aria-pressed") == "false"


def test_dark_pages_keep_light_pictures(widget):
    page = widget.page
    theme = "() => window.jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})"
    page.evaluate(theme)
    page.locator("body[data-jp-theme-light=false]").wait_for(state="attached")
    switch(widget, "S2 in T").click()
    page.screenshot(path=ROOT / "build" / "browser_stump_dark.png")
    background = "canvas => getComputedStyle(canvas).backgroundColor"
    assert widget.locator("canvas").first.evaluate(background) == "rgb(255, 255, 255)"


@pytest.mark.parametrize("text", ["F1 = circle(radius=1.0)\nT = nothing\n", LARGE], ids=["no nodes", "large"])
def test_another_stump_is_drawn(page, text, capsys):
    widget = page.locator(".stump-widget")
    run_cell(page, f"widget.stump = StumpWidget({text!r}).stump")
    wait_for_text(widget, text)
    page.wait_for_function("() => document.querySelector('.stump-widget').dataset.draws")
    assert drawn(widget) == expected(text)
    assert widget.get_by_role("button", name="Undo").is_disabled()
    widget.evaluate(WATCH)
    switch(widget, "not F1").click()
    page.wait_for_function("() => window.drawn > window.clicked")
    with capsys.disabled():
        print(f"\n  click to picture: {page.evaluate('window.drawn - window.clicked'):.0f} ms")
    assert drawn(widget) == expected(text.replace("F1 = ", "F1 = not "))
    widget.scroll_into_view_if_needed()
    page.screenshot(path=ROOT / "build" / f"browser_stump_{text.count(chr(10))}.png")


def test_nothing_went_wrong_and_nothing_left_the_machine(page):
    assert not page.problems
    assert not page.strangers
