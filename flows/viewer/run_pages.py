"""Routes of the viewer for one run: its map, progress, facades, streets, pictures and models."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import cast

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Route

from facade_core.core.errors import FacadeError, InputError, StoreError
from flows.lock import is_locked
from flows.viewer.background_run import BackgroundRun
from flows.viewer.editing import EditorUser, correction_routes
from flows.viewer.matching import photo_match_routes
from flows.viewer.model import block_tileset, find_model_file, viewer_start
from tasks.stages.facades.record import FacadeRecord
from tasks.viewing import draw_stage_picture, list_stage_pictures, read_previous_capture_picture
from tasks.viewing.pictures import encode_picture
from tasks.viewing.run_view import RunReader
from tasks.viewing.street_replay import StreetReplay

# The address of a picture names its snapshot, and a snapshot never changes.
IMMUTABLE = {"Cache-Control": "private, max-age=31536000, immutable"}
# Height of a picture that a page may ask for.
MAX_HEIGHT_PX = 4096


def answer_errors(respond: Callable[[Request], Response]) -> Callable[[Request], Response]:
    """Return an endpoint that answers with a reason where `respond` raises."""

    def endpoint(request: Request) -> Response:
        try:
            return respond(request)
        except StoreError as error:  # no data yet: the run has just begun
            return JSONResponse({"reason": str(error)}, status_code=503)
        except KeyError as error:
            return JSONResponse({"reason": f"the address lacks {error}"}, status_code=404)
        except (FacadeError, IndexError, ValueError) as error:
            return JSONResponse({"reason": str(error)}, status_code=404)

    return endpoint


def run_routes(reader: RunReader, editor: EditorUser | None, redo: BackgroundRun) -> list[BaseRoute]:
    """Return the routes of one run; with an editor, those that correct it too.

    Parameters
    ----------
    reader : reader of the run.
    editor : person who may correct facades; None for a viewer without editing.
    redo : run of the pending units, started from the page.
    """
    out, replay = reader.out, StreetReplay()

    def block(request: Request) -> Response:
        view = reader.open_newest()
        headers = IMMUTABLE if request.query_params.get("of") == view.snapshot else {"Cache-Control": "no-store"}
        return Response(view.block_map_json, media_type="application/json", headers=headers)

    def progress(request: Request) -> Response:
        return JSONResponse(reader.open_newest().run_progress() | {"under_way": is_locked(out)})

    def facade(request: Request) -> Response:
        view = reader.open_newest()
        index = view.find_facade_index(request.query_params["id"])
        record = view.records[index] or cast(FacadeRecord, {})
        return JSONResponse(
            {
                "stages": [{"stage": stage.name, "title": stage.title} for stage in list_stage_pictures(view, index)],
                "elements": record.get("elements", []),
                "change": {"map": record.get("change_map", []), "before": "before_file" in record},
                "seconds": record.get("seconds", {}),
                "reason": record.get("reason"),
                "snapshot": view.snapshot,
            }
        )

    def stage(request: Request) -> Response:
        view = reader.open_newest()
        image = draw_stage_picture(
            view, view.find_facade_index(request.query_params["id"]), request.query_params["stage"]
        )
        height = 1 + _parse_index(request, "height", MAX_HEIGHT_PX) if "height" in request.query_params else None
        picture = encode_picture(image, max_height=height)
        return Response(picture, media_type="image/webp", headers=IMMUTABLE)

    def earlier(request: Request) -> Response:
        view = reader.open_newest()
        return Response(
            read_previous_capture_picture(view, view.find_facade_index(request.query_params["id"])),
            media_type="image/webp",
            headers=IMMUTABLE,
        )

    def panorama(request: Request) -> Response:
        view = reader.open_newest()
        rgb = replay.draw_panorama(view, _parse_index(request, "viewpoint", len(view.tables.street)))
        return Response(encode_picture(rgb, "JPEG"), media_type="image/jpeg", headers=IMMUTABLE)

    def growth_picture(request: Request) -> Response:
        view = reader.open_newest()
        image = replay.draw_after_viewpoint(view, _parse_index(request, "viewpoint", len(view.tables.street)))
        return Response(encode_picture(image), media_type="image/webp", headers=IMMUTABLE)

    def tileset(request: Request) -> Response:
        return JSONResponse(block_tileset(out, request.path_params["of"]), headers=IMMUTABLE)

    def tile(request: Request) -> Response:
        file = find_model_file(out, request.path_params["of"], request.path_params["name"])
        # its textures are JPEGs, which compression would not shrink
        headers = IMMUTABLE | {"Content-Encoding": "identity"}
        if isinstance(file, Path):
            return FileResponse(file, media_type="model/gltf-binary", headers=headers)
        return Response(file.read_bytes(), media_type="model/gltf-binary", headers=headers)

    answers: dict[str, Callable[[Request], Response]] = {
        "/api/block": block,
        "/api/progress": progress,
        "/api/facade": facade,
        "/api/start": lambda request: JSONResponse(viewer_start(reader.open_newest())),
        "/tiles/{of}/tileset.json": tileset,
        "/tiles/{of}/{name:path}": tile,
        "/picture/facade": stage,
        "/picture/before": earlier,
        "/picture/panorama": panorama,
        "/picture/grown": growth_picture,
    }
    routes: list[BaseRoute] = [Route(path, answer_errors(respond)) for path, respond in answers.items()]
    if editor is not None:
        routes += correction_routes(reader, editor, redo)
        if editor.photos is not None:
            routes += photo_match_routes(reader, editor, editor.photos)
    return routes


def _parse_index(request: Request, name: str, count: int) -> int:
    """Parse a number from 0 to count - 1 from the address. Raises InputError."""
    text = request.query_params.get(name, "")
    if not text.isascii() or not text.isdigit() or int(text) >= count:
        raise InputError(f"{name}: give a whole number from 0 to {count - 1}")
    return int(text)
