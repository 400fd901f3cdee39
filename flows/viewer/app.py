"""The viewer's pages and data over HTTP, on loopback unless told otherwise."""

from __future__ import annotations

import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from facade_core.errors import FacadeError, InputError, StoreError
from flows.viewer.model import Model
from tasks.viewing import Reader, picture, stages
from tasks.viewing.growth import Growth
from tasks.viewing.pictures import encode

PAGE = Path(__file__).parent / "page"
# A picture's address names its snapshot, and a snapshot never changes.
FOR_EVER = {"Cache-Control": "private, max-age=31536000, immutable"}
# Scripts, styles and pictures are the page's own; the model comes from the viewer's second port.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "frame-src http://{host}:* http://127.0.0.1:* http://localhost:*; base-uri 'none'; form-action 'none'"
)


def application(out: Path, host: str) -> Starlette:
    """The viewer of the run in folder `out`. It is served under no other name than `host` and the loopback's names."""
    reader, model, growth = Reader(out), Model(out, host), Growth()

    def answer(make: Callable[[Request], Response]) -> Callable[[Request], Response]:
        def endpoint(request: Request) -> Response:
            try:
                return make(request)
            except StoreError as error:  # nothing is there yet: a run that has just begun
                return JSONResponse({"reason": str(error)}, status_code=503)
            except KeyError as error:
                return JSONResponse({"reason": f"the address lacks {error}"}, status_code=404)
            except (FacadeError, IndexError, ValueError) as error:
                return JSONResponse({"reason": str(error)}, status_code=404)

        return endpoint

    def overview(request: Request) -> Response:
        return JSONResponse(reader.view().overview())

    def progress(request: Request) -> Response:
        return JSONResponse(reader.view().progress())

    def facade(request: Request) -> Response:
        view = reader.view()
        index = view.number(request.query_params["id"])
        record = view.records[index] or {}
        return JSONResponse(
            {
                "stages": [{"stage": stage, "title": title} for stage, title in stages(view, index)],
                "elements": record.get("elements", []),
                "seconds": record.get("seconds", {}),
                "reason": record.get("reason"),
                "snapshot": view.snapshot,
            }
        )

    def stage(request: Request) -> Response:
        view = reader.view()
        image = picture(view, view.number(request.query_params["id"]), request.query_params["stage"])
        return Response(encode(image), media_type="image/webp", headers=FOR_EVER)

    def panorama(request: Request) -> Response:
        view = reader.view()
        number = _whole(request, "viewpoint", len(view.tables.street))
        rgb = view.group["panoramas/rgb"][number]
        return Response(encode(rgb, "JPEG"), media_type="image/jpeg", headers=FOR_EVER)

    def grown(request: Request) -> Response:
        view = reader.view()
        image = growth.after(view, _whole(request, "viewpoint", len(view.tables.street)))
        return Response(encode(image), media_type="image/webp", headers=FOR_EVER)

    def in_3d(request: Request) -> Response:
        return JSONResponse({"port": model.port()})

    routes = [
        Route("/", lambda request: Response((PAGE / "index.html").read_text("utf-8"), media_type="text/html")),
        Route("/api/block", answer(overview)),
        Route("/api/progress", answer(progress)),
        Route("/api/facade", answer(facade)),
        Route("/api/model", answer(in_3d)),
        Route("/picture/facade", answer(stage)),
        Route("/picture/panorama", answer(panorama)),
        Route("/picture/grown", answer(grown)),
        Mount("/page", StaticFiles(directory=PAGE)),
    ]
    names = list(dict.fromkeys([host, "127.0.0.1", "localhost", "[::1]"]))
    middleware = [
        Middleware(
            TrustedHostMiddleware, allowed_hosts=names
        ),  # no other site's page may read this one's by a name of its own
        Middleware(GZipMiddleware, minimum_size=2000),
        Middleware(_Policy, policy=POLICY.format(host=host)),
    ]

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        yield
        model.close()

    return Starlette(routes=routes, middleware=middleware, lifespan=lifespan)


class _Policy:
    """Adds the content security policy to every response."""

    def __init__(self, app: Any, policy: str) -> None:
        self.app, self.header = app, (b"content-security-policy", policy.encode())

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        async def with_policy(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], self.header]
            await send(message)

        await self.app(scope, receive, with_policy if scope["type"] == "http" else send)


def _whole(request: Request, name: str, count: int) -> int:
    """A number from 0 to count - 1 out of the address. Raises InputError."""
    text = request.query_params.get(name, "")
    if not text.isascii() or not text.isdigit() or int(text) >= count:
        raise InputError(f"{name}: give a whole number from 0 to {count - 1}")
    return int(text)


def serve(out: Path, host: str, port: int, ready: Callable[[str], None]) -> None:
    """Serve until interrupted; `ready` is told the address. Raises InputError where the port is taken."""
    import uvicorn

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((host, port))
            listening.listen()  # who comes before the first answer waits for it
        except OSError as error:
            raise InputError(f"--port {port}: {error.strerror}; give another, or 0 for any that is free") from error
        ready(f"http://{host}:{listening.getsockname()[1]}")
        config = uvicorn.Config(application(out, host), log_level="warning", timeout_graceful_shutdown=2)
        uvicorn.Server(config).run(sockets=[listening])
