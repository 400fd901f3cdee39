"""Routes of the viewer for the blocks of a city: their state, a search, and those of each block, opened when asked for."""

from __future__ import annotations

import threading
from collections import OrderedDict

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, Router
from starlette.types import Receive, Scope, Send

from facade_core.core.json_types import JsonObject
from flows.lock import is_locked
from flows.viewer.background_run import BackgroundRun
from flows.viewer.editing import EditorUser
from flows.viewer.run_pages import answer_errors, run_routes
from tasks.viewing.city_view import CityReader, describe_run
from tasks.viewing.find import find_in_city
from tasks.viewing.run_view import RunReader

# Runs that are open at a time: their plans and journals are in memory.
MAX_OPEN_RUNS = 4


def city_routes(reader: CityReader, editor: EditorUser | None) -> list[BaseRoute]:
    """Return the routes of a city; those of block N are below /blocks/N."""

    def city(request: Request) -> Response:
        return JSONResponse(reader.describe() | {"single": False})

    def find(request: Request) -> Response:
        return JSONResponse(find_in_city(reader, request.query_params["text"]))

    return [
        Route("/api/city", answer_errors(city)),
        Route("/api/find", answer_errors(find)),
        Mount("/blocks/{number:int}", app=OpenBlocks(reader, editor)),
    ]


def single_run_routes(reader: RunReader, editor: EditorUser | None) -> list[BaseRoute]:
    """Return the routes of one run, which is shown as a city of one block."""

    def city(request: Request) -> Response:
        described: JsonObject = describe_run(reader, is_locked)
        return JSONResponse(described | {"single": True})

    return [Route("/api/city", answer_errors(city)), *run_routes(reader, editor, BackgroundRun(reader.out))]


class OpenBlocks:
    """Application that answers for the blocks of a city and keeps the runs of the last few of them open.

    Parameters
    ----------
    reader : reader of the city.
    editor : person who may correct facades; None for a viewer without editing.
    """

    def __init__(self, reader: CityReader, editor: EditorUser | None) -> None:
        self._reader = reader
        self._editor = editor
        self._lock = threading.Lock()
        self._routers: OrderedDict[int, Router] = OrderedDict()
        # a run that was started from the page goes on while its block is closed
        self._redos: dict[int, BackgroundRun] = {}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request for the block that the address names."""
        router = await run_in_threadpool(self._open, int(scope["path_params"]["number"]))
        if router is None:
            await JSONResponse({"reason": "there is no such block"}, 404)(scope, receive, send)
        else:
            await router(scope, receive, send)

    def _open(self, number: int) -> Router | None:
        with self._lock:
            if number not in self._routers:
                block = self._reader.known_block(number)
                if block is None:
                    return None
                redo = self._redos.setdefault(number, BackgroundRun(block.folder))
                self._routers[number] = Router(run_routes(RunReader(block.folder), self._editor, redo))
            self._routers.move_to_end(number)
            while len(self._routers) > MAX_OPEN_RUNS:
                self._routers.popitem(last=False)
            return self._routers[number]
