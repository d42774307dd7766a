"""Furniture of Sweet Home 3D's extra libraries, out of Debian's package sweethome3d-furniture, nothing installed.

A .deb is an `ar` archive: a line of text, then members, each behind a header of 60 bytes. Its member data.tar.xz holds
five libraries (.sh3f), zip archives with a catalogue and models in OBJ files. The catalogue says for each model its
name, who made it, how it has to be turned, and how large it is; it is read as Java's properties are, in Latin-1.
"""

import io
import re
import tarfile
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from lzma import LZMAError
from pathlib import Path

import numpy as np
import trimesh

from data_scripts.packages import Package
from lib.datasets import DataError

PACKAGE = Package(
    name="sweethome3d-furniture_1.8-1_all.deb",
    url="https://deb.debian.org/debian/pool/main/s/sweethome3d-furniture/sweethome3d-furniture_1.8-1_all.deb",
    digest="sha256-3ccb90c63f9525e887a767b9cd5c8b6933b8b6b2973a615a5359ee68a2118668",
    client=("apt-get", "download", "sweethome3d-furniture=1.8-1"),
)
CATALOGUE = "PluginFurnitureCatalog.properties"
# Categories of the catalogue in which furniture is looked for; elsewhere: cars, sports, animals.
ROOMS = {"Living room", "Bedroom", "Office", "Kitchen", "Exterior", "Lights"}
WORDS = [  # what a name says it is; the first that fits counts ("Desk lamp" is a lamp, "Desk table" a desk)
    ("", r"fan|freezer|flashlight|candle"),
    ("lamp", r"lamps?|lights?|lamppost|(?:wall )?spotlight|lantern|chandelier|fluorescent strip"),
    ("chair", r"(?:arm)?chair|stool|class seat|puff|pool lounge"),
    ("sofa", r"sofa|couch|bench"),
    ("desk", r"desk"),
    ("table", r"table"),
    ("storage", r"cabinet|wardrobe|shelves|bookcase|cupboard|drawers|chest|tv stand"),
]
DAMAGED = (
    *(tarfile.TarError, zipfile.BadZipFile, LZMAError, zlib.error),
    *(EOFError, ValueError, KeyError, NotImplementedError, RuntimeError),
)


@dataclass(frozen=True)
class Model:
    """One piece of furniture. `size` is what its bounding box is stretched to: width, height, depth (x, y, z)."""

    id: str
    category: str
    title: str
    creator: str
    licence: str
    obj: bytes
    turn: tuple[float, ...] | None
    size: tuple[float, float, float]


def models(package: Path) -> tuple[list[Model], str]:
    """The furniture in a .deb that WORDS knows, sorted by id, and the package's copyright file.

    Raises DataError for a package that is damaged.
    """
    found, copyright_text = [], ""
    try:
        for name, content in members(package):
            if name.endswith(".sh3f"):
                found += library(Path(name).stem, content)
            else:
                copyright_text = content.decode()
    except (*DAMAGED, OSError) as error:
        raise DataError(f"{package} is damaged, or no package of furniture ({error})") from error
    return sorted(found, key=lambda model: model.id), copyright_text


def members(package: Path) -> Iterator[tuple[str, bytes]]:
    """(path, content) of the libraries and the copyright file in a .deb. Raises one of DAMAGED."""
    with package.open("rb") as file:
        if file.read(8) != b"!<arch>\n":
            raise ValueError("it does not begin as a .deb does")
        while header := file.read(60):
            name, size = header[:16].decode().strip().rstrip("/"), int(header[48:58])
            if name.startswith("data.tar"):
                with tarfile.open(fileobj=file, mode="r|*") as archive:
                    for member in archive:
                        if member.isreg() and member.name.endswith((".sh3f", "/copyright")):
                            yield member.name, archive.extractfile(member).read()
                return
            if size < 0:
                raise ValueError(f"{name} has a size of {size}")
            file.seek(size + size % 2, io.SEEK_CUR)  # members begin at even places
    raise ValueError("it holds no data.tar")


def library(name: str, content: bytes) -> list[Model]:
    """The furniture in one library. Raises one of DAMAGED, KeyError for a model that is not there."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = properties(archive.read(CATALOGUE).decode("latin-1"))
        numbers = sorted(int(key.partition("#")[2]) for key in entries if key.startswith("model#"))
        found = []
        for number in numbers:
            entry = {key: entries.get(f"{key}#{number}", "") for key in ENTRY}
            if entry["category"] in ROOMS and (category := category_of(entry["name"])):
                obj = archive.read(entry["model"].lstrip("/"))
                found.append(_model(name, category, entry, entries.get("license", ""), obj))
        return found


ENTRY = ("name", "category", "model", "creator", "modelRotation", "width", "height", "depth")


def _model(where: str, category: str, entry: dict[str, str], licence: str, obj: bytes) -> Model:
    turn = tuple(float(number) for number in entry["modelRotation"].split())
    if len(turn) not in (0, 9):
        raise ValueError(f"{entry['model']}: a rotation of {len(turn)} numbers, expected 9")
    return Model(
        id=f"{where}/{Path(entry['model']).stem}",
        category=category,
        title=entry["name"],
        creator=entry["creator"],
        licence=" ".join(licence.split()),
        obj=obj,
        turn=turn or None,
        size=tuple(float(entry[key]) for key in ("width", "height", "depth")),
    )


def properties(text: str) -> dict[str, str]:
    """Java's properties, as far as these catalogues use them: key=value lines, # comments, \\uXXXX for a letter."""
    pairs = (line.partition("=") for line in text.splitlines() if "=" in line and line[0] not in "#!")
    return {key.strip(): _letters(value.strip()) for key, _equals, value in pairs}


def _letters(text: str) -> str:
    return re.sub(r"\\u([0-9a-fA-F]{4})", lambda match: chr(int(match[1], 16)), text)


def category_of(title: str) -> str:
    """What a piece of furniture is by its name, "" for what is none or unknown."""
    for category, words in WORDS:
        if re.search(rf"\b(?:{words})\b", title, re.IGNORECASE):
            return category
    return ""


def triangles(model: Model) -> np.ndarray:
    """The model's surface, (t, 3, 3): turned and stretched as the catalogue says; y up, its front to +z.

    Raises ValueError for a model without triangles.
    """
    mesh = trimesh.load(
        io.BytesIO(model.obj), file_type="obj", force="mesh", process=False, skip_materials=True
    )
    corners = np.asarray(mesh.triangles, dtype=float)
    if not len(corners):
        raise ValueError("no triangles")
    if model.turn is not None:
        corners = corners @ np.reshape(model.turn, (3, 3)).T
    extent = np.ptp(corners.reshape(-1, 3), axis=0)
    flat = extent < 1e-9 * extent.max()
    return corners * np.where(flat, 1, np.divide(model.size, np.where(flat, 1, extent)))
