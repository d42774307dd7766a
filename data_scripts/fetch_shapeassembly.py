"""Fetch the real ShapeAssembly programs:   python -m data_scripts.fetch_shapeassembly [--archive PATH] [--out FOLDER]

Takes the 11,922 programs, their train/val splits and the licence, and no code, from the authors' public repository
(https://github.com/rkjones4/ShapeAssembly; Jones et al., ACM TOG 39(6), 2020) or from an archive of it that is at
hand (.tar.gz, .tar.xz, .zip). They go to

    data/shapeassembly/{chair,table,storage}/ID.txt
    data/shapeassembly/splits/{chair,table,storage}/{train,val}.txt
    data/shapeassembly/LICENSE

or below --out or SHAPE_PROGRAMS_DATA instead of data/. Everything is checked against SHA-256 digests before the
folder gets its name, so there is either all of it or none. Running it again does nothing when the data is good.
"""

import argparse
import errno
import hashlib
import http.client
import lzma
import re
import shutil
import sys
import tarfile
import urllib.request
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from tqdm import tqdm

from data_scripts.ending import default_root
from lib.datasets import CATEGORIES, DataError

URL = "https://github.com/rkjones4/ShapeAssembly/archive/refs/heads/master.tar.gz"
PROGRAMS = {"chair": 3835, "table": 6536, "storage": 1551}
DIGESTS = {  # SHA-256 of each list of files, as digest() computes it
    "chair": "e1d3d248692405893f34b957afff4ffc4f3a5893f1b2f9262a650ccab2042753",
    "table": "84cbb648f400ba1de1941f21ae8cffb87751ede115cf2c5c2f9e54f328c130b4",
    "storage": "46b9d483ae8a97832c02042a56bada17be562638592dc9331b51c9c3001ae262",
    "splits": "bfe22246ed29389701484355ecc80907d69a3c6e5f892f8afa14773837110302",
    "LICENSE": "f78f5a8fc7f1aee7470650431f70ec021aae6eb2f2f157c9658695a185c2251f",
}
WANTED = [  # path in the archive, below its one top folder -> path in our folder
    (re.compile(r"code/data/(chair|table|storage)/(\d+\.txt)"), r"\1/\2"),
    (re.compile(r"code/data_splits/(chair|table|storage)/((?:train|val)\.txt)"), r"splits/\1/\2"),
    (re.compile(r"(LICENSE)"), r"\1"),
]
LARGEST_FILE = 1_000_000  # bytes; the data set's own stay below a tenth of it
LICENCE = (
    "Licence: Copyright 2020, Brown University. Use, copy, change and share for any purpose other than its\n"
    "incorporation into a commercial product or service; keep the notice. The full text: {folder}/LICENSE"
)
DAMAGED = (
    tarfile.TarError,
    zipfile.BadZipFile,
    lzma.LZMAError,
    zlib.error,
    EOFError,
    ValueError,
    RuntimeError,
)

Files = dict[str, bytes]  # path in our folder -> content


def digest(files: Files) -> str:
    """SHA-256 over the sorted (name, content) pairs, each with its length so that no two lists look alike."""
    total = hashlib.sha256()
    for name in sorted(files):
        total.update(f"{name}\0{len(files[name])}\0".encode())
        total.update(files[name])
    return total.hexdigest()


def group_of(name: str) -> str:
    """The list a file belongs to: "chair", "table", "storage", "splits" or "LICENSE"."""
    return name.split("/")[0]


def wanted(archive_path: str) -> str | None:
    """Our name for a file of the archive, or None for what we leave there, paths that climb out included."""
    _top, _slash, inner = archive_path.removeprefix("./").partition("/")
    for pattern, ours in WANTED:
        if match := pattern.fullmatch(inner):
            return match.expand(ours)
    return None


def archive_members(path: Path) -> Iterator[tuple[str, bytes]]:
    """(our name, content) of each wanted regular file in a tar or zip archive; links and folders are passed over."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                if (name := wanted(member.filename)) and member.file_size <= LARGEST_FILE:
                    yield name, archive.read(member)
    else:
        with tarfile.open(path, "r:*") as archive:
            for member in archive:
                if (name := wanted(member.name)) and member.isreg() and member.size <= LARGEST_FILE:
                    yield name, archive.extractfile(member).read()


def read_archive(path: Path) -> Files:
    """Every wanted file of the archive, in memory (about 13 MB). Raises DataError for a damaged archive."""
    try:
        members = tqdm(archive_members(path), desc="reading", unit=" files", total=sum(PROGRAMS.values()) + 7)
        return dict(members)
    except DAMAGED as error:
        raise DataError(
            f"{path} is damaged, cut short, or not a .tar.gz, .tar.xz or .zip archive ({error})"
        ) from error


def read_folder(folder: Path) -> Files:
    """The files of an unpacked data set, as read_archive gives them; empty when there is no folder."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def check(files: Files, where: str) -> None:
    """Raises DataError unless the files are, byte for byte, the lists that DIGESTS describes."""
    for group, expected in DIGESTS.items():
        members = {name: content for name, content in files.items() if group_of(name) == group}
        if len(members) != PROGRAMS.get(group, len(members)) or not members:
            count = PROGRAMS.get(group, "some")
            raise DataError(f"{where}: {len(members)} of {count} {group} files found; it is incomplete")
        if (found := digest(members)) != expected:
            raise DataError(
                f"{where}: the {group} files differ (SHA-256 {found[:12]}…, expected {expected[:12]}…)"
            )


