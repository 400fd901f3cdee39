"""A server of street pictures on loopback: a STAC API with the schema of GeoVisio 2.15, and Mapillary's Graph API 4, as their
answers were recorded; with pictures that any number of requests can be made of, and faults on demand."""

from __future__ import annotations

import io
import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

import numpy as np

# Of GeoVisio's landing page, what a client reads.
CONFORMS = tuple(
    f"https://api.stacspec.org/v1.0.0/{name}"
    for name in ("core", "browseable", "collections", "ogcapi-features", "item-search")
)
# Answers a request in place of the server: status, headers, body; None leaves it to the server.
Fault = Callable[[str, Mapping[str, str]], "tuple[int, dict[str, str], bytes] | None"]


@dataclass(frozen=True)
class Shot:
    """A picture of the server: where it was taken, degrees; what its service says of it."""

    id: str
    lon: float
    lat: float
    heading: float | None = 0.0
    captured: str = "2024-05-17"
    licence: str | None = "CC-BY-SA-4.0"
    author: str | None = "anna"
    field_of_view: int = 360
    size: tuple[int, int] = (128, 256)
    content: bytes | None = None


@dataclass
class Imagery:
    """A server that answers. asked: how often each path was; headers: those of the last request of a path; faults: by path,
    what is answered instead. limit: pictures of a page, pages without a next link where paged is False."""

    shots: Sequence[Shot]
    limit: int = 10_000
    paged: bool = True
    delay_s: float = 0.0
    asked: Counter[str] = field(default_factory=Counter)
    headers: dict[str, dict[str, str]] = field(default_factory=dict)
    faults: dict[str, Fault] = field(default_factory=dict)
    address: str = ""
    _picture: bytes = b""

    def stac(self) -> str:
        return f"{self.address}/api"

    def answer(self, path: str, headers: Mapping[str, str]) -> tuple[int, dict[str, str], bytes]:
        parts = urlsplit(path)
        self.asked[parts.path] += 1
        self.headers[parts.path] = {name.lower(): value for name, value in headers.items()}
        fault = self.faults.get(parts.path)
        if fault is not None and (answered := fault(path, self.headers[parts.path])) is not None:
            return answered
        asked = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        if parts.path in ("/api", "/api/"):
            return _said(self._landing())
        if parts.path == "/api/search":
            return _said(self._search(asked))
        if parts.path == "/images":
            return self._images(asked, self.headers[parts.path])
        if parts.path.startswith("/api/pictures/"):
            time.sleep(self.delay_s)
            return self._bytes(parts.path.split("/")[3])
        return 404, {}, b""

    def _landing(self) -> dict[str, Any]:
        links = [("self", ""), ("root", ""), ("data", "/collections"), ("search", "/search")]
        return {
            "type": "Catalog",
            "stac_version": "1.0.0",
            "id": "geovisio",
            "description": "The open source photo mapping solution",
            "conformsTo": list(CONFORMS),
            "links": [{"rel": rel, "href": f"{self.stac()}{end}", "type": "application/json"} for rel, end in links],
        }

    def _search(self, asked: Mapping[str, str]) -> dict[str, Any]:
        found = self._inside(asked.get("bbox"), asked.get("datetime"))
        size = min(self.limit, int(asked.get("limit", 10)))
        first = int(asked.get("page", 0)) * size
        links = [{"rel": "root", "href": self.stac(), "type": "application/json"}]
        if self.paged and first + size < len(found):
            following = urlencode({**asked, "page": int(asked.get("page", 0)) + 1})
            links.append({"rel": "next", "href": f"{self.stac()}/search?{following}", "type": "application/geo+json"})
        return {
            "type": "FeatureCollection",
            "features": [self.item(s) for s in found[first : first + size]],
            "links": links,
        }

    def item(self, shot: Shot) -> dict[str, Any]:
        """A picture as GeoVisio says it."""
        said = {
            "datetime": f"{shot.captured}T10:15:00+00:00",
            "license": shot.licence,
            "view:azimuth": shot.heading,
            "pers:interior_orientation": {
                "field_of_view": shot.field_of_view,
                "sensor_array_dimensions": [shot.size[1], shot.size[0]],
            },
            "pers:pitch": 0.0,
            "pers:roll": 0.0,
            "geovisio:producer": shot.author,
        }
        links = [{"rel": "license", "href": f"https://spdx.org/licenses/{shot.licence}.html"}] if shot.licence else []
        return {
            "type": "Feature",
            "stac_version": "1.0.0",
            "id": shot.id,
            "geometry": {"type": "Point", "coordinates": [shot.lon, shot.lat]},
            "bbox": [shot.lon, shot.lat, shot.lon, shot.lat],
            "collection": "0baf96dc-b9da-4c7c-92b5-23bd0375f6b8",
            "providers": [{"name": shot.author, "roles": ["producer"]}] if shot.author else [],
            "properties": {name: value for name, value in said.items() if value is not None},
            "links": links,
            "assets": {
                "hd": {"roles": ["data"], "type": "image/jpeg", "href": self.url(shot)},
                "thumb": {"roles": ["thumbnail"], "type": "image/jpeg", "href": f"{self.url(shot)}?thumb"},
            },
        }

    def url(self, shot: Shot) -> str:
        return f"{self.address}{picture_path(shot.id)}"

    def _images(self, asked: Mapping[str, str], headers: Mapping[str, str]) -> tuple[int, dict[str, str], bytes]:
        if not headers.get("authorization", "").startswith("OAuth "):
            return 401, {}, b'{"error": {"message": "Invalid OAuth access token"}}'
        dates = f"{asked.get('start_captured_at', '..')}/{asked.get('end_captured_at', '..')}"
        found = self._inside(asked.get("bbox"), dates)[: min(self.limit, int(asked["limit"]))]
        return _said({"data": [self._record(shot) for shot in found]})

    def _record(self, shot: Shot) -> dict[str, Any]:
        taken = np.datetime64(shot.captured).astype("datetime64[ms]").astype(int)
        said = {
            "id": shot.id,
            "camera_type": "spherical" if shot.field_of_view == 360 else "perspective",
            "is_pano": shot.field_of_view == 360,
            "captured_at": int(taken),
            "computed_geometry": {"type": "Point", "coordinates": [shot.lon, shot.lat]},
            "computed_compass_angle": shot.heading,
            "creator": {"username": shot.author, "id": "1"},
            "height": shot.size[0],
            "width": shot.size[1],
            "thumb_original_url": self.url(shot),
        }
        return {name: value for name, value in said.items() if value is not None}

    def _inside(self, bbox: str | None, dates: str | None) -> list[Shot]:
        west, south, east, north = (float(value) for value in (bbox or "-180,-90,180,90").split(","))
        first, _, last = (dates or "../..").partition("/")
        return [
            shot
            for shot in self.shots
            if west <= shot.lon <= east
            and south <= shot.lat <= north
            and (first == ".." or shot.captured >= first[:10])
            and (last == ".." or shot.captured <= last[:10])
        ]

    def _bytes(self, identifier: str) -> tuple[int, dict[str, str], bytes]:
        shot = next((one for one in self.shots if picture_path(one.id).split("/")[3] == identifier), None)
        if shot is None:
            return 404, {}, b""
        if shot.content is not None:
            return 200, {"Content-Type": "image/jpeg"}, shot.content
        self._picture = self._picture or jpeg(*shot.size)
        return 200, {"Content-Type": "image/jpeg"}, commented(self._picture, shot.id)


