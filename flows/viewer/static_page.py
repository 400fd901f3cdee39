"""The viewer's page as static files for any web server: what the application answers, written to files, read-only."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import quote, urlencode

from starlette.applications import Starlette
from starlette.types import Message

from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from flows.viewer.app import PAGE_FOLDER

HOST = "127.0.0.1"
STATIC_MARK = '<meta name="static" content="">'


class StaticPageWriter:
    """Writer of the page of a run or a city.

    Parameters
    ----------
    application : the viewer's application.
    folder : folder to write; empty, missing or with an earlier page.
    say : receives what is written, a line a block.

    Raises
    ------
    InputError
        The folder holds other files.
    """

    def __init__(self, application: Starlette, folder: Path, say: Callable[[str], None]) -> None:
        self._application, self._folder, self._say = application, folder, say
        index = folder / "index.html"
        if folder.is_dir() and any(folder.iterdir()):
            if not index.is_file() or STATIC_MARK not in index.read_text("utf-8"):
                raise InputError(f"--to {folder}: holds other files; name a new folder")
            shutil.rmtree(folder)

    def write(self) -> int:
        """Write the page, its data, pictures and models; returns the number of files.

        Raises
        ------
        InputError
            A block has no map yet.
        """
        shutil.copytree(PAGE_FOLDER, self._folder)
        page = self._folder / "page"
        page.mkdir()
        for path in list(self._folder.iterdir()):
            if path != page:
                path.rename(page / path.name)
        html = (page / "index.html").read_text("utf-8").replace("<head>", f"<head>\n    {STATIC_MARK}", 1)
        (self._folder / "index.html").write_text(html, "utf-8")
        (page / "index.html").unlink()
        city: JsonObject = json.loads(self._keep("api/city"))
        for block in city["blocks"]:
            if block["published"]:
                self._write_block("" if city["single"] else f"blocks/{block['number']}/", block["published"])
                self._say(block["title"] or block["name"])
        return sum(path.is_file() for path in self._folder.rglob("*"))

    def _write_block(self, base: str, snapshot: str) -> None:
        block: JsonObject = json.loads(self._keep(f"{base}api/block"))
        for name in ("progress", "start"):
            self._keep(f"{base}api/{name}")
        for facade in block["facades"]:
            details: JsonObject = json.loads(self._keep(f"{base}api/facade", id=facade["id"]))
            for stage in details["stages"]:
                self._keep(f"{base}picture/facade", id=facade["id"], stage=stage["stage"])
            if details["change"]["before"]:
                self._keep(f"{base}picture/before", id=facade["id"])
        tiles = f"{base}tiles/{snapshot}"
        for uri in _content_uris(json.loads(self._keep(f"{tiles}/tileset.json"))["root"]):
            self._keep(f"{tiles}/{uri}")

    def _keep(self, path: str, **parameters: str) -> bytes:
        """Write the answer to a request to the file that the page reads in its place, and return it."""
        status, body = asyncio.run(_ask(self._application, path, urlencode(parameters)))
        if status != 200:
            raise InputError(f"{path}: {body.decode(errors='replace')}")
        if path.endswith("api/facade"):  # the page shows the story of a facade alone
            details = json.loads(body)
            details["stages"] = [one for one in details["stages"] if one["stage"] in STORY_STAGES]
            body = json.dumps(details, ensure_ascii=False).encode()
        name = "/".join([path, *(quote(value, safe="!~*'()") for value in parameters.values())])
        file = self._folder / (name + ("" if "/tiles/" in f"/{path}" else ".webp" if "picture/" in path else ".json"))
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(body)
        return body


# As page/block_pages.js shows them in one row.
STORY_STAGES = ("source", "rectified", "parse", "layout", "texture")


def _content_uris(tile: JsonObject) -> Iterator[str]:
    yield tile["content"]["uri"]
    for child in tile.get("children", []):
        yield from _content_uris(child)


async def _ask(application: Starlette, path: str, query: str) -> tuple[int, bytes]:
    """Return status and body of the application's answer."""
    status, body = 0, bytearray()

    async def receive() -> Message:
        await asyncio.Event().wait()  # the client stays
        return {"type": "http.disconnect"}

    async def send(message: Message) -> None:
        nonlocal status
        status = message.get("status", status)
        body.extend(message.get("body", b""))

    scope = {
        "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": "GET", "scheme": "http", "root_path": "",
        "path": f"/{path}", "raw_path": quote(f"/{path}").encode(), "query_string": query.encode(),
        "headers": [(b"host", HOST.encode())], "client": (HOST, 1), "server": (HOST, 80),
    }  # fmt: skip
    await application(scope, receive, send)
    return status, bytes(body)
