"""Programs of others that benchmarks and tests open models with: where they are, and a server on loopback for their pages."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

# Where `make clients` puts them.
INSTALLED = Path(__file__).resolve().parents[1] / ".venv" / "clients"
PACKAGES = INSTALLED / "node_modules"
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", str(INSTALLED / "chromium" / "chromium"))
CHROMIUM = next((found for name in _BROWSERS if (found := shutil.which(name))), None)
# Chromium draws without a graphics card, as machines of tests have none.
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

NOWHERE = Path("/nothing")


class MissingProgramError(Exception):
    """A program that is not on this machine; in one line, with what installs it."""


def package(name: str) -> Path:
    """The folder of an npm package."""
    folder = PACKAGES / name
    if not folder.is_dir():
        raise MissingProgramError(f"the npm package {name} is not installed; `make clients` does that")
    return folder


def node() -> str:
    """Node.js."""
    if (found := shutil.which("node")) is None:
        raise MissingProgramError("no node on this machine")
    return found


def blender() -> Path:
    """A Python that has Blender as the module bpy."""
    python = INSTALLED / "python" / "bin" / "python"
    if not python.is_file() or not any(INSTALLED.glob("python/lib/python*/site-packages/bpy")):
        raise MissingProgramError("Blender (bpy, for Python 3.11) is not installed; `make clients` does that")
    if said := _not_loaded(python):
        raise MissingProgramError(f"Blender (bpy) does not start here: {said}")
    return python


@cache
def _not_loaded(python: Path) -> str:
    """What the machine lacks of the libraries of a desktop that Blender is linked with; empty where it lacks none."""
    done = subprocess.run([str(python), "-c", "import bpy"], capture_output=True, text=True, timeout=600)
    return done.stderr.strip().splitlines()[-1] if done.returncode else ""


def cjio() -> Path:
    """The program of that name, for CityJSON."""
    program = INSTALLED / "python" / "bin" / "cjio"
    if not program.is_file():
        raise MissingProgramError("cjio is not installed beside Blender; `make clients` does that")
    return program


@contextmanager
def chromium(playwright: Any) -> Iterator[Any]:
    """Chromium, driven by Playwright."""
    if CHROMIUM is None:
        raise MissingProgramError("no Chromium on this machine; `make clients` brings one")
    # inside a container Chromium's own sandbox cannot start; it meets nothing here but pages of this project
    arguments = [*SOFTWARE_GL, *(["--no-sandbox"] if os.geteuid() == 0 else [])]
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
    try:
        yield browser
    finally:
        browser.close()


class _Files(SimpleHTTPRequestHandler):
    """Files of several folders, each below a name of its own."""

    def __init__(self, *arguments: Any, places: dict[str, Path], **more: Any) -> None:
        self.places = {name: folder.resolve() for name, folder in places.items()}
        super().__init__(*arguments, **more)

    def translate_path(self, path: str) -> str:
        _, name, rest = (path.split("?")[0] + "/").split("/", 2)
        folder = self.places.get(name, NOWHERE)
        found = (folder / rest.rstrip("/")).resolve()
        return str(found if found.is_relative_to(folder) else NOWHERE)

    def guess_type(self, path: Any) -> str:
        return "text/javascript" if str(path).endswith(".js") else super().guess_type(path)

    def log_message(self, format: str, *arguments: Any) -> None:
        pass


@contextmanager
def served(**places: Path) -> Iterator[str]:
    """Folders by their names, at an address on loopback."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Files, places=places))
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
