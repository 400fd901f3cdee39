"""HTTP application of the viewer, on loopback by default."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from ipaddress import ip_address
from pathlib import Path
from typing import cast

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from catalogs.published.folders import Folder
from facade_core.core.errors import FacadeError, InputError, StoreError
from flows.lock import is_locked
from flows.viewer.editing import EditorUser, correction_routes
from flows.viewer.guard import HostGuard, bracket_ipv6, create_guard
from flows.viewer.matching import photo_match_routes
from flows.viewer.model import find_model_file, viewer_model_index
from tasks.stages.facades.record import FacadeRecord
from tasks.viewing import draw_stage_picture, list_stage_pictures, read_previous_capture_picture
from tasks.viewing.pictures import encode_picture
from tasks.viewing.run_view import RunReader
from tasks.viewing.street_replay import StreetReplay

PAGE_FOLDER = Path(__file__).parent / "page"
# The address of a picture names its snapshot, and a snapshot never changes.
IMMUTABLE = {"Cache-Control": "private, max-age=31536000, immutable"}
# Scripts, styles, pictures and the model come from this server only.
CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
# Other sites cannot embed the viewer or learn of it.
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": CONTENT_POLICY,
}


def create_application(
    out: Folder | Mapping[str, Folder], host: str, bound: str, editor: EditorUser | None = None
) -> Starlette:
    """Create the viewer of one run, or of several runs by name, each below its own address.

    Parameters
    ----------
    out : folder of the run, or folders by name.
    host : the host that the user named.
    bound : address that the server listens on.
    editor : person who may correct facades; None for a viewer without editing.
    """
    routes = _city_routes(out, editor) if isinstance(out, Mapping) else _run_routes(out, editor)
    middleware = [
        Middleware(_GuardMiddleware, guard=create_guard(host, bound)),
        Middleware(GZipMiddleware, minimum_size=2000),
    ]
    return Starlette(routes=routes, middleware=middleware)


def _city_routes(runs: Mapping[str, Folder], editor: EditorUser | None) -> list[BaseRoute]:
    return [
        Route("/", lambda request: Response((PAGE_FOLDER / "city.html").read_text("utf-8"), media_type="text/html")),
        Route("/api/blocks", lambda request: JSONResponse({"blocks": list(runs)})),
        Mount("/page", StaticFiles(directory=PAGE_FOLDER)),
        *(Mount(f"/blocks/{number}", routes=_run_routes(out, editor)) for number, out in enumerate(runs.values())),
    ]


def _run_routes(out: Folder, editor: EditorUser | None) -> list[BaseRoute]:
    reader, replay = RunReader(out), StreetReplay()

    def answer(respond: Callable[[Request], Response]) -> Callable[[Request], Response]:
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

    def overview(request: Request) -> Response:
        return JSONResponse(reader.open_newest().block_map())

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
        return Response(encode_picture(image), media_type="image/webp", headers=IMMUTABLE)

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

    def grown(request: Request) -> Response:
        view = reader.open_newest()
        image = replay.draw_after_viewpoint(view, _parse_index(request, "viewpoint", len(view.tables.street)))
        return Response(encode_picture(image), media_type="image/webp", headers=IMMUTABLE)

    def in_3d(request: Request) -> Response:
        return JSONResponse(viewer_model_index(out, reader.open_newest()))

    def tile(request: Request) -> Response:
        file = find_model_file(out, request.query_params["of"], request.query_params.get("tile"))
        # its textures are JPEGs, which compression would not shrink
        headers = IMMUTABLE | {"Content-Encoding": "identity"}
        if isinstance(file, Path):
            return FileResponse(file, media_type="model/gltf-binary", headers=headers)
        return Response(file.read_bytes(), media_type="model/gltf-binary", headers=headers)

    routes: list[BaseRoute] = [
        Route("/", lambda request: Response((PAGE_FOLDER / "index.html").read_text("utf-8"), media_type="text/html")),
        Route("/api/block", answer(overview)),
        Route("/api/progress", answer(progress)),
        Route("/api/facade", answer(facade)),
        Route("/api/model", answer(in_3d)),
        Route("/model", answer(tile)),
        Route("/picture/facade", answer(stage)),
        Route("/picture/before", answer(earlier)),
        Route("/picture/panorama", answer(panorama)),
        Route("/picture/grown", answer(grown)),
        Mount("/page", StaticFiles(directory=PAGE_FOLDER)),
    ]
    if editor is not None:
        routes += correction_routes(reader, editor)
        if editor.photos is not None:
            routes += photo_match_routes(reader, editor, editor.photos)
    return routes


class _GuardMiddleware:
    """Middleware that rejects foreign requests and adds the security headers to every response."""

    def __init__(self, app: ASGIApp, guard: HostGuard) -> None:
        self.app, self.guard = app, guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":  # no route is a socket
            await self.app(scope, receive, send)
            return
        asked = Headers(scope=scope)
        hosts = asked.getlist("host")
        refused = self.guard.refusal(hosts, asked.getlist("origin"))
        added = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *added]
            await send(message)

        app = PlainTextResponse(refused[1], refused[0]) if refused else self.app
        await app(scope, receive, with_headers)


def _parse_index(request: Request, name: str, count: int) -> int:
    """Parse a number from 0 to count - 1 from the address. Raises InputError."""
    text = request.query_params.get(name, "")
    if not text.isascii() or not text.isdigit() or int(text) >= count:
        raise InputError(f"{name}: give a whole number from 0 to {count - 1}")
    return int(text)


def serve(
    out: Folder | Mapping[str, Folder],
    host: str,
    port: int,
    ready: Callable[[str, str | None], None],
    editor: EditorUser | None = None,
) -> None:
    """Serve `create_application` until interrupted.

    Parameters
    ----------
    out, host, editor : as of `create_application`. An editor is served on loopback only.
    port : port to listen on; 0 for any free port.
    ready : receives the address, with the editor's token, and a warning where other machines can reach the server.

    Raises
    ------
    InputError
        The host or port is unavailable.
    """
    import uvicorn

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((host, port))
            if editor is not None and not ip_address(listening.getsockname()[0]).is_loopback:
                raise InputError(f"--host {host}: what --edit writes is for this machine alone; leave --host out")
            listening.listen()  # early clients wait for the first answer
        except socket.gaierror as error:
            raise InputError(f"--host {host}: {error.strerror}; give an address or a name of this machine") from error
        except OSError as error:
            raise InputError(
                f"--host {host} --port {port}: {error.strerror}; give an address of this machine, and another port, or 0 "
                "for any that is free"
            ) from error
        bound, port = listening.getsockname()[:2]
        token = f"/#/token/{editor.token}" if editor else ""
        ready(f"http://{_page_host(host, bound)}:{port}{token}", _exposure_warning(host, bound, port))
        config = uvicorn.Config(
            create_application(out, host, bound, editor), log_level="warning", timeout_graceful_shutdown=2
        )
        uvicorn.Server(config).run(sockets=[listening])


def _page_host(host: str, bound: str) -> str:
    """Return the host for an address that opens the page on this machine."""
    if ip_address(bound).is_unspecified:
        return "[::1]" if ":" in bound else "127.0.0.1"
    return bracket_ipv6(host)


def _exposure_warning(host: str, bound: str, port: int) -> str | None:
    """Return a warning for a viewer that other machines can reach, else None."""
    if ip_address(bound).is_loopback:
        return None
    names = f"{host}:{port}"
    if ip_address(bound).is_unspecified:
        names = f"any address of this machine in digits or as {socket.gethostname()}, port {port}"
    return (
        f"--host {host}: whoever reaches this machine can look in, without a password; "
        f"it needs to be asked for as {names}: under another name it answers only with --host NAME"
    )
