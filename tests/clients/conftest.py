"""Programs of others that open what is exported: their packages lie where `make clients` puts them; elsewhere tests of them are
skipped."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
PACKAGES = HERE.parent.parent / ".venv" / "clients" / "node_modules"


def package(name: str) -> Path:
    """The folder of an installed npm package; skips where it is absent."""
    if not (PACKAGES / name).is_dir():
        pytest.skip(f"the npm package {name} is not installed; `make clients` does that")
    return PACKAGES / name


class _Files(SimpleHTTPRequestHandler):
    """Files of several folders, each below a name of its own."""

    def __init__(self, *arguments: Any, places: dict[str, Path], **more: Any) -> None:
        self.places = places
        super().__init__(*arguments, **more)

    def translate_path(self, path: str) -> str:
        _, name, rest = path.split("?")[0].split("/", 2)
        folder = self.places.get(name, HERE)
        found = (folder / rest).resolve()
        return str(found if found.is_relative_to(folder.resolve()) else HERE / "nothing")

    def guess_type(self, path: Any) -> str:
        return "text/javascript" if str(path).endswith(".js") else super().guess_type(path)

    def log_message(self, format: str, *arguments: Any) -> None:
        pass


@contextmanager
def served(**places: Path) -> Iterator[str]:
    """Folders by their names, at an address on loopback; `pages` is that of this file."""
    handler = partial(_Files, places=places | {"pages": HERE})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
