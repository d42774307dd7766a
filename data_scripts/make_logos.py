"""Make images of logos, to test an image parser on:   python -m data_scripts.make_logos

64x64 masks of some 3,200 logos out of the npm package simple-icons 16.37.0 (6.5 MB; kept in data/downloads). The icons
are drawn for a square of 24 units and touch its sides; the square takes 56 of the 64 pixels. As for silhouettes, a
pixel is on where half of it is covered, and lines thinner than a pixel are widened (lib/interpreters/rasterising.py).

They go to data/silhouettes (or --out): logos.npz, which lib.datasets.logos reads, logos.json with counts, what was left
out and why, licence and where each logo was found, and with --sheet a contact sheet to look at. All are in the split
"test", as in CSGNet's paper, which never trains on its logos.

The package is in the public domain (CC0-1.0), but not all of its icons are: those known to have a licence of their own
are left out (its makers warn that their list of licences is not complete). Whatever the copyright, trademarks remain
their owners'.

Drawing needs resvg:   pip install -e '.[logos]'
"""

import argparse
import io
import json
import sys
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import matplotlib.image
import numpy as np
from tqdm import tqdm

from data_scripts import mask_files
from data_scripts.ending import default_root, exit_code
from data_scripts.made_files import is_made
from data_scripts.mask_files import Drawn
from data_scripts.packages import Package, obtain
from lib.datasets import DataError, data_root
from lib.datasets.images import read
from lib.interpreters.rasterising import FILL, SAMPLES, SIZE, pixels

PACKAGE = Package(
    name="simple-icons-16.37.0.tgz",
    url="https://registry.npmjs.org/simple-icons/-/simple-icons-16.37.0.tgz",
    digest="sha512-8mCJIhpMYOL9g13GW59EiL3sVXJnTEKGCTZFaekl9UQ3Qo0SwVjnLaJ82QiaH8BKBdouEDzrHMXIWh8cBIy48A==",
    client=("npm", "pack", "simple-icons@16.37.0"),
)
CODE = ("lib/interpreters/rasterising.py", "data_scripts/make_logos.py")  # what, changed, draws other masks
LIST, ICONS = "package/data/simple-icons.json", "package/icons/"
BOX = 'viewBox="0 0 24 24"'  # every icon's
LICENCE = "simple-icons is CC0-1.0; icons with a licence of their own were left out; trademarks remain their owners'"
DAMAGED = (tarfile.TarError, zlib.error, EOFError, ValueError, KeyError, TypeError, RecursionError)


def icons(package: Path) -> list[tuple[dict, str]]:
    """(entry of the package's list, SVG text) of every icon, sorted by "slug". Raises DataError for a damaged package.

    An entry has title, slug, source and, where the icon has a licence of its own, license.
    """
    try:
        with tarfile.open(package, "r:gz") as archive:
            files = {
                member.name: archive.extractfile(member).read().decode()
                for member in archive
                if member.isreg() and (member.name == LIST or member.name.startswith(ICONS))
            }
        entries = sorted(json.loads(files[LIST]), key=lambda entry: entry["slug"])
        return [(entry, files[f"{ICONS}{entry['slug']}.svg"]) for entry in entries]
    except (*DAMAGED, OSError) as error:
        raise DataError(f"{package} is damaged, or no package of icons ({error!r})") from error


def draw(entry: dict, svg: str) -> Drawn:
    """The mask of one icon, or why there is none."""
    about = (entry["slug"], "logo", "test")
    if entry.get("license"):
        return Drawn(*about, problem="a licence of its own")
    if BOX not in svg:
        return Drawn(*about, problem="not drawn for a square of 24 units")
    try:
        return Drawn(*about, {"logo": pixels(samples(svg))})
    except ValueError as error:
        return Drawn(*about, problem=f"no picture: {error}")


def samples(svg: str) -> np.ndarray:
    """Which of an icon's (256, 256) samples are covered. Raises ValueError for what is no SVG."""
    from resvg_py import svg_to_bytes  # optional: pip install -e '.[logos]'

    side, margin = SIZE * SAMPLES, (SIZE - FILL) // 2 * 24 / FILL  # samples; units
    box = f'width="{side}" height="{side}" viewBox="{-margin} {-margin} {24 + 2 * margin} {24 + 2 * margin}"'
    picture = svg_to_bytes(svg_string=svg.replace(BOX, box, 1), skip_system_fonts=True)
    return matplotlib.image.imread(io.BytesIO(picture), format="png")[..., 3] >= 0.5  # how opaque


def make(options: argparse.Namespace) -> str:
    """Make the files, unless they are there; returns a line for a person. Raises DataError."""
    try:
        import resvg_py
    except ImportError as error:
        raise DataError(f"drawing logos needs resvg: pip install -e '.[logos]' ({error})") from error
    wanted = mask_files.settings(PACKAGE.digest, CODE) | {"drawn_by": f"resvg-py {resvg_py.__version__}"}
    del wanted["split_shares"]  # all are for testing
    path = options.out / "logos.npz"
    if is_made(options.out, "logos", wanted):
        line = f"{path} is complete and up to date: nothing to do"
    else:
        found = icons(obtain(PACKAGE, options.package, data_root() / "downloads"))
        credits = {
            entry["slug"]: {key: entry.get(key, "") for key in ("title", "source")} for entry, _ in found
        }
        facts = {"licence": LICENCE, "package": PACKAGE.name, "settings": wanted, "credits": credits}
        line = f"{path}: {mask_files.summary(mask_files.write(options.out, 'logos', draw_all(found), facts))}"
    if options.sheet:
        mask_files.write_sheets(options.out, read(path, "logos"))
    return line


def draw_all(found: list[tuple[dict, str]]) -> Iterator[Drawn]:
    """What became of each icon."""
    for entry, svg in tqdm(found, desc="drawing", unit=" logos"):
        yield draw(entry, svg)


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code: 0 made, 1 a problem, 130 interrupted. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--package", type=Path, help="use this .tgz of simple-icons, download nothing")
    parser.add_argument(
        "--out", type=Path, default=default_root() / "silhouettes", help="default: %(default)s"
    )
    parser.add_argument("--sheet", action="store_true", help="write a contact sheet, too")
    options = parser.parse_args(arguments)
    return exit_code(lambda: print(make(options)), "interrupted: nothing was changed")


if __name__ == "__main__":
    sys.exit(main())
