"""A small sound file of every geometry format that is read: two buildings, or two streets."""

from __future__ import annotations

import gzip
import json
import struct
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import geopandas as gpd
import numpy as np
from shapely import LineString, Polygon

EAST, NORTH = 385_000.0, 6_671_000.0
PLACES = {"a": 0.0, "b": 30.0}
SIDES = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
FACES = [(3, 2, 1, 0), (4, 5, 6, 7), *SIDES]


def corners(x: float) -> list[tuple[float, float]]:
    return [(EAST + x, NORTH), (EAST + x + 12, NORTH), (EAST + x + 12, NORTH + 9), (EAST + x, NORTH + 9)]


def box(x: float) -> np.ndarray:
    """The corners of a building, (8, 3)."""
    return np.array([(*corner, z) for z in (0.0, 7.0) for corner in corners(x)])


def outlines() -> gpd.GeoDataFrame:
    table = {"id": list(PLACES), "height": [7.0, 8.0], "name": ["A", "B"]}
    return gpd.GeoDataFrame(table, geometry=[Polygon(corners(x)) for x in PLACES.values()], crs="EPSG:32635")


def lines() -> gpd.GeoDataFrame:
    shapes = [LineString([(EAST + x, NORTH - 6), (EAST + x + 30, NORTH - 6)]) for x in PLACES.values()]
    return gpd.GeoDataFrame({"id": ["1", "2"], "name": ["A", "B"]}, geometry=shapes, crs="EPSG:32635")


def vectors(table: Callable[[], gpd.GeoDataFrame], path: Path) -> None:
    if path.suffix == ".parquet":
        table().to_parquet(path)
    else:
        table().to_file(path)


def cityjson(path: Path) -> None:
    objects, vertices = {}, []
    for name, x in PLACES.items():
        first = len(vertices)
        vertices += (box(x) * 1000).astype(int).tolist()
        shell = [[[first + corner for corner in face]] for face in FACES]
        geometry = [{"type": "Solid", "lod": "2.2", "boundaries": [shell]}]
        objects[name] = {"type": "Building", "attributes": {"name": name}, "geometry": geometry}
    head: dict[str, Any] = {
        "type": "CityJSON",
        "version": "2.0",
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/32635"},
        "transform": {"scale": [0.001] * 3, "translate": [0, 0, 0]},
    }
    if path.suffix == ".json":
        path.write_text(json.dumps({**head, "CityObjects": objects, "vertices": vertices}))
        return
    text = [json.dumps({**head, "CityObjects": {}, "vertices": []})]
    text += [
        json.dumps({"type": "CityJSONFeature", "id": name, "CityObjects": {name: thing}, "vertices": vertices})
        for name, thing in objects.items()
    ]
    path.write_text("\n".join(text))


def citygml(path: Path) -> None:
    buildings = ""
    for name, x in PLACES.items():
        points = box(x)
        surfaces = ""
        for face in FACES:
            ring = " ".join(
                f"{value:g}" if value < 100 else f"{value:.1f}" for i in (*face, face[0]) for value in points[i]
            )
            surfaces += (
                "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList srsDimension='3'>"
                f"{ring}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember>"
            )
        buildings += (
            f"<cityObjectMember><bldg:Building gml:id='{name}'><bldg:lod1Solid><gml:Solid><gml:exterior>"
            f"<gml:CompositeSurface>{surfaces}</gml:CompositeSurface></gml:exterior></gml:Solid></bldg:lod1Solid>"
            "</bldg:Building></cityObjectMember>"
        )
    text = (
        "<CityModel xmlns='http://www.opengis.net/citygml/2.0' xmlns:gml='http://www.opengis.net/gml' "
        "xmlns:bldg='http://www.opengis.net/citygml/building/2.0'><gml:boundedBy><gml:Envelope srsName='EPSG:32635'/>"
        f"</gml:boundedBy>{buildings}</CityModel>"
    )
    path.write_bytes(gzip.compress(text.encode(), mtime=0) if path.suffix == ".gz" else text.encode())


