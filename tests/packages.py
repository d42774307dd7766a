"""Small packages for the tests of data scripts: archives in the forms of the real ones, and no network."""

import io
import tarfile
import zipfile
from dataclasses import replace

import pytest

from data_scripts import packages


def tar(files, mode="w:xz"):
    """The bytes of a tar archive: path -> content."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as archive:
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return buffer.getvalue()


def make_zip(files):
    """The bytes of a zip archive: path -> content."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def deb(files):
    """The bytes of a Debian package: path -> content."""
    members = {"debian-binary": b"2.0\n", "control.tar.xz": tar({}), "data.tar.xz": tar(files)}
    whole = b"!<arch>\n"
    for name, content in members.items():
        header = f"{name:<16}{0:<12}{0:<6}{0:<6}{100644:<8}{len(content):<10}`\n"
        whole += header.encode() + content + b"\n" * (len(content) % 2)
    return whole


def stand_in(monkeypatch, module, path, content):
    """Make `module` take a file with this content for its package, and no other."""
    path.write_bytes(content)
    package = replace(module.PACKAGE, client=("no-such-client",))
    package = replace(package, digest=packages.digest(path, package))
    monkeypatch.setattr(module, "PACKAGE", package)
    return path


class Reply(io.BytesIO):
    """What urlopen gives."""

    def __init__(self, content, size=None):
        super().__init__(content)
        self.headers = {"Content-Length": str(len(content) if size is None else size)}


@pytest.fixture
def no_network(monkeypatch):
    def refuse(*_, **__):
        raise OSError("no network")

    monkeypatch.setattr(packages.urllib.request, "urlopen", refuse)