def is_good(folder: Path) -> bool:
    """Is a complete, undamaged data set in this folder?"""
    try:
        check(read_folder(folder), str(folder))
    except (DataError, OSError):
        return False
    return True


def write(files: Files, folder: Path) -> None:
    """Write all files to `folder`, which comes into being in one step, or not at all; an old one is replaced."""
    part, old = folder.with_name(f".{folder.name}.part"), folder.with_name(f".{folder.name}.old")
    shutil.rmtree(part, ignore_errors=True)  # what a killed run left
    try:
        for name, content in tqdm(files.items(), desc="writing", unit=" files"):
            path = part / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        shutil.rmtree(old, ignore_errors=True)
        if folder.exists():
            folder.rename(old)
        part.rename(folder)
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        if old.exists() and not folder.exists():
            old.rename(folder)


def download(url: str, path: Path) -> None:
    """Save a URL to a file. Raises DataError when the connection fails or ends early."""
    try:
        with urllib.request.urlopen(url, timeout=60) as reply, path.open("wb") as file:
            size = int(reply.headers.get("Content-Length") or 0)
            with tqdm(desc="download", total=size or None, unit="B", unit_scale=True) as bar:
                while block := reply.read(1 << 16):
                    bar.update(file.write(block))
            if size and bar.n != size:
                raise DataError(f"the download of {url} ended after {bar.n} of {size} bytes; run this again")
    except (OSError, http.client.HTTPException) as error:
        if getattr(error, "errno", None) == errno.ENOSPC:
            raise
        raise DataError(
            f"could not download {url} ({error}); try again, or download it by hand and give --archive PATH"
        ) from error


def fetch(root: Path, archive: Path | None = None, url: str = URL) -> Path:
    """Bring the data set to root/shapeassembly; returns that folder. Raises DataError; changes nothing then."""
    folder = root / "shapeassembly"
    if is_good(folder):
        print(f"{folder} is complete and undamaged: nothing to do")
        return folder
    if archive is not None and not archive.is_file():
        raise DataError(f"there is no archive {archive}")
    downloaded = root / ".shapeassembly.download"
    try:
        root.mkdir(parents=True, exist_ok=True)
        if archive is None:
            download(url, downloaded)
        files = read_archive(archive or downloaded)
        check(files, str(archive or url))
        write(files, folder)
    except OSError as error:
        room = "the disk is full (60 MB are needed)" if error.errno == errno.ENOSPC else str(error)
        raise DataError(f"could not write {folder}: {room}") from error
    finally:
        downloaded.unlink(missing_ok=True)
    return folder


def summary(folder: Path) -> str:
    """What is there, in lines for a person: programs and splits by category, and the licence."""
    lines = []
    for category in CATEGORIES:
        splits = folder / "splits" / category
        train, val = (len((splits / f"{name}.txt").read_text().split()) for name in ("train", "val"))
        programs = len(list((folder / category).glob("*.txt")))
        lines.append(f"  {category:<8} {programs:>5} programs   {train:>5} train   {val:>4} val")
    return "\n".join([f"ShapeAssembly programs in {folder}", *lines, LICENCE.format(folder=folder)])


def main(arguments: list[str] | None = None) -> int:
    """The command; returns the exit code. Problems are one line on stderr."""
    parser = argparse.ArgumentParser(description="Fetch the real ShapeAssembly programs.")
    parser.add_argument("--archive", type=Path, help="use this .tar.gz, .tar.xz or .zip, download nothing")
    parser.add_argument(
        "--out", type=Path, default=default_root(), help="the data root (default: %(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        print(summary(fetch(options.out, options.archive)))
    except DataError as error:
        print(f"DataError: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("Interrupted: nothing was changed.", file=sys.stderr)
    else:
        return 0
    return 1


if __name__ == "__main__":
    raise SystemExit(main())