def triangles() -> dict[str, np.ndarray]:
    return {
        name: box(x)[[[f[i] for i in t] for f in FACES for t in ((0, 1, 2), (0, 2, 3))]] for name, x in PLACES.items()
    }


def obj(path: Path) -> None:
    text = ["mtllib a.mtl"]
    for number, (name, x) in enumerate(PLACES.items()):
        text.append(f"g {name}")
        text += [f"v {a} {b} {c}" for a, b, c in box(x).tolist()]
        text += ["f " + " ".join(str(8 * number + corner + 1) for corner in face) for face in FACES]
    path.write_text("\n".join([*text, ""]))


def npz(path: Path) -> None:
    parts = list(triangles().values())
    feature = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    np.savez_compressed(path, triangles=np.concatenate(parts), feature=feature, epsg=np.array(32635))


def ply(path: Path) -> None:
    import trimesh

    points = np.concatenate(list(triangles().values())).reshape(-1, 3)
    mesh = trimesh.Trimesh(points, np.arange(len(points)).reshape(-1, 3), process=False)
    path.write_bytes(mesh.export(file_type="ply", encoding="ascii" if "ascii" in path.name else "binary_little_endian"))


def gltf(path: Path) -> None:
    """y up, as glTF has it: x, z, -y."""
    data, views, accessors, meshes = b"", [], [], []
    for part in triangles().values():
        points = part.reshape(-1, 3)[:, [0, 2, 1]] * (1, 1, -1) - (EAST, 0, -NORTH)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": points.size * 4})
        data += points.astype("<f4").tobytes()
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(points), "type": "VEC3"})
        accessors[-1] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
        meshes.append({"primitives": [{"attributes": {"POSITION": len(accessors) - 1}}]})
    header: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 1], "extras": {"origin": [EAST, NORTH, 0]}}],
        "nodes": [{"name": name, "mesh": number} for number, name in enumerate(PLACES)],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    if path.suffix == ".gltf":
        (path.parent / "b.bin").write_bytes(data)
        header["buffers"][0]["uri"] = "b.bin"
        path.write_text(json.dumps(header))
        return
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    length = 28 + len(text) + len(data)
    head = struct.pack("<4sIII4s", b"glTF", 2, length, len(text), b"JSON")
    path.write_bytes(head + text + struct.pack("<I4s", len(data), b"BIN\0") + data)


def walls(path: Path) -> None:
    found = {}
    for name, x in PLACES.items():
        around = [*corners(x), corners(x)[0]]
        found[name] = {
            str(i): [[*a, 0.0], [*b, 0.0], [*b, 7.0], [*a, 7.0]]
            for i, (a, b) in enumerate(zip(around[:-1], around[1:], strict=True))
        }
    path.write_text(json.dumps({"crs": "EPSG:32635", "walls": found}))


def graphml(path: Path) -> None:
    keys = {"x": "node", "y": "node", "name": "edge", "osmid": "edge", "highway": "edge", "geometry": "edge"}
    text = "".join(f"<key id='{k}' for='{on}' attr.name='{k}' attr.type='string'/>" for k, on in keys.items())
    text += "<key id='crs' for='graph' attr.name='crs' attr.type='string'/>"
    nodes = "".join(
        f"<node id='{i}'><data key='x'>{EAST + x}</data><data key='y'>{NORTH - 6}</data></node>"
        for i, x in enumerate((0, 30, 60))
    )
    edges = "".join(
        f"<edge source='{i}' target='{i + 1}'><data key='name'>N{i}</data><data key='osmid'>{i + 1}</data>"
        "<data key='highway'>residential</data></edge>"
        for i in range(2)
    )
    path.write_text(
        f"<?xml version='1.0'?><graphml xmlns='http://graphml.graphdrawing.org/xmlns'>{text}"
        f"<graph edgedefault='directed'><data key='crs'>EPSG:32635</data>{nodes}{edges}</graph></graphml>"
    )


