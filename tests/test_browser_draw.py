"""The canvas to draw on in a real browser: strokes are read and refined, and every button does its work."""

import json
from statistics import median

import numpy as np
import pytest

from lib.viewing.draw_examples import example_drawings
from tests.browser import CHROMIUM_FLAGS, ROOT, jupyterlab, playwright_and_chromium
from tests.test_browser import KERNEL_IDLE, PATIENCE, START_ALL_CELLS, listen
from tests.test_browser_playground import notebook

pytestmark = pytest.mark.browser

CELLS = [
    """import torch
from lib.models.csgnet import CSGNet, CSGNetConfig
from lib.models.pretrained import pretrained
from lib.models.weights import CheckpointError, load
from lib.viewing.draw_widget import draw_a_shape
try:
    network = load(CSGNet, pretrained("csgnet_2d_reinforced"))
except CheckpointError:
    torch.manual_seed(0)
    network = CSGNet(CSGNetConfig.compact())
widget = draw_a_shape(network)
widget""",
]
ON = """(canvas) => {
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let on = 0;
    for (let k = 3; k < data.length; k += 4) on += data[k] > 0;
    return on;
}"""
DONE = """() => document.querySelector('.draw-widget').dataset.seconds !== undefined
    || document.querySelector('.draw-trouble')"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A notebook with one empty widget, after its cell has run."""
    sync_api, chromium = playwright_and_chromium()
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "draw.ipynb").write_text(json.dumps(notebook(CELLS)))
    with (
        jupyterlab(folder, tmp_path_factory.mktemp("lab")) as address,
        sync_api.sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport={"width": 1200, "height": 900})
        page.set_default_timeout(PATIENCE)
        listen(page)
        page.goto(address.format(notebook="draw.ipynb"))
        page.wait_for_selector(".jp-Notebook")
        page.wait_for_function(KERNEL_IDLE)
        page.evaluate(START_ALL_CELLS)
        page.wait_for_function("() => window.cellsRun !== null")
        page.locator(".draw-widget[data-draws]").wait_for()
        yield page
        browser.close()


@pytest.fixture
def widget(page):
    """The widget with an empty canvas."""
    root = page.locator(".draw-widget")
    root.locator(".draw-paper").scroll_into_view_if_needed()
    button(root, "Pen").click()
    if button(root, "Clear").is_enabled():
        button(root, "Clear").click()
    root.locator(".draw-status", has_text="Draw a filled shape").wait_for()
    return root


def button(root, name: str):
    return root.get_by_role("button", name=name, exact=True)


def stroke(root, *places: tuple[float, float]) -> None:
    """Drag the mouse from place to place, pixels of the drawing."""
    area = root.locator(".draw-paper").bounding_box()
    mouse = root.page.mouse
    for number, (x, y) in enumerate(places):
        mouse.move(area["x"] + x / 64 * area["width"], area["y"] + y / 64 * area["height"], steps=4)
        if number == 0:
            mouse.down()
    mouse.up()


def read(root) -> float:
    """Wait until the drawing is read and refined; the seconds that it took from the end of the stroke."""
    root.page.wait_for_function(DONE)
    assert not root.locator(".draw-trouble").count(), root.locator(".draw-status").inner_text()
    return float(root.get_attribute("data-seconds"))


def inked(root) -> int:
    """How many pixels of the drawing are inked; a pixel is 10 x 10 dots."""
    switch = root.get_by_role("checkbox")
    shown = switch.is_checked()
    switch.uncheck()
    count = root.locator(".draw-paper").evaluate(ON)
    switch.set_checked(shown)
    return round(count / 100)


def run_cell(page, source: str) -> None:
    """Put a cell below the others and run it."""
    page.evaluate(f"""() => {{
        const {{ content }} = window.jupyterapp.shell.currentWidget;
        const place = content.model.sharedModel.cells.length;
        content.model.sharedModel.insertCell(place, {{ cell_type: "code", source: {json.dumps(source)} }});
        content.activeCellIndex = place;
        window.jupyterapp.commands.execute("notebook:run-cell");
    }}""")


def test_strokes_are_read_and_refined(widget, capsys):
    square = [(14, 14), (50, 14), (50, 50), (14, 50), (14, 14)]
    stroke(widget, *square)
    outline = inked(widget)
    button(widget, "Fill closed strokes").click()
    assert inked(widget) > 1.5 * outline
    seconds = read(widget)
    with capsys.disabled():
        print(f"\n  end of the stroke to the refined program: {seconds:.2f} s")
    tokens = widget.locator(".draw-token").all_inner_texts()
    assert tokens and len(tokens) % 2 == 1
    assert "px" in widget.locator("figcaption").first.inner_text()
    assert "s after the stroke" in widget.locator(".draw-status").inner_text()
    assert all(widget.locator("figure canvas").nth(k).evaluate(ON) for k in (0, 1))
    (ROOT / "build").mkdir(exist_ok=True)
    widget.page.screenshot(path=ROOT / "build" / "browser_draw.png")


