"""Programs of others that benchmarks and tests open models with: where they are, and a server on loopback for their pages."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

# Where `make clients` puts packages of npm.
PACKAGES = Path(__file__).resolve().parents[1] / ".venv" / "clients" / "node_modules"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SOFTWARE_GL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

NOWHERE = Path("/nothing")


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