def picture_path(identifier: str) -> str:
    """Where the server has a picture's bytes."""
    return f"/api/pictures/{''.join(c if c.isalnum() or c in '-_' else '_' for c in identifier)}/hd.jpg"


def jpeg(rows: int, columns: int, seed: int = 0) -> bytes:
    """A picture with sky above and something below, as JPEG."""
    from PIL import Image

    rng = np.random.default_rng(seed)
    sky = np.linspace(200, 90, rows)[:, None, None] + rng.normal(0, 6, (rows, columns, 1)) + np.array([0, 10, 30])
    written = io.BytesIO()
    Image.fromarray(np.clip(sky, 0, 255).astype(np.uint8)).save(written, "JPEG", quality=90)
    return written.getvalue()


def commented(picture: bytes, text: str) -> bytes:
    """A JPEG with a comment, which makes it another file of the same picture."""
    comment = text.encode(errors="surrogatepass")
    return picture[:2] + b"\xff\xfe" + (len(comment) + 2).to_bytes(2, "big") + comment + picture[2:]


@contextmanager
def serving(imagery: Imagery) -> Iterator[Imagery]:
    """Answer on a free port of loopback until the block ends."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            status, headers, body = imagery.answer(self.path, dict(self.headers.items()))
            self.send_response(status)
            for name, value in {"Content-Length": str(len(body)), **headers}.items():
                self.send_header(name, value)
            self.end_headers()
            try:
                self.wfile.write(body)
            except (BrokenPipeError, ConnectionResetError):  # whoever asked was killed
                self.close_connection = True
            if int(headers.get("Content-Length", len(body))) != len(body):
                self.close_connection = True

        def log_message(self, *_: object) -> None: ...

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: object) -> None: ...

    server = Server(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    imagery.address = f"http://127.0.0.1:{server.server_port}"
    try:
        yield imagery
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def _said(value: Any) -> tuple[int, dict[str, str], bytes]:
    return 200, {"Content-Type": "application/json"}, json.dumps(value).encode()
