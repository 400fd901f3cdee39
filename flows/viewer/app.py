"""HTTP application of the viewer, on loopback by default."""

from __future__ import annotations

import socket
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from facade_core.core.errors import InputError
from flows.viewer.city_pages import city_routes, single_run_routes
from flows.viewer.editing import EditorUser
from flows.viewer.guard import HostGuard, bracket_ipv6, create_guard
from tasks.viewing.city_view import CityReader
from tasks.viewing.run_view import RunReader

PAGE_FOLDER = Path(__file__).parent / "page"
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
    out: RunReader | CityReader, host: str, bound: str, editor: EditorUser | None = None
) -> Starlette:
    """Create the viewer of one run, or of the blocks of a city.

    Parameters
    ----------
    out : reader of the run or of the city.
    host : the host that the user named.
    bound : address that the server listens on.
    editor : person who may correct facades; None for a viewer without editing.
    """
    answers = single_run_routes(out, editor) if isinstance(out, RunReader) else city_routes(out, editor)
    page = (PAGE_FOLDER / "index.html").read_text("utf-8")
    routes: list[BaseRoute] = [
        Route("/", lambda request: Response(page, media_type="text/html")),
        Mount("/page", StaticFiles(directory=PAGE_FOLDER)),
        *answers,
    ]
    middleware = [
        Middleware(_GuardMiddleware, guard=create_guard(host, bound)),
        Middleware(GZipMiddleware, minimum_size=2000, compresslevel=5),
    ]
    return Starlette(routes=routes, middleware=middleware)


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


def serve(
    out: RunReader | CityReader,
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
