"""The latent explorer in a real browser: sliders move by mouse and keys, and shape and program follow."""

import json
import re
from statistics import median

import pytest

from lib.models.exploring import Directions, codes
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE
from lib.models.weights import load
from lib.models.writing import sample
from lib.viewing.latent_widget import LatentExplorer
from tests.browser import CHROMIUM_FLAGS, ROOT, jupyterlab, playwright_and_chromium
from tests.conftest import unchecked
from tests.test_browser import KERNEL_IDLE, PATIENCE, START_ALL_CELLS, listen
from tests.test_browser_playground import notebook
from tests.test_browser_stump import run_cell

pytestmark = pytest.mark.browser

CELLS = [
    """from lib.models.exploring import Directions, codes
from lib.models.pretrained import pretrained
from lib.models.program_vae import ProgramVAE
from lib.models.weights import load
from lib.models.writing import sample
from lib.viewing.latent_widget import LatentExplorer
network = load(ProgramVAE, pretrained("program_vae_chair"))
explorer = LatentExplorer(network, Directions.of(codes(network, sample(network, 60).programs), 4))
explorer"""
]
MINUS = "\u2212"  # what sliders write for "-"
WATCH = """(root) => {
    window.moved = window.drawn = 0;
    document.addEventListener("pointermove", () => { window.moved = performance.now() }, true);
    new MutationObserver(() => { window.drawn = performance.now() })
        .observe(root.querySelector(".shape-view"), { attributes: true, attributeFilter: ["data-draws"] });
}"""


@pytest.fixture(scope="module")
def twin():
    """The same explorer in this process: what the one in the browser should say."""
    with unchecked():
        network = load(ProgramVAE, pretrained("program_vae_chair"))
        yield LatentExplorer(network, Directions.of(codes(network, sample(network, 60).programs), 4))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A notebook with one explorer, after its cell has run."""
    sync_api, chromium = playwright_and_chromium()
    folder = tmp_path_factory.mktemp("notebooks")
    (folder / "latent.ipynb").write_text(json.dumps(notebook(CELLS)))
    with (
        jupyterlab(folder, tmp_path_factory.mktemp("lab")) as address,
        sync_api.sync_playwright() as play,
    ):
        browser = play.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        page = browser.new_context(viewport={"width": 1400, "height": 1000}).new_page()
        page.set_default_timeout(PATIENCE)
        listen(page)
        page.goto(address.format(notebook="latent.ipynb"))
        page.wait_for_selector(".jp-Notebook")
        page.wait_for_function(KERNEL_IDLE)
        page.evaluate(START_ALL_CELLS)
        page.wait_for_function("() => window.cellsRun !== null")
        page.locator(".latent-explorer .shape-view[data-draws]").wait_for()
        yield page
        browser.close()


@pytest.fixture
def explorer(page):
    """The explorer with all sliders at 0."""
    root = page.locator(".latent-explorer")
    root.scroll_into_view_if_needed()
    root.locator(".latent-reset").click()
    wait_for_readouts(root, [0.0] * 4)
    return root


def readouts(root) -> list[float]:
    """What stands beside the sliders, standard deviations."""
    return [
        float(text.replace(MINUS, "-"))
        for text in root.locator(".latent-slider .widget-readout").all_inner_texts()
    ]


def wait_for_readouts(root, values: list[float]) -> None:
    root.page.wait_for_function(
        """values => {
            const shown = [...document.querySelectorAll(".latent-slider .widget-readout")];
            const found = shown.map((each) => Number(each.innerText.replace("\u2212", "-")));
            return JSON.stringify(found) === JSON.stringify(values);
        }""",
        arg=values,
    )


def skeleton(text: str) -> str:
    """A program without decimals: another process may differ in the last one."""
    return re.sub(r"\d+\.\d+", "#", text).strip()


def wait_for_program(root, twin) -> None:
    """Until the page shows the program that Python writes for the same sliders."""
    root.page.wait_for_function(
        """wanted => {
            const shown = document.querySelector('.latent-program pre').textContent;
            return shown.replace(/\\d+\\.\\d+/g, '#').trim() === wanted;
        }""",
        arg=skeleton(twin.text),
    )


def test_it_shows_what_python_writes(explorer, twin):
    twin.reset()
    wait_for_program(explorer, twin)
    assert f"{len(twin.shape.names)} cuboids" in explorer.locator("[role=status]").inner_text()
    (ROOT / "build").mkdir(exist_ok=True)
    explorer.page.screenshot(path=ROOT / "build" / "browser_latent.png")


def test_a_slider_moves_the_shape(explorer, twin, capsys):
    page = explorer.page
    view, handle = explorer.locator(".shape-view"), explorer.locator(".latent-slider .noUi-handle").first
    handle.scroll_into_view_if_needed()
    before, program = (
        view.locator("canvas").screenshot(),
        explorer.locator(".latent-program pre").inner_text(),
    )
    explorer.evaluate(WATCH)
    box, times = handle.bounding_box(), []
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(x + 16 * step, y)
        page.wait_for_function("() => window.drawn > window.moved")
        times.append(page.evaluate("window.drawn - window.moved"))
    page.mouse.up()
    with capsys.disabled():
        print(
            f"\n  slider to picture: median {median(times):.0f} ms, slowest {max(times):.0f} ms of {len(times)}"
        )
    weight = readouts(explorer)[0]
    assert weight > 1
    twin.set_weights([weight, 0, 0, 0])
    wait_for_program(explorer, twin)
    assert explorer.locator(".latent-program pre").inner_text() != program
    assert view.locator("canvas").screenshot() != before
    page.screenshot(path=ROOT / "build" / "browser_latent_moved.png")


def test_keys_move_a_slider(explorer, twin):
    explorer.locator(".latent-slider .noUi-handle").nth(1).focus()
    for _ in range(5):
        explorer.page.keyboard.press("ArrowRight")
    wait_for_readouts(explorer, [0, 0.5, 0, 0])
    twin.set_weights([0, 0.5, 0, 0])
    wait_for_program(explorer, twin)


def test_python_and_buttons_move_the_sliders_too(explorer, twin):
    run_cell(explorer.page, "explorer.set_weights([1.0, -2.0, 0.5, 3.0])")
    wait_for_readouts(explorer, [1, -2, 0.5, 3])
    twin.set_weights([1.0, -2.0, 0.5, 3.0])
    wait_for_program(explorer, twin)
    explorer.locator(".latent-surprise").click()
    twin.surprise()  # both have drawn nothing so far, and draw the same
    wait_for_readouts(explorer, [round(weight, 1) + 0.0 for weight in twin.weights.tolist()])
    wait_for_program(explorer, twin)


@pytest.mark.parametrize("name, ending", [("save-glb", ".glb"), ("save-program", ".txt")])
def test_shape_and_program_can_be_taken_along(explorer, name, ending):
    with explorer.page.expect_download() as download:
        explorer.locator(f".latent-{name}").click()
    path = download.value.path()
    assert download.value.suggested_filename.endswith(ending)
    content = path.read_bytes()
    assert content[:4] == b"glTF" if ending == ".glb" else b"Assembly Program_0" in content


def test_nothing_went_wrong_and_nothing_left_the_machine(page):
    assert not page.problems
    assert not page.strangers
