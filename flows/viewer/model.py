"""The textured block in 3D, by viser on a port of its own, started when somebody first asks for it."""

from __future__ import annotations

import json
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalogs.published.snapshot import current_if_any
from facade_core.errors import StoreError
from flows.viewer.guard import Guard, in_address, name_in

if TYPE_CHECKING:
    from viser import ViserServer
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response


class Model:
    """Shows the model that a run published last. It is loaded anew when another one is published."""

    def __init__(self, out: Path, host: str, guard: Guard) -> None:
        self._out, self._host, self._guard = out, host, guard
        self._server: ViserServer | None = None
        self._shown: str | None = None
        self._lock = threading.Lock()

    def port(self) -> int:
        """The port that shows the newest model. Raises StoreError before anything is published."""
        snapshot = current_if_any(self._out)
        if snapshot is None:
            raise StoreError("nothing is published yet: the model appears at the end of the run")
        with self._lock:
            if self._server is None:
                self._server = _server(self._host, self._guard)
            if self._shown != snapshot.id:
                with snapshot.being_read():
                    # a block that is too large for one model has a small one
                    shown = snapshot.model if snapshot.model.is_file() else snapshot.overview
                    data = shown.read_bytes()
                self._server.scene.add_glb("/block", data)
                _look_at(self._server, data)
                self._shown = snapshot.id
            return self._server.get_port()

    def close(self) -> None:
        if self._server is not None:
            self._server.stop()


def _server(host: str, guard: Guard) -> ViserServer:
    import rich
    import viser

    class Server(viser.ViserServer):
        def request_share_url(self, verbose: bool = True) -> None:
            """Nothing: viser would open a tunnel from the internet to this port for any visitor who sends a message."""

    console = rich.get_console()
    console.quiet = True  # it announces its own address, which is no use without the page
    try:
        with _guarded_sockets(guard):
            server = Server(host=host, port=0, label="Streetloom", verbose=False)
    finally:
        console.quiet = False
    server.scene.set_up_direction("+y")  # glTF's
    server.gui.configure_theme(control_layout="collapsible", show_logo=False, show_share_button=False)
    return server


@contextmanager
def _guarded_sockets(guard: Guard) -> Iterator[None]:
    """Servers of sockets that are started meanwhile ask `guard` first: viser has no setting for whom it answers."""
    from websockets.asyncio import server as sockets

    serve = sockets.serve

    def guarded(handler: Any, *address: Any, process_request: Any, **options: Any) -> Any:
        def asked(connection: ServerConnection, request: Request) -> Response | None:
            hosts = request.headers.get_all("Host")
            if refused := guard.refusal(hosts, request.headers.get_all("Origin")):
                return connection.respond(HTTPStatus(refused[0]), refused[1])
            response: Response | None = process_request(connection, request)
            if response is not None:
                name = in_address(name_in(hosts[0]))
                response.headers["Content-Security-Policy"] = f"frame-ancestors http://{name}:*"
                response.headers["X-Content-Type-Options"] = "nosniff"
                response.headers["Referrer-Policy"] = "no-referrer"
            return response

        return serve(handler, *address, process_request=asked, **options)

    sockets.serve = guarded  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        sockets.serve = serve  # type: ignore[misc]


def _look_at(server: ViserServer, data: bytes) -> None:
    """Point new visitors at the whole block, from the south and above."""
    low, high = _bounds(data)
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    reach = max(high[0] - low[0], high[2] - low[2], high[1] - low[1])
    server.initial_camera.look_at = (middle[0], middle[1], middle[2])
    server.initial_camera.position = (middle[0], middle[1] + 0.6 * reach, middle[2] + 0.75 * reach)
    server.initial_camera.far = 20 * reach


def _bounds(data: bytes) -> tuple[list[float], list[float]]:
    """Corners of a GLB's box, from the limits that its header states of all positions, and where its nodes stand."""
    length = struct.unpack_from("<I", data, 12)[0]
    header = json.loads(data[20 : 20 + length])
    corners: list[list[float]] = []
    for node in header["nodes"]:
        moved = node.get("translation", (0.0, 0.0, 0.0))
        for primitive in header["meshes"][node["mesh"]]["primitives"]:
            limits = header["accessors"][primitive["attributes"]["POSITION"]]
            corners += [[a + b for a, b in zip(limits[end], moved, strict=True)] for end in ("min", "max")]
    return [min(axis) for axis in zip(*corners, strict=True)], [max(axis) for axis in zip(*corners, strict=True)]
