"""A JupyterLab of our own and a Chromium to look at it with, for tests of what only a browser can show."""

import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = {  # the Lab asks nobody for news, and draws every cell, also those that are scrolled away
    "@jupyterlab/apputils-extension/notification": {"fetchNews": "false", "checkForUpdates": False},
    "@jupyterlab/notebook-extension/tracker": {"windowingMode": "none"},
}
CHROMIUM_FLAGS = [
    "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader",  # 3D is computed in software: no GPU, no root jail
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
    "--disable-dev-shm-usage",
]  # fmt: skip


def find_chromium() -> str | None:
    """The path of a Chromium or Chrome: the environment variable CHROMIUM, or the first one installed."""
    names = (os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome")
    return next((path for name in names if name and (path := shutil.which(name))), None)


def playwright_and_chromium() -> tuple:
    """Playwright's sync_api and the path of a Chromium; skips the test where either is missing."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = find_chromium()
    if chromium is None:
        pytest.skip(
            "no Chromium found: install one (Debian: apt install chromium) or set CHROMIUM to its path"
        )
    return sync_api, chromium


@contextmanager
def jupyterlab(notebooks: Path, home: Path) -> Iterator[str]:
    """Serve a copy of a folder of notebooks from `home`; yields the address with a token, e.g. http://…/lab?token=…

    Kernels can import `lib`. Raises RuntimeError, with the server's log, when it does not answer within a minute.
    """
    shutil.copytree(notebooks, home / "notebooks")
    for name, settings in SETTINGS.items():
        path = home / "settings" / f"{name}.jupyterlab-settings"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(settings))
    port, token, log = _free_port(), secrets.token_hex(16), home / "server.log"
    with log.open("w") as out:
        server = subprocess.Popen(
            [sys.executable, "-m", "jupyterlab", *_server_options(home, port)],
            env=_environment(home, token), stdout=out, stderr=subprocess.STDOUT, cwd=home,
        )  # fmt: skip
    try:
        _wait_for(f"http://127.0.0.1:{port}/api?token={token}", server, log)
        yield f"http://127.0.0.1:{port}/lab/tree/{{notebook}}?token={token}"
    finally:
        server.terminate()
        try:
            server.wait(20)
        except subprocess.TimeoutExpired:
            server.kill()


def _server_options(home: Path, port: int) -> list[str]:
    return [
        "--no-browser", "--allow-root", "--ip=127.0.0.1", f"--port={port}", "--ServerApp.port_retries=0",
        f"--ServerApp.root_dir={home / 'notebooks'}", "--LabApp.expose_app_in_browser=True",
        "--LabApp.extension_manager=readonly",
    ]  # fmt: skip


def _environment(home: Path, token: str) -> dict[str, str]:
    """Ours, with the user's own Jupyter settings out of the way."""
    jupyter = {f"JUPYTER_{kind.upper()}_DIR": kind for kind in ("config", "data", "runtime")}
    lab = {f"JUPYTERLAB_{kind.upper()}_DIR": kind for kind in ("settings", "workspaces")}
    own = {name: str(home / folder) for name, folder in (jupyter | lab | {"IPYTHONDIR": "ipython"}).items()}
    return {
        **os.environ,
        **own,
        "JUPYTER_TOKEN": token,
        "PYTHONPATH": str(ROOT),
        "JUPYTER_PREFER_ENV_PATH": "1",
    }


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _wait_for(address: str, server: subprocess.Popen, log: Path, seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end and server.poll() is None:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except OSError:
            time.sleep(0.3)
    server.kill()
    raise RuntimeError(f"JupyterLab does not answer; its log ends:\n{log.read_text()[-3000:]}")
