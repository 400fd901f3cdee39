"""The viewer's page as static files for any web server: what the application answers, written to files, read-only."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

from httpx import ASGITransport, AsyncClient, Response
from starlette.applications import Starlette

from catalogs.published.folders import write_atomically
from catalogs.readers.json_text import load_json
from facade_core.core.errors import InputError
from facade_core.core.json_types import JsonObject
from flows.viewer.app import CONTENT_POLICY, PAGE_FOLDER

HOST = "127.0.0.1"
LIST_NAME = "streetloom-page.json"  # what an earlier page wrote into its folder, as relative paths
# A policy in a page cannot say who may embed it.
POLICY = "; ".join(one for one in CONTENT_POLICY.split("; ") if not one.startswith("frame-ancestors"))
MARKS = f"""<meta http-equiv="Content-Security-Policy" content="{POLICY}">
    <meta name="static" content="">"""


class StaticPageWriter:
    """Writer of the page of a run or a city.

    Parameters
    ----------
    application : the viewer's application.
    folder : folder to write; empty, missing or with an earlier page, of which other files stay.
    say : receives what is written or left out, a line a block.

    Raises
    ------
    InputError
        The folder holds other files and no earlier page.
    """

    def __init__(self, application: Starlette, folder: Path, say: Callable[[str], None]) -> None:
        self._application, self._folder, self._say = application, Path(os.path.realpath(folder)), say
        self._new = self._folder / ".streetloom-page"  # on the same disk, until all is there
        self._former = _read_list(self._folder)

    def write(self) -> int:
        """Write the page, its data, pictures and models; returns the number of files.

        Raises
        ------
        InputError
            No block has a map and a model yet.
        """
        self._folder.mkdir(parents=True, exist_ok=True)
        self._write_list(self._former)
        shutil.rmtree(self._new, ignore_errors=True)
        try:
            self._write_page()
            return self._take_over()
        finally:
            shutil.rmtree(self._new, ignore_errors=True)

    def _write_page(self) -> None:
        page = self._new / "page"
        shutil.copytree(PAGE_FOLDER, page)
        html = (page / "index.html").read_text("utf-8").replace("<head>", f"<head>\n    {MARKS}", 1)
        (self._new / "index.html").write_text(html, "utf-8")
        (page / "index.html").unlink()
        city: JsonObject = json.loads(self._fetch("api/city"))
        city["blocks"] = [block for block in city["blocks"] if self._write_block(block, is_alone=city["single"])]
        if not any(block["published"] for block in city["blocks"]):
            raise InputError("no block has a model to show; `streetloom run` or `streetloom city` publishes them")
        self._keep("api/city", json.dumps(city).encode())

    def _write_block(self, listed: JsonObject, *, is_alone: bool) -> bool:
        """Write what the page shows of a block; returns False, and says so, where it has to be left out."""
        if not listed["published"]:
            return True
        base = "" if is_alone else f"blocks/{listed['number']}/"
        name = listed["title"] or listed["name"]
        try:
            self._write_model(f"{base}tiles/{listed['published']}")
            self._write_facades(base)
        except InputError as error:
            if is_alone:
                raise
            shutil.rmtree(self._new / base, ignore_errors=True)
            self._say(f"{name}: left out: {error}")
            return False
        self._say(name)
        return True

    def _write_model(self, tiles: str) -> None:
        tileset = json.loads(self._keep(f"{tiles}/tileset.json"))
        around = tileset.get("asset", {}).get("extras", {}).get("surroundings")
        for uri in [*_content_uris(tileset["root"]), *([around] if around else [])]:
            self._keep(f"{tiles}/{uri}")

    def _write_facades(self, base: str) -> None:
        block: JsonObject = json.loads(self._keep(f"{base}api/block"))
        for name in ("progress", "start"):
            self._keep(f"{base}api/{name}")
        for facade in block["facades"]:
            details: JsonObject = json.loads(self._keep(f"{base}api/facade", id=facade["id"]))
            for stage in details["stages"]:
                self._keep(f"{base}picture/facade", id=facade["id"], stage=stage["stage"])
            if details["change"]["before"]:
                self._keep(f"{base}picture/before", id=facade["id"])

    def _fetch(self, path: str, **parameters: str) -> bytes:
        with ThreadPoolExecutor(1) as thread:  # the caller may have an event loop, as notebooks have
            answer = thread.submit(asyncio.run, _ask(self._application, path, parameters)).result()
        if answer.status_code != 200:
            is_json = answer.headers["content-type"] == "application/json"
            raise InputError(f"{path}: {answer.json()['reason'] if is_json else answer.text}")
        return answer.content

    def _keep(self, path: str, body: bytes | None = None, **parameters: str) -> bytes:
        """Write the answer to a request to the file that the page reads in its place, and return it."""
        body = self._fetch(path, **parameters) if body is None else body
        ending = "" if "tiles/" in path else ".webp" if "picture/" in path else ".json"
        if ending == ".json":
            answer = _without_remarks(json.loads(body))
            if path.endswith("api/facade"):  # the page shows the story of a facade alone
                answer["stages"] = [one for one in answer["stages"] if one["stage"] in STORY_STAGES]
            body = json.dumps(answer, ensure_ascii=False).encode()
        file = self._new / ("/".join([path, *map(hash_value, parameters.values())]) + ending)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(body)
        return body

    def _take_over(self) -> int:
        """Put the new files into the folder, and remove those of the earlier page that the new one lacks."""
        names = [path.relative_to(self._new).as_posix() for path in sorted(self._new.rglob("*")) if path.is_file()]
        gone = sorted(set(self._former) - set(names))
        files = {name: self._locate(name) for name in [*names, *gone]}
        self._write_list(list(files))
        for name in names:
            file = files[name]
            file.parent.mkdir(parents=True, exist_ok=True)
            os.replace(self._new / name, file)
        for name in gone:
            files[name].unlink(missing_ok=True)
            with suppress(OSError):  # other files are in it
                os.removedirs(files[name].parent)
        self._write_list(names)
        return len(names)

    def _locate(self, name: str) -> Path:
        file = self._folder / name
        if not file.parent.resolve().is_relative_to(self._folder):
            raise InputError(f"{file}: is outside the folder of the page; name a new folder")
        return file

    def _write_list(self, names: list[str]) -> None:
        write_atomically(self._folder / LIST_NAME, json.dumps(names, indent=1).encode())


def _read_list(folder: Path) -> list[str]:
    """Read the relative paths that an earlier page wrote; none of a new folder."""
    if not folder.is_dir() or not any(folder.iterdir()):
        return []
    listed = load_json(folder / LIST_NAME) if (folder / LIST_NAME).is_file() else None
    if not isinstance(listed, list) or not all(isinstance(name, str) for name in listed):
        raise InputError(f"--to {folder}: holds other files and no {LIST_NAME} of an earlier page; name a new folder")
    return [str(name) for name in listed]


def hash_value(value: str) -> str:
    """Return the name of a folder or file for a value of any length (FNV-1a); page/elements.js computes the same."""
    number = 0xCBF29CE484222325
    for byte in value.encode():
        number = (number ^ byte) * 0x100000001B3 % 2**64
    return f"{number:x}"


def _without_remarks(value: Any) -> Any:
    """Return what the page shows without reasons and notes, which may name files of this machine."""
    if isinstance(value, list):
        return [_without_remarks(one) for one in value]
    if not isinstance(value, dict):
        return value
    emptied = {"reason": "", "notes": []}
    return {name: emptied.get(name, _without_remarks(one)) for name, one in value.items()}


# As page/block_pages.js shows them in one row.
STORY_STAGES = ("source", "rectified", "parse", "layout", "texture")


def _content_uris(tile: JsonObject) -> Iterator[str]:
    yield tile["content"]["uri"]
    for child in tile.get("children", []):
        yield from _content_uris(child)


async def _ask(application: Starlette, path: str, parameters: Mapping[str, str]) -> Response:
    async with AsyncClient(transport=ASGITransport(application), base_url=f"http://{HOST}") as client:
        return await client.get(f"/{path}", params=parameters)
