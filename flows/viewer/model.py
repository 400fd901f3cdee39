"""The textured block in 3D, by viser on a port of its own, started when somebody first asks for it."""

from __future__ import annotations

import json
import struct
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from facade_core.errors import StoreError
from tasks.standing import current_snapshot

if TYPE_CHECKING:
    from viser import ViserServer


class Model:
    """Shows the model that a run published last. It is loaded anew when another one is published."""

    def __init__(self, out: Path, host: str) -> None:
        self._out, self._host = out, host
        self._server: ViserServer | None = None
        self._shown: str | None = None
        self._lock = threading.Lock()

    def port(self) -> int:
        """The port that shows the newest model. Raises StoreError before anything is published."""
        snapshot = current_snapshot(self._out)
        if snapshot is None:
            raise StoreError("nothing is published yet: the model appears at the end of the run")
        with self._lock:
            if self._server is None:
                self._server = _server(self._host)
            if self._shown != snapshot:
                data = (self._out / "published" / snapshot / "block.glb").read_bytes()
                self._server.scene.add_glb("/block", data)
                _look_at(self._server, data)
                self._shown = snapshot
            return self._server.get_port()

    def close(self) -> None:
        if self._server is not None:
            self._server.stop()


def _server(host: str) -> ViserServer:
    import rich
    import viser

    console = rich.get_console()
    console.quiet = True  # it announces its own address, which is no use without the page
    try:
        server = viser.ViserServer(host=host, port=0, label="Streetloom", verbose=False)
    finally:
        console.quiet = False
    server.scene.set_up_direction("+y")  # glTF's
    server.gui.configure_theme(control_layout="collapsible", show_logo=False, show_share_button=False)
    return server


def _look_at(server: ViserServer, data: bytes) -> None:
    """Point new visitors at the whole block, from the south and above."""
    low, high = _bounds(data)
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    reach = max(high[0] - low[0], high[2] - low[2], high[1] - low[1])
    server.initial_camera.look_at = (middle[0], middle[1], middle[2])
    server.initial_camera.position = (middle[0], middle[1] + 0.6 * reach, middle[2] + 0.75 * reach)
    server.initial_camera.far = 20 * reach


def _bounds(data: bytes) -> tuple[list[float], list[float]]:
    """Corners of a GLB's box, from the limits that its header states of all positions."""
    length = struct.unpack_from("<I", data, 12)[0]
    header = json.loads(data[20 : 20 + length])
    positions = {p["attributes"]["POSITION"] for mesh in header["meshes"] for p in mesh["primitives"]}
    limits = [(header["accessors"][i]["min"], header["accessors"][i]["max"]) for i in positions]
    return (
        [min(low[axis] for low, _ in limits) for axis in range(3)],
        [max(high[axis] for _, high in limits) for axis in range(3)],
    )
