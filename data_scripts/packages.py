"""Packages of other projects that a data script takes files from: at hand, fetched before, or fetched now.

A package is known by its digest, wherever it came from: the same file or none.
"""

import base64
import errno
import hashlib
import http.client
import shutil
import subprocess
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from lib.datasets import DataError

CLIENT_SECONDS = 900  # how long a package client may take


@dataclass(frozen=True)
class Package:
    """One file of a package registry.

    digest  "sha256-…" in hexadecimal or "sha512-…" in base64, as the registries print them
    client  the command that brings the file to the folder it is run in, for machines that reach a mirror by it
    """

    name: str
    url: str
    digest: str
    client: tuple[str, ...]


def obtain(package: Package, at_hand: Path | None, folder: Path) -> Path:
    """The package's file: `at_hand`, else the one kept in `folder`, where a newly fetched one is kept.

    Raises DataError for a file with another digest, and where none can be fetched.
    """
    if at_hand is not None:
        if not at_hand.is_file():
            raise DataError(f"there is no package {at_hand}")
        if (found := digest(at_hand, package)) != package.digest:
            raise DataError(
                f"{at_hand} is damaged or another version (its digest is {found[:19]}…, expected "
                f"{package.digest[:19]}…); expected {package.name}"
            )
        return at_hand
    path = folder / package.name
    if path.is_file() and digest(path, package) == package.digest:
        return path
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _fetch(package, path)
    except OSError as error:
        reason = "the disk is full" if error.errno == errno.ENOSPC else error
        raise DataError(f"could not write {path}: {reason}") from error


def digest(path: Path, package: Package) -> str:
    """The file's digest in the form that the package's own has."""
    kind = package.digest.partition("-")[0]
    with path.open("rb") as file:
        found = hashlib.file_digest(file, kind)
    return f"{kind}-{base64.b64encode(found.digest()).decode() if kind == 'sha512' else found.hexdigest()}"


def _fetch(package: Package, path: Path) -> Path:
    """Try the address, then the package client. Raises DataError with what became of both."""
    problems = []
    part = path.with_name(f".{path.name}.part")
    shutil.rmtree(part, ignore_errors=True)  # what a killed run left
    part.mkdir()
    try:
        for bring in (_download, _ask_client):
            try:
                found = bring(package, part)
            except (OSError, ValueError, http.client.HTTPException, subprocess.SubprocessError) as error:
                if getattr(error, "errno", None) == errno.ENOSPC:
                    raise
                problems.append(str(error))
                continue
            if (got := digest(found, package)) == package.digest:
                return found.replace(path)
            problems.append(f"its digest is {got[:19]}…, expected {package.digest[:19]}…")
    finally:
        shutil.rmtree(part, ignore_errors=True)
    raise DataError(
        f"could not fetch {package.name} ({'; '.join(problems)}); try again, or get it elsewhere and give "
        "--package PATH"
    )


def _download(package: Package, folder: Path) -> Path:
    path = folder / package.name
    with urllib.request.urlopen(package.url, timeout=60) as reply, path.open("wb") as file:
        size = int(reply.headers.get("Content-Length") or 0)
        with tqdm(desc="download", total=size or None, unit="B", unit_scale=True) as bar:
            while block := reply.read(1 << 16):
                bar.update(file.write(block))
    if size and path.stat().st_size != size:
        raise ValueError(f"{package.url} ended after {path.stat().st_size} of {size} bytes")
    return path


def _ask_client(package: Package, folder: Path) -> Path:
    command = shutil.which(package.client[0])
    if command is None:
        raise ValueError(f"there is no {package.client[0]} here")
    inside = folder / "client"
    inside.mkdir()
    subprocess.run(
        [command, *package.client[1:]], cwd=inside, check=True, capture_output=True, timeout=CLIENT_SECONDS
    )
    found = sorted(inside.iterdir())
    if len(found) != 1:
        raise ValueError(f"{package.client[0]} brought {len(found)} files, expected one")
    return found[0]
