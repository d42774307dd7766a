"""The CSG playground in a real browser: clicks build a program, every picture follows, the text can be taken along."""

import json
from statistics import median

import pytest

from lib.interpreters.csg import execute, parse
from tests.browser import CHROMIUM_FLAGS, ROOT, jupyterlab, playwright_and_chromium
from tests.test_browser import KERNEL_IDLE, PATIENCE, START_ALL_CELLS, listen

pytestmark = pytest.mark.browser

CELLS = [
    "from lib.viewing.playground import Playground\nplayground = Playground()\nplayground",
    "Playground('c(32,32,28)', target='c(32,32,28)c(32,32,20)-')",
]
RING = "c(32,32,28)c(32,32,20)-"
RING_AREA = execute(parse(RING)).on
WATCH = """(root) => {
    window.clicked = window.drawn = 0;
    document.addEventListener("click", () => { window.clicked = performance.now() }, true);
    new MutationObserver(() => { window.drawn = performance.now() })
        .observe(root.querySelector(".csg-status"), { childList: true });
}"""
ON = """(canvas) => {
    const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    let dark = 0;
    for (let k = 0; k < data.length; k += 4) dark += data[k] < 100 && data[k + 3] > 0;
    return dark;
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A notebook with two playgrounds, the second one with a target, after its cells have run."""
    sync_api, chromium = playwright_and_chromium()
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "play.ipynb").write_text(json.dumps(notebook(CELLS)))
    with (
        jupyterlab(folder, tmp_path_factory.mktemp("lab")) as address,
        sync_api.sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        context = browser.new_context(viewport={"width": 1300, "height": 1000})
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        listen(page)
        page.goto(address.format(notebook="play.ipynb"))
        page.wait_for_selector(".jp-Notebook")
        page.wait_for_function(KERNEL_IDLE)
        page.evaluate(START_ALL_CELLS)
        page.wait_for_function("() => window.cellsRun !== null")
        page.locator(".csg-playground[data-draws]").nth(1).wait_for()
        yield page
        browser.close()


def notebook(cells: list[str]) -> dict:
    blank = {"cell_type": "code", "metadata": {}, "execution_count": None, "outputs": []}
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    cells = [{**blank, "id": f"cell{number}", "source": source} for number, source in enumerate(cells)]
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": kernel}, "cells": cells}


@pytest.fixture
def playground(page):
    """The first playground, emptied."""
    root = page.locator(".csg-playground").first
    root.locator(".csg-paper").scroll_into_view_if_needed()
    if root.locator(".csg-text").input_value():
        button(root, "clear").click()
        root.locator(".csg-status", has_text="Empty").wait_for()
    return root


def button(root, text: str):
    return root.get_by_role("button", name=text, exact=text.isdigit())


def choose(root, kind: str, size: int) -> None:
    button(root, kind).click()
    button(root, str(size)).click()


def push(root, x: int, y: int) -> None:
    """Click the canvas at a center, and wait until the stack has followed."""
    many = root.locator(".csg-chips li").count()
    root.locator(".csg-paper").scroll_into_view_if_needed()
    area = root.locator(".csg-paper").bounding_box()
    root.page.mouse.click(
        area["x"] + (x + 0.5) / 64 * area["width"], area["y"] + (y + 0.5) / 64 * area["height"]
    )
    root.locator(".csg-chips li").nth(many).wait_for()


def build_ring(root) -> None:
    for size in (28, 20):
        choose(root, "circle", size)
        push(root, 32, 32)
    button(root, "subtract").click()
    root.locator(".csg-status", has_text="valid program").wait_for()
    root.page.mouse.move(2, 2)  # away from the canvas: no preview


def test_clicks_build_a_ring(playground, capsys):
    page, paper = playground.page, playground.locator(".csg-paper")
    assert button(playground, "subtract").is_disabled()
    assert "two shapes" in button(playground, "subtract").get_attribute("title")
    playground.evaluate(WATCH)
    times, dark = [], [paper.evaluate(ON)]
    for size in (28, 20):
        choose(playground, "circle", size)
        push(playground, 32, 32)
        times.append(page.evaluate("window.drawn - window.clicked"))
        dark.append(paper.evaluate(ON))
    (ROOT / "build").mkdir(exist_ok=True)
    page.screenshot(path=ROOT / "build" / "browser_playground_two.png")
    assert "2 shapes on the stack: one more operation" in playground.locator(".csg-status").inner_text()
    assert playground.locator(".csg-stack b").all_inner_texts() == ["B", "A"]
    button(playground, "subtract").click()
    playground.locator(".csg-status", has_text="A valid program of 3 tokens").wait_for()
    times.append(page.evaluate("window.drawn - window.clicked"))
    page.mouse.move(2, 2)
    page.wait_for_timeout(100)
    with capsys.disabled():
        print(
            f"\n  click to picture: median {median(times):.0f} ms, slowest {max(times):.0f} ms of {len(times)}"
        )
    assert playground.locator(".csg-text").input_value() == RING
    assert paper.evaluate(ON) == pytest.approx(RING_AREA * 36, rel=0.1)  # 36 dots a pixel; points lie on some
    page.screenshot(path=ROOT / "build" / "browser_playground.png")
    assert not page.problems


def test_pointing_shows_the_primitive_before_it_is_there(playground):
    paper, note = playground.locator(".csg-paper"), playground.locator(".csg-note")
    choose(playground, "triangle", 12)
    before = paper.screenshot()
    area = paper.bounding_box()
    playground.page.mouse.move(area["x"] + area["width"] / 2, area["y"] + area["height"] / 2)
    note.filter(has_text="click to push t(32,32,12)").wait_for()
    assert paper.screenshot() != before
    choose(playground, "circle", 32)
    playground.page.mouse.click(area["x"] + 5, area["y"] + 5)
    message = playground.locator(".csg-error").filter(has_text="c(8,8,32)")
    assert "would stick out of the canvas" in message.inner_text()
    assert playground.locator(".csg-chips li").count() == 0


def test_undo_redo_keys_and_steps(playground):
    build_ring(playground)
    chips, page = playground.locator(".csg-chips li"), playground.page
    page.keyboard.press("Backspace")
    playground.locator(".csg-status", has_text="one more operation").wait_for()
    page.keyboard.press("*")
    playground.locator(".csg-status", has_text="A valid program").wait_for()
    assert chips.all_inner_texts()[-1] == "*"
    button(playground, "undo").click()
    playground.locator(".csg-status", has_text="one more operation").wait_for()
    button(playground, "redo").click()
    playground.locator(".csg-status", has_text="A valid program").wait_for()
    chips.nth(1).get_by_role("button").click()
    playground.locator(".csg-stack li").nth(1).wait_for()  # the stack as it was, of two
    assert "after token 2 of 3" in playground.locator(".csg-note").inner_text()
    assert page.locator(".jp-Notebook .jp-Cell").count() == 2, "a key reached the notebook"


def test_the_text_is_copied_and_pasted(playground):
    build_ring(playground)
    page, field = playground.page, playground.locator(".csg-text")
    button(playground, "Copy").click()
    button(playground, "Copied").wait_for()
    assert page.evaluate("navigator.clipboard.readText()") == RING
    field.fill("")
    field.press("Control+v")
    assert field.input_value() == RING
    field.press("End")
    field.type(" s(32,32,8) +")
    field.press("Enter")
    playground.locator(".csg-status", has_text="A valid program of 5 tokens").wait_for()
    assert field.input_value() == RING + "s(32,32,8)+"


def test_the_text_is_copied_where_the_clipboard_is_closed(playground):
    build_ring(playground)
    playground.page.evaluate("navigator.clipboard.writeText('before')")
    playground.page.evaluate(
        "() => { navigator.clipboard.writeText = () => Promise.reject(new Error('closed')) }"
    )
    button(playground, "Copy").click()
    button(playground, "Copied").wait_for()
    assert playground.page.evaluate("navigator.clipboard.readText()") == RING


def test_a_typing_error_is_marked_and_the_program_stays(playground):
    build_ring(playground)
    field = playground.locator(".csg-text")
    field.fill("c(32,32,28)c(32,99,20)-")
    field.press("Enter")
    message = playground.locator(".csg-error").filter(has_text="column 12")
    assert "^" * len("c(32,99,20)") in message.inner_text()
    assert field.evaluate("f => f.value.slice(f.selectionStart, f.selectionEnd)") == "c(32,99,20)"
    assert playground.locator(".csg-chips li").count() == 3
    playground.page.screenshot(path=ROOT / "build" / "browser_playground_error.png")
    field.fill(RING)
    field.press("Enter")
    message.wait_for(state="detached")


def test_a_target_says_how_near_one_is(page):
    root = page.locator(".csg-playground").nth(1)
    root.scroll_into_view_if_needed()
    assert "0.492" in root.locator(".csg-target").inner_text()
    page.evaluate(
        "() => window.jupyterapp.commands.execute('apputils:change-theme', {theme: 'JupyterLab Dark'})"
    )
    page.locator("body[data-jp-theme-light=false]").wait_for(state="attached")
    choose(root, "circle", 20)
    push(root, 32, 32)
    root.locator(".csg-paper").hover(position={"x": 96, "y": 96})
    page.screenshot(path=ROOT / "build" / "browser_playground_dark.png")
    button(root, "subtract").click()
    root.locator(".csg-status", has_text="to the pixel").wait_for()
    assert "1.000" in root.locator(".csg-target").inner_text()


def test_nothing_went_wrong_and_nothing_left_the_machine(page):
    assert not page.problems
    assert not page.strangers
