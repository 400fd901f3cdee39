"""Endpoints of the viewer that correct facades; only `--edit` serves them."""

from __future__ import annotations

import json
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from catalogs.block.corrections import corrections_file, read_corrections
from catalogs.block.reader import read_model_files
from facade_core.core.errors import FacadeError, StoreError
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import ELEMENT_CLASSES
from flows.viewer.background_run import BackgroundRun
from flows.viewer.guard import editor_request_refusal
from tasks.corrections.correction_import import CorrectionImporter, find_run_block_file
from tasks.corrections.drawable_values import valid_correction_values
from tasks.engine.store.status import read_run_block_file
from tasks.viewing.facade_completions import complete_facade, parse_editor_boxes
from tasks.viewing.facade_state import read_facade_state
from tasks.viewing.run_view import RunReader

T = TypeVar("T")

# Answers a request.
Endpoint = Callable[[Request], Awaitable[Response]]

# Header with the token. A page of another site must send a preflight request for it, which fails.
TOKEN_HEADER = "X-Streetloom-Token"
# Limit of a request; corrections of a facade take some kilobytes.
MAX_BODY_BYTES = 1_000_000


@dataclass(frozen=True)
class EditorUser:
    """User who may correct facades in the viewer: name, photo folder and token.

    Attributes
    ----------
    who : name that is stored with corrections.
    photos : folder of photos to match to walls; None without matching.
    token : secret that the page must send.
    """

    who: str
    photos: Path | None = None
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))


def correction_routes(reader: RunReader, editor: EditorUser, redo: BackgroundRun) -> list[Route]:
    """Return the HTTP routes for corrections of facades; `redo` runs the pending units of the same run."""
    taker = CorrectionImporter(reader.out)

    def state(request: Request) -> JsonObject:
        block = read_run_block_file(reader.out)
        return {
            "who": editor.who,
            "labels": ELEMENT_CLASSES,
            "words": valid_correction_values(),
            "kept": str(corrections_file(block)) if block else "",
            "redo": redo.status(),
            "photos": editor.photos is not None,
        }

    def facade_state(id: str) -> JsonObject:
        view = reader.open_newest()
        return read_facade_state(view, view.find_facade_index(id), read_corrections(find_run_block_file(reader.out)))

    def facade(request: Request) -> JsonObject:
        return facade_state(request.query_params.get("id", ""))

    def save(body: object) -> JsonObject:
        if not isinstance(body, dict) or not isinstance(body.get("corrections"), list):
            raise ValueError('what is saved is {"corrections": [...], "why": TEXT}')
        if "facade" in body and body.get("stood") != facade_state(str(body["facade"]))["corrected"]:
            raise ValueError("it was corrected meanwhile, as is told below; save again to put yours in its place")
        result = taker.add(body["corrections"], "not saved", who=editor.who, why=str(body.get("why", "")))
        return {"saved": result.facades + result.buildings, "said": result.lines()[0], "notes": result.notes}

    def complete(body: object) -> JsonObject:
        view, block = reader.open_newest(), find_run_block_file(reader.out)
        boxes = parse_editor_boxes(body)
        return complete_facade(view, view.find_facade_index(boxes.facade), boxes, read_model_files(block))

    def start(body: object) -> JsonObject:
        redo.start(find_run_block_file(reader.out))
        return redo.status()

    return [
        Route("/edit/state", editor_read_endpoint(editor, state)),
        Route("/edit/facade", editor_read_endpoint(editor, facade)),
        Route("/edit/corrections", editor_write_endpoint(editor, save), methods=["POST"]),
        Route("/edit/completions", editor_write_endpoint(editor, complete), methods=["POST"]),
        Route("/edit/redo", editor_write_endpoint(editor, start), methods=["POST"]),
    ]


def editor_read_endpoint(editor: EditorUser, handler: Callable[[Request], JsonObject | Response]) -> Endpoint:
    """Return an endpoint that answers GET requests with the editor's token."""

    async def endpoint(request: Request) -> Response:
        if refused := _refusal_response(request, editor, writes=False):
            return refused
        return await _respond(handler, request)

    return endpoint


def editor_write_endpoint(editor: EditorUser, handler: Callable[[object], JsonObject]) -> Endpoint:
    """Return an endpoint that accepts JSON with the editor's token, from the viewer's own page."""

    async def endpoint(request: Request) -> Response:
        if refused := _refusal_response(request, editor, writes=True):
            return refused
        body = b""
        try:
            async for part in request.stream():
                body += part
                if len(body) > MAX_BODY_BYTES:
                    return JSONResponse({"reason": "that is too much for corrections"}, 413)
        except ClientDisconnect:  # nobody reads the answer
            return Response(status_code=400)
        try:
            content = json.loads(body)
            json.dumps(content, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            return JSONResponse({"reason": "what is sent holds half a character; write it anew"}, 400)
        except (ValueError, RecursionError):
            return JSONResponse({"reason": "what is sent is no JSON"}, 400)
        return await _respond(handler, content)

    return endpoint


def _refusal_response(request: Request, editor: EditorUser, *, writes: bool) -> Response | None:
    found = editor_request_refusal(
        editor.token, request.headers.getlist(TOKEN_HEADER), request.headers.getlist("origin"), writes=writes
    )
    return JSONResponse({"reason": found[1]}, found[0]) if found else None


async def _respond(handler: Callable[[T], JsonObject | Response], argument: T) -> Response:
    try:
        answer = await run_in_threadpool(handler, argument)
        return answer if isinstance(answer, Response) else JSONResponse(answer)
    except StoreError as error:
        return JSONResponse({"reason": str(error)}, 503)
    except (FacadeError, ValueError) as error:
        return JSONResponse({"reason": str(error)}, 400)
    except OSError as error:  # the block's folder is not writable
        return JSONResponse({"reason": f"{error.filename}: {error.strerror}"}, 500)
