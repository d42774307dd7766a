"""What a reader meets: JupyterLab opens a notebook, the slider moves the chair, a typing error is explained."""

import re
from statistics import median
from urllib.parse import urlsplit

import pytest

from tests.browser import CHROMIUM_FLAGS, ROOT, jupyterlab, playwright_and_chromium

NOTEBOOK = "01_shapeassembly_language.ipynb"
PATIENCE = 90_000  # milliseconds for a step that takes about 5 s here: slow machines are allowed

START_ALL_CELLS = """() => {
    window.cellsRun = null;
    window.jupyterapp.commands.execute("notebook:run-all-cells").then(() => { window.cellsRun = "done" },
                                                                      (error) => { window.cellsRun = String(error) });
}"""
KERNEL_IDLE = (
    "() => window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status === 'idle'"
)
# Notes the time of every movement of the mouse and of every picture drawn, by the browser's own clock.
WATCH = """(view) => {
    window.moved = window.drawn = 0;
    document.addEventListener("pointermove", () => { window.moved = performance.now() }, true);
    new MutationObserver(() => { window.drawn = performance.now() }).observe(view, { attributes: true });
}"""


pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Notebook 01 after all its cells have run. `page.problems` collects errors of the console and of the page."""
    sync_api, chromium = playwright_and_chromium()
    if not (ROOT / "notebooks" / NOTEBOOK).exists():
        pytest.skip(f"notebooks/{NOTEBOOK} does not exist")
    with (
        jupyterlab(ROOT / "notebooks", tmp_path_factory.mktemp("lab")) as address,
        sync_api.sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport={"width": 1500, "height": 1000})
        page.set_default_timeout(PATIENCE)
        listen(page)
        open_and_run(page, address.format(notebook=NOTEBOOK))
        yield page
        browser.close()


def listen(page) -> None:
    """From now on note errors in `page.problems`, and requests that leave this machine in `page.strangers`."""
    page.problems, page.strangers = [], []

    def on_console(message):
        if message.type == "error":
            page.problems.append(f"console: {message.text} {message.location}")

    def on_request(request):
        url = urlsplit(request.url)
        if url.scheme not in ("data", "blob") and url.hostname != "127.0.0.1":
            page.strangers.append(request.url)

    page.on("console", on_console)
    page.on("request", on_request)
    page.on("pageerror", lambda error: page.problems.append(f"page: {error}"))


def open_and_run(page, address: str) -> None:
    page.goto(address)
    page.wait_for_selector(".jp-Notebook")
    page.wait_for_function(KERNEL_IDLE)
    page.evaluate(START_ALL_CELLS)
    page.wait_for_function("() => window.cellsRun !== null")
    page.wait_for_function(KERNEL_IDLE)
    assert page.evaluate("window.cellsRun") == "done"
    page.locator(".program-editor .shape-view canvas").first.scroll_into_view_if_needed()
    page.wait_for_selector(".shape-view[data-draws]")


def test_the_slider_moves_the_shape(page, capsys):
    """The fifth slider is the height of the first part: the notebook's program must show it (no squeeze hides it)."""
    editor = page.locator(".program-editor").first
    view, text = editor.locator(".shape-view"), editor.locator(".program-text textarea")
    handle = editor.locator(".program-slider").nth(4).locator(".noUi-handle")
    handle.scroll_into_view_if_needed()
    before, program = view.locator("canvas").screenshot(), text.input_value()
    view.evaluate(WATCH)
    times = drag(page, handle, steps=10)
    with capsys.disabled():
        print(
            f"\n  slider to picture: median {median(times):.0f} ms, slowest {max(times):.0f} ms of {len(times)}"
        )
    assert text.input_value() != program, "the slider did not rewrite its number"
    assert view.locator("canvas").screenshot() != before, "the slider moved, the picture did not"
    assert not page.problems


def drag(page, handle, steps: int, pixels: int = 4) -> list[float]:
    """Drag a slider's handle; for each step the milliseconds from the mouse's event to the next picture."""
    box = handle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    times = []
    for step in range(1, steps + 1):
        page.mouse.move(x + step * pixels, y)
        page.wait_for_function("() => window.drawn > window.moved")
        times.append(page.evaluate("window.drawn - window.moved"))
    page.mouse.up()
    return times


def test_a_typing_error_is_explained_and_the_shape_stays(page):
    editor = page.locator(".program-editor").first
    text, message = editor.locator(".program-text textarea"), editor.locator(".program-error pre")
    good = text.input_value()
    drawn = editor.locator(".shape-view").get_attribute("data-draws")
    text.focus()
    text.press("Control+Home")
    text.press("ArrowDown")
    text.press("End")
    text.press("Enter")
    text.type("cube9 = Cubiod(1, 1, 1)")
    message.filter(has_text="Cubiod").wait_for()
    found = message.inner_text()
    assert re.search(r"line 3, column \d+", found) and "^" in found, found
    (ROOT / "build").mkdir(exist_ok=True)
    page.screenshot(path=ROOT / "build" / "browser_01_error.png")
    assert editor.locator(".shape-view").get_attribute("data-draws") == drawn, (
        "the last good shape should stay"
    )
    text.fill(good)
    message.wait_for(state="detached")


def test_pointing_at_a_part_names_it(page):
    view = page.locator(".program-editor .shape-view").first
    box = view.locator("canvas").bounding_box()
    for share in (0.5, 0.45, 0.55, 0.4, 0.6, 0.35, 0.65):
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] * share)
        if view.locator(".shape-view-name").inner_text():
            break
    assert re.match(r"Program_0/", view.locator(".shape-view-name").inner_text())


def test_the_shape_can_be_saved(page):
    for kind, start in (("glb", b"glTF"), ("obj", b"o "), ("program", b"Assembly")):
        with page.expect_download() as download:
            page.locator(f".program-editor .save-{kind}").first.click()
        assert download.value.path().read_bytes().startswith(start)


def test_nothing_went_wrong_and_nothing_left_the_machine(page):
    page.locator(".program-text").first.scroll_into_view_if_needed()
    (ROOT / "build").mkdir(exist_ok=True)
    page.screenshot(path=ROOT / "build" / "browser_01.png")
    assert not page.problems
    assert not page.strangers


def test_clearing_the_cells_takes_the_view_away(page):
    page.evaluate("() => window.jupyterapp.commands.execute('notebook:clear-all-cell-outputs')")
    page.locator(".shape-view").first.wait_for(state="detached")
    assert not page.problems