def _varint(value: int) -> bytes:
    found = b""
    while value > 127:
        found, value = found + bytes([value & 127 | 128]), value >> 7
    return found + bytes([value])


def _field(number: int, value: int | bytes) -> bytes:
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    return _varint(number << 3 | 2) + _varint(len(value)) + value


def _zigzag(values: np.ndarray) -> bytes:
    steps = np.diff(values, prepend=0).tolist()
    return b"".join(_varint((step << 1) ^ (step >> 63)) for step in steps)


def blob(kind: bytes, content: bytes, size: int | None = None) -> bytes:
    """A block of a .osm.pbf; size: what it claims to unpack to."""
    packed = _field(2, len(content) if size is None else size) + _field(3, zlib.compress(content))
    head = _field(1, kind) + _field(3, len(packed))
    return struct.pack(">I", len(head)) + head + packed


def pbf(path: Path) -> None:
    """Two outlines and a street, in degrees."""
    strings = [b"", b"building", b"yes", b"height", b"7", b"highway", b"residential", b"name", b"A"]
    places = [
        (24.93 + x + dx, 60.16 + dy) for x in (0, 6e-4) for dx, dy in ((0, 0), (3e-4, 0), (3e-4, 2e-4), (0, 2e-4))
    ]
    places += [(24.9295, 60.1599), (24.9315, 60.1599)]
    degrees = np.round(np.array(places) * 1e7).astype(np.int64)
    dense = _field(1, _zigzag(np.arange(1, len(places) + 1)))
    dense += _field(8, _zigzag(degrees[:, 1])) + _field(9, _zigzag(degrees[:, 0]))
    ways = b""
    for id, nodes, keys, values in (
        (1, [1, 2, 3, 4, 1], b"\x01\x03", b"\x02\x04"),
        (2, [5, 6, 7, 8, 5], b"\x01\x03", b"\x02\x04"),
        (3, [9, 10], b"\x05\x07", b"\x06\x08"),
    ):
        way = _field(1, id) + _field(2, keys) + _field(3, values) + _field(8, _zigzag(np.array(nodes)))
        ways += _field(3, way)
    table = _field(1, b"".join(_field(1, text) for text in strings))
    block = table + _field(2, _field(2, dense)) + _field(2, ways)
    head = _field(4, b"OsmSchema-V0.6") + _field(4, b"DenseNodes")
    path.write_bytes(blob(b"OSMHeader", head) + blob(b"OSMData", block))


# File name -> what writes it.
BUILDINGS: Mapping[str, Callable[[Path], None]] = {
    "b.geojson": lambda path: vectors(outlines, path),
    "b.gpkg": lambda path: vectors(outlines, path),
    "b.shp": lambda path: vectors(outlines, path),
    "b.fgb": lambda path: vectors(outlines, path),
    "b.parquet": lambda path: vectors(outlines, path),
    "b.city.json": cityjson,
    "b.city.jsonl": cityjson,
    "b.gml": citygml,
    "b.gml.gz": citygml,
    "b.obj": obj,
    "b.glb": gltf,
    "b.gltf": gltf,
    "b.ply": ply,
    "ascii.ply": ply,
    "b.npz": npz,
    "walls.json": walls,
    "b.osm.pbf": pbf,
}
STREETS: Mapping[str, Callable[[Path], None]] = {
    "s.geojson": lambda path: vectors(lines, path),
    "s.gpkg": lambda path: vectors(lines, path),
    "s.shp": lambda path: vectors(lines, path),
    "s.fgb": lambda path: vectors(lines, path),
    "s.parquet": lambda path: vectors(lines, path),
    "s.graphml": graphml,
    "s.osm.pbf": pbf,
}