def test_examples_are_the_drawings_that_python_has(widget, capsys):
    times = []
    for name, image in example_drawings().items():
        button(widget, name).click()
        times.append(read(widget))
        assert inked(widget) == np.count_nonzero(image)
        widget.page.screenshot(path=ROOT / "build" / f"browser_draw_{name}.png")
    with capsys.disabled():
        print(
            f"\n  example to refined program: median {median(times):.2f} s, slowest {max(times):.2f} s of {len(times)}"
        )


def test_a_new_stroke_supersedes_the_old_drawing(widget):
    button(widget, "house").click()
    stroke(widget, (4, 4), (4, 60))
    stroke(widget, (60, 4), (60, 60))
    both = inked(widget)
    read(widget)
    run_cell(widget.page, "print('on:', int(widget.reading.image.sum()), widget._number)")
    said = widget.page.locator(".jp-OutputArea-output", has_text="on:").last
    said.wait_for()
    assert said.inner_text().split()[1] == str(both)


def test_eraser_width_and_undo(widget):
    assert button(widget, "Undo").is_enabled()  # the clearing
    width = widget.get_by_role("slider")
    width.fill("10")
    stroke(widget, (10, 32), (54, 32))
    wide = inked(widget)
    assert wide == pytest.approx(44 * 10 + 25 * np.pi, rel=0.05)  # a line of round ends
    button(widget, "Eraser").click()
    assert button(widget, "Eraser").get_attribute("aria-pressed") == "true"
    stroke(widget, (32, 20), (32, 44))
    assert inked(widget) == pytest.approx(wide - 100, abs=12)
    button(widget, "Undo").click()
    assert inked(widget) == wide
    button(widget, "Undo").click()
    assert inked(widget) == 0
    width.fill("5")


def test_outlines_can_be_switched_off_and_pointed_at(widget):
    button(widget, "moon").click()
    read(widget)
    paper = widget.locator(".draw-paper")
    with_outlines = paper.screenshot()
    widget.locator(".draw-token").first.hover()
    assert paper.screenshot() != with_outlines
    widget.get_by_role("checkbox").uncheck()
    without = paper.screenshot()
    assert without != with_outlines
    widget.get_by_role("checkbox").check()


def test_the_keys_draw_too(widget):
    page, paper = widget.page, widget.locator(".draw-paper")
    paper.focus()
    for key in (
        "Shift+ArrowLeft",
        "Space",
        *["ArrowDown"] * 3,
        "Shift+ArrowRight",
        "Shift+ArrowRight",
        "Space",
    ):
        page.keyboard.press(key)
    line = inked(widget)
    assert line > 80
    paper.focus()
    read(widget)
    page.screenshot(path=ROOT / "build" / "browser_draw_keys.png")
    page.keyboard.press("Backspace")
    widget.locator(".draw-status", has_text="Draw a filled shape").wait_for()
    assert inked(widget) == 0
    assert page.locator(".jp-Notebook .jp-Cell").count() <= 6, "a key reached the notebook"


def test_a_finger_draws_and_another_one_does_not(widget):
    client = widget.page.context.new_cdp_session(widget.page)
    area = widget.locator(".draw-paper").bounding_box()

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [
            {"x": area["x"] + x * area["width"] / 64, "y": area["y"] + y * area["height"] / 64, "id": k}
            for k, (x, y) in enumerate(places)
        ]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", (16, 32.5))
    touch("touchMove", (32, 32.5))
    touch("touchStart", (32, 32.5), (32, 60))
    touch("touchMove", (48, 32.5), (10, 60))
    touch("touchEnd")
    assert inked(widget) == pytest.approx(32 * 5 + 6.25 * np.pi, rel=0.05)
    read(widget)


def test_a_full_canvas_is_explained(widget):
    stroke(widget, (1, 1), (63, 1), (63, 63), (1, 63), (1, 1))
    button(widget, "Fill closed strokes").click()
    widget.locator(".draw-trouble", has_text="erase some of it").wait_for()


def test_a_failure_is_a_sentence(widget):
    run_cell(widget.page, "good, widget._network = widget._network, None")
    button(widget, "mug").click()
    widget.locator(".draw-trouble", has_text="could not be read: found a NoneType").wait_for()
    widget.page.screenshot(path=ROOT / "build" / "browser_draw_trouble.png")
    run_cell(widget.page, "widget._network = good")
    button(widget, "table").click()
    read(widget)


def test_python_draws_too(widget):
    run_cell(widget.page, "widget.draw('c(32,32,20)')")
    widget.locator(".draw-token", has_text="c(32,32,20)").or_(
        widget.locator(".draw-token").first
    ).first.wait_for()
    read(widget)
    assert inked(widget) == 1245
    button(widget, "Undo").click()  # what was there before
    widget.locator(".draw-status", has_text="Draw a filled shape").wait_for()


def test_dark_pages_keep_light_pictures(widget):
    page = widget.page
    theme = "() => window.jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})"
    page.evaluate(theme)
    page.locator("body[data-jp-theme-light=false]").wait_for(state="attached")
    button(widget, "lamp").click()
    read(widget)
    page.screenshot(path=ROOT / "build" / "browser_draw_dark.png")
    background = "canvas => getComputedStyle(canvas).backgroundColor"
    assert widget.locator("canvas").first.evaluate(background) == "rgb(255, 255, 255)"


def test_nothing_went_wrong_and_nothing_left_the_machine(page):
    assert not page.problems
    assert not page.strangers
