"""What the viewer's page asks to correct facades: these addresses are there with `--edit` alone."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from catalogs.block.corrections import corrections_file, read_corrections
from facade_core.core.errors import FacadeError, StoreError
from facade_core.core.labels import ELEMENT_CLASSES
from flows.viewer.background_run import BackgroundRun
from flows.viewer.guard import edit_refusal
from tasks.corrections import Taker, block_of
from tasks.corrections.words import words
from tasks.engine.store.status import read_source
from tasks.viewing import Reader
from tasks.viewing.standing import standing

# The header with the token: a page of another site cannot state it without asking first, which is not answered.
TOKEN_HEADER = "X-Streetloom-Token"
# Corrections of a facade are some kilobytes.
MAX_BODY_BYTES = 1_000_000


@dataclass(frozen=True)
class Editor:
    """Who corrects what the viewer shows: the name that is kept with corrections, the folder of photos that they say the walls
    of, and the token that the page must state."""

    who: str
    photos: Path | None = None
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))


def edit_routes(reader: Reader, editor: Editor) -> list[Route]:
    """The addresses for who corrects, of whose requests those of other sites have been refused already."""
    redo, taker = BackgroundRun(reader.out), Taker(reader.out)

    def state(request: Request) -> dict[str, Any]:
        block = read_source(reader.out)
        return {
            "who": editor.who,
            "labels": ELEMENT_CLASSES,
            "words": words(),
            "kept": str(corrections_file(block)) if block else "",
            "redo": redo.said(),
            "photos": editor.photos is not None,
        }

    def stand_of(id: str) -> dict[str, Any]:
        view = reader.view()
        return standing(view, view.number(id), read_corrections(block_of(reader.out)))

    def facade(request: Request) -> dict[str, Any]:
        return stand_of(request.query_params.get("id", ""))

    def save(body: Any) -> dict[str, Any]:
        if not isinstance(body, dict) or not isinstance(body.get("corrections"), list):
            raise ValueError('what is saved is {"corrections": [...], "why": TEXT}')
        if "facade" in body and body.get("stood") != stand_of(str(body["facade"]))["corrected"]:
            raise ValueError("it was corrected meanwhile, as is told below; save again to put yours in its place")
        done = taker.take(body["corrections"], "not saved", who=editor.who, why=str(body.get("why", "")))
        return {"saved": done.facades + done.buildings, "said": done.lines()[0], "notes": done.notes}

    def start(body: Any) -> dict[str, Any]:
        redo.start(block_of(reader.out))
        return redo.said()

    return [
        Route("/edit/state", authorize_read(editor, state)),
        Route("/edit/facade", authorize_read(editor, facade)),
        Route("/edit/corrections", authorize_write(editor, save), methods=["POST"]),
        Route("/edit/redo", authorize_write(editor, start), methods=["POST"]),
    ]


def authorize_read(editor: Editor, handler: Callable[[Request], dict[str, Any] | Response]) -> Callable[..., Any]:
    """What answers who holds the editor's token."""

    async def endpoint(request: Request) -> Response:
        if refused := _refusal_response(request, editor, writes=False):
            return refused
        return await _respond(handler, request)

    return endpoint


def authorize_write(editor: Editor, handler: Callable[[Any], dict[str, Any]]) -> Callable[..., Any]:
    """What takes JSON of who holds the editor's token, on the viewer's own page."""

    async def endpoint(request: Request) -> Response:
        if refused := _refusal_response(request, editor, writes=True):
            return refused
        body = b""
        async for part in request.stream():
            body += part
            if len(body) > MAX_BODY_BYTES:
                return JSONResponse({"reason": "that is too much for corrections"}, 413)
        try:
            said = json.loads(body)
        except (ValueError, RecursionError):
            return JSONResponse({"reason": "what is sent is no JSON"}, 400)
        return await _respond(handler, said)

    return endpoint


def _refusal_response(request: Request, editor: Editor, *, writes: bool) -> Response | None:
    found = edit_refusal(
        editor.token, request.headers.getlist(TOKEN_HEADER), request.headers.getlist("origin"), writes=writes
    )
    return JSONResponse({"reason": found[1]}, found[0]) if found else None


async def _respond(handler: Callable[[Any], dict[str, Any] | Response], argument: Any) -> Response:
    try:
        made = await run_in_threadpool(handler, argument)
        return made if isinstance(made, Response) else JSONResponse(made)
    except StoreError as error:
        return JSONResponse({"reason": str(error)}, 503)
    except (FacadeError, ValueError) as error:
        return JSONResponse({"reason": str(error)}, 400)
    except OSError as error:  # the block's folder cannot be written
        return JSONResponse({"reason": f"{error.filename}: {error.strerror}"}, 500)
