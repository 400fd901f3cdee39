"""Buildings as closed models: CityJSON, CityGML, OBJ, glTF, PLY and arrays of triangles."""

from __future__ import annotations

import gzip
import json
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np
import shapely
from PIL import Image

from benchmarks.generated_inputs.truth import FOOT_M, Case, project
from benchmarks.generated_inputs.vectors import STEMS
from facade_core.core.arrays import Float64Array

FORMATS = ("cityjson", "cityjsonseq", "citygml", "obj", "gltf", "glb", "ply", "npz")
Faces = list[Float64Array]  # corners (n, 3) of each, counter-clockwise from outside; the floor, the roof, the walls


def write_models(draw: Random, case: Case, folder: Path, keys: dict[str, Any]) -> Path:
    """Write the buildings as models; `keys` receives the keys of `buildings`."""
    kind = draw.choice(FORMATS)
    case.made |= {"format": kind, "heights": "model"}
    case.forget(levels=None)
    place = case.place
    z = draw.choice(("sea", "ellipsoid", "zero"))
    level = {"sea": case.ground, "ellipsoid": case.ground + place.geoid, "zero": 0.0}[z]
    options = ["metric", "metric", "metric", *["feet" if place.feet else "metric"] * 3]
    options += ["prefix-unknown"] if place.prefixed else []
    options += ["lonlat"] if kind == "citygml" else []
    options += ["unstated"]
    what = draw.choice(options)
    crs = {"feet": place.feet, "lonlat": "EPSG:4326"}.get(what) or draw.choice(place.metric)
    unit = FOOT_M if what == "feet" else 1.0
    case.made |= {"frame": what, "z": z}
    solids = []
    for house in case.houses:
        outline = shapely.get_coordinates(project(shapely.orient_polygons(house.outline), place.frame, crs))[:-1]
        if what == "prefix-unknown":
            assert place.prefixed is not None
            outline = outline + np.array([place.prefixed[1], 0.0])
        solids.append(_extrude(outline, level / unit, (level + (house.height or 0.0)) / unit))
    case.houses = [replace(house, base=level) for house in case.houses]
    if what in ("prefix-unknown", "unstated"):
        case.sound = False
    stem = draw.choice(STEMS)
    stated: str | None = None if what == "unstated" else crs
    if kind in ("cityjson", "cityjsonseq"):
        return _write_cityjson(draw, case, folder / stem, solids, stated, kind)
    if kind == "citygml":
        return _write_citygml(draw, case, folder / stem, solids, stated)
    if kind == "npz" and draw.random() < 0.5 and stated:
        case.made["epsg in npz"] = True
    elif stated:
        keys["crs"] = stated
    case.forget(name=None)
    names = [house.id or "" for house in case.houses]
    if kind == "npz":
        return _write_npz(case, folder / f"{stem}.npz", solids, None if "crs" in keys else stated)
    origin = np.floor(solids[0][0].min(axis=0))
    if kind in ("gltf", "glb", "ply") or draw.random() < 0.3:
        solids = [[face - origin for face in faces] for faces in solids]
        keys["offset"] = (origin * (1.0, 1.0, unit)).tolist()  # z of models is in metres by then
        case.made["offset"] = True
    if kind == "obj":
        return _write_obj(draw, case, folder / f"{stem}.obj", solids, names, keys)
    if kind == "ply":
        return _write_ply(draw, case, folder / f"{stem}.ply", solids, keys)
    return _write_gltf(draw, case, folder / f"{stem}.{kind}", solids, names)


def _extrude(outline: Float64Array, low: float, high: float) -> Faces:
    bottom = np.column_stack([outline, np.full(len(outline), low)])
    top = np.column_stack([outline, np.full(len(outline), high)])
    after = np.roll(np.arange(len(outline)), -1)
    walls = [np.array([bottom[a], bottom[b], top[b], top[a]]) for a, b in enumerate(after.tolist())]
    return [bottom[::-1].copy(), top, *walls]


def _triangles(face: Float64Array) -> Float64Array:
    """Triangles (n, 3, 3) of a plane face; a level one may be concave."""
    if np.ptp(face[:, 2]) > 1e-6:
        return np.array([[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)])
    found = [
        shapely.get_coordinates(shapely.orient_polygons(part))[:3]
        for part in shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(face[:, :2])))
    ]
    flat = np.array(found)
    if not shapely.is_ccw(shapely.LinearRing(face[:, :2])):
        flat = flat[:, ::-1]
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), face[0, 2])], axis=2)


def _mesh(faces: Faces) -> Float64Array:
    return np.concatenate([_triangles(face) for face in faces])


def _write_cityjson(draw: Random, case: Case, path: Path, solids: Sequence[Faces], crs: str | None, kind: str) -> Path:
    corner = np.floor(solids[0][0].min(axis=0))
    vertices: list[list[int]] = []
    number: dict[tuple[int, ...], int] = {}

    def index(xyz: Float64Array) -> int:
        key = tuple(np.round((xyz - corner) * 1000).astype(int).tolist())
        if key not in number:
            number[key] = len(vertices)
            vertices.append(list(key))
        return number[key]

    objects: dict[str, Any] = {}
    name_key = draw.choice(("name", "Name", "identificatie-naam"))
    parts: list[tuple[str, dict[str, Any]]] = []
    for house, faces in zip(case.houses, solids, strict=True):
        boundaries = [[[index(xyz) for xyz in face]] for face in faces]
        values = [0, 1, *[2] * (len(faces) - 2)]
        semantics = {"surfaces": [{"type": f"{one}Surface"} for one in ("Ground", "Roof", "Wall")], "values": [values]}
        geometry = {
            "type": "Solid",
            "lod": draw.choice(("1.2", "2.2", 2)),
            "boundaries": [boundaries],
            "semantics": semantics,
        }
        parts.append(
            (house.id or "", {"type": "Building", "attributes": {name_key: house.name}, "geometry": [geometry]})
        )
    objects = dict(parts)
    if name_key == "identificatie-naam":
        case.forget(name=None)
    head: dict[str, Any] = {
        "type": "CityJSON",
        "version": draw.choice(("1.0", "1.1", "2.0")) if kind == "cityjson" else "2.0",
        "transform": {"scale": [0.001] * 3, "translate": corner.tolist()},
    }
    if crs:
        code = crs.split(":")[1]
        old = f"urn:ogc:def:crs:EPSG::{code}"
        head["metadata"] = {
            "referenceSystem": old if head["version"] == "1.0" else f"https://www.opengis.net/def/crs/EPSG/0/{code}"
        }
    if draw.random() < 0.2:
        id = draw.choice(list(objects))
        case.break_with("vertex index out of range")
        objects[id]["geometry"][0]["boundaries"][0][2][0][0] = 10**6
    if kind == "cityjson":
        target = path.with_name(f"{path.name}{draw.choice(('.city.json', '.json'))}")
        target.write_text(
            json.dumps(head | {"CityObjects": objects, "vertices": vertices}, ensure_ascii=False), "utf-8"
        )
        return target
    target = path.with_name(f"{path.name}.city.jsonl")
    lines = [head | {"CityObjects": {}, "vertices": []}]
    lines += [
        {"type": "CityJSONFeature", "id": id, "CityObjects": {id: one}, "vertices": vertices}
        for id, one in objects.items()
    ]
    target.write_text("\n".join(json.dumps(line, ensure_ascii=False) for line in lines) + "\n", "utf-8")
    return target


def _write_citygml(draw: Random, case: Case, path: Path, solids: Sequence[Faces], crs: str | None) -> Path:
    version, gml = draw.choice((("1.0", "gml"), ("2.0", "gml")))
    is_degrees = crs == "EPSG:4326"
    members = []
    for house, faces in zip(case.houses, solids, strict=True):
        surfaces = []
        for number, face in enumerate(faces):
            ring = np.concatenate([face, face[:1]])
            if is_degrees:
                ring = ring[:, [1, 0, 2]]
            kind = ("GroundSurface", "RoofSurface", "WallSurface")[min(number, 2)]
            positions = " ".join(f"{value:.9f}" for value in ring.ravel().tolist())
            polygon = (
                f"<gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>{positions}</gml:posList></gml:LinearRing>"
                "</gml:exterior></gml:Polygon>"
            )
            surfaces.append(
                f"<bldg:boundedBy><bldg:{kind}><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>{polygon}"
                f"</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:{kind}></bldg:boundedBy>"
            )
        members.append(
            f"<core:cityObjectMember><bldg:Building gml:id={quoteattr(house.id or '')}><gml:name>{escape(house.name or '')}"
            f"</gml:name>{''.join(surfaces)}</bldg:Building></core:cityObjectMember>"
        )
    code = "" if crs is None else crs.split(":")[1]
    name = draw.choice((f"urn:ogc:def:crs:EPSG::{code}", f"http://www.opengis.net/def/crs/EPSG/0/{code}"))
    bounds = f'<gml:boundedBy><gml:Envelope srsName="{name}" srsDimension="3"/></gml:boundedBy>' if crs else ""
    encoding = draw.choice(("UTF-8", "UTF-8", "UTF-16", "ISO-8859-1"))
    text = (
        f'<?xml version="1.0" encoding="{encoding}"?>'
        f'<core:CityModel xmlns:core="http://www.opengis.net/citygml/{version}" xmlns:gml="http://www.opengis.net/{gml}"'
        f' xmlns:bldg="http://www.opengis.net/citygml/building/{version}">{bounds}{"".join(members)}</core:CityModel>'
    )
    content = text.encode(encoding, "xmlcharrefreplace")
    case.made["encoding"] = encoding
    suffix = draw.choice((".gml", ".xml", ".gml.gz"))
    target = path.with_name(f"{path.name}{suffix}")
    target.write_bytes(gzip.compress(content) if suffix.endswith("gz") else content)
    return target


def _write_obj(
    draw: Random, case: Case, path: Path, solids: Sequence[Faces], names: Sequence[str], keys: dict[str, Any]
) -> Path:
    y_up = draw.random() < 0.5
    if y_up and draw.random() < 0.5:
        keys["up"] = "y"
    case.made["up"] = f"{'y' if y_up else 'z'}, key {keys.get('up', 'none')}"
    if y_up and "up" not in keys:
        case.sound = False  # boxes, whose faces show no axis
    group = draw.choice(("g", "o"))
    lines = ["# made"] if draw.random() < 0.5 else []
    count = 0
    for name, faces in zip(names, solids, strict=True):
        lines.append(f"{group} {name}")
        for face in faces:
            xyz = face[:, [0, 2, 1]] * (1, 1, -1) if y_up else face
            lines += [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in xyz.tolist()]
            lines.append("f " + " ".join(str(count + 1 + k) for k in range(len(face))))
            count += len(face)
    path.write_text("\n".join(lines) + "\n", draw.choice(("utf-8", "utf-8", "utf-8-sig")))
    return path


def _write_ply(draw: Random, case: Case, path: Path, solids: Sequence[Faces], keys: dict[str, Any]) -> Path:
    import trimesh

    y_up = draw.random() < 0.3
    if y_up:
        keys["up"] = "y"
    corners = np.concatenate([_mesh(faces) for faces in solids]).reshape(-1, 3)
    corners = corners[:, [0, 2, 1]] * (1, 1, -1) if y_up else corners
    mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
    mesh.export(path, encoding=draw.choice(("binary", "ascii")))
    case.forget(id=None)
    case.made["up"] = f"{'y' if y_up else 'z'}, key {keys.get('up', 'none')}"
    if y_up and "up" not in keys:
        case.sound = False  # boxes, whose faces show no axis
    return path


def _write_npz(case: Case, path: Path, solids: Sequence[Faces], crs: str | None) -> Path:
    meshes = [_mesh(faces) for faces in solids]
    origin = np.floor(meshes[0].min(axis=(0, 1)))
    numbers = [7 + 2 * number for number in range(len(meshes))]
    case.houses = [replace(house, id=str(number)) for house, number in zip(case.houses, numbers, strict=True)]
    arrays: dict[str, Any] = {
        "triangles": (np.concatenate(meshes) - origin).astype(np.float32),
        "feature": np.repeat(numbers, [len(mesh) for mesh in meshes]),
        "origin": origin,
    }
    if crs:
        arrays["epsg"] = int(crs.split(":")[1])
    np.savez_compressed(path, **arrays)
    return path


def _write_gltf(draw: Random, case: Case, path: Path, solids: Sequence[Faces], names: Sequence[str]) -> Path:
    """Write a node a building; its walls show a quarter of a picture, stated in one of the ways of glTF."""
    stated = draw.choice(("float", "ushort", "ubyte", "set 1", "transform", "none"))
    case.made["uv"] = stated
    kind, dtype, scale = {"ushort": (5123, "<u2", 65535), "ubyte": (5121, "u1", 255)}.get(stated, (5126, "<f4", 1))
    quarter = np.array([[0.5, 0.5], [1.0, 0.5], [1.0, 1.0]])  # v down
    case.uv = None if stated == "none" else (0.5, 1.0, 0.0, 0.5)
    written = quarter if stated != "transform" else (quarter - 0.5) * 2
    buffer, views, accessors, meshes, nodes = b"", [], [], [], []

    def accessor(values: Any, component: int, type: str, stride: int | None = None, normalised: bool = False) -> int:
        nonlocal buffer
        content = values.tobytes()
        views.append(
            {"buffer": 0, "byteOffset": len(buffer), "byteLength": len(content)}
            | ({"byteStride": stride} if stride else {})
        )
        buffer += content + b"\0" * (-len(content) % 4)
        count = len(values)
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": component,
                "count": count,
                "type": type,
                "normalized": normalised,
            }
        )
        return len(accessors) - 1

    for name, faces in zip(names, solids, strict=True):
        mesh = _mesh(faces)
        anchor = mesh.reshape(-1, 3).min(axis=0)
        y_up = (mesh.reshape(-1, 3) - anchor)[:, [0, 2, 1]] * (1, 1, -1)
        position = accessor(y_up.astype("<f4"), 5126, "VEC3")
        attributes: dict[str, int] = {"POSITION": position}
        if stated != "none":
            uv = np.tile(written, (len(mesh), 1)) * scale
            uv = np.round(uv).astype(dtype) if scale > 1 else uv.astype(dtype)
            padded = uv if uv.itemsize > 1 else np.column_stack([uv, np.zeros_like(uv)])
            other = np.zeros((len(uv), 2), "<f4")
            if stated == "set 1":
                attributes["TEXCOORD_0"] = accessor(other, 5126, "VEC2")
            attributes["TEXCOORD_1" if stated == "set 1" else "TEXCOORD_0"] = accessor(
                padded, kind, "VEC2", 4 if uv.itemsize == 1 else None, scale > 1
            )
        meshes.append({"primitives": [{"attributes": attributes, "material": 0}]})
        moved = (anchor[[0, 2, 1]] * (1, 1, -1)).tolist()
        nodes.append({"name": name, "mesh": len(meshes) - 1, "translation": moved})
    texture: dict[str, Any] = {"index": 0}
    if stated == "set 1":
        texture["texCoord"] = 1
    if stated == "transform":
        texture["extensions"] = {"KHR_texture_transform": {"offset": [0.5, 0.5], "scale": [0.5, 0.5]}}
    picture = path.with_name("atlas.png")
    Image.new("RGB", (64, 64), (200, 60, 50)).save(picture)
    material = {} if stated == "none" else {"pbrMetallicRoughness": {"baseColorTexture": texture}}
    if path.suffix == ".glb" and stated != "none":
        content = picture.read_bytes()
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": len(content)})
        buffer += content + b"\0" * (-len(content) % 4)
        image: dict[str, Any] = {"bufferView": len(views) - 1, "mimeType": "image/png"}
    else:
        image = {"uri": "atlas.png"}
    head: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [material],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(buffer)}],
    }
    if stated != "none":
        head |= {"textures": [{"source": 0}], "images": [image]}
    if stated == "transform":
        head |= {"extensionsUsed": ["KHR_texture_transform"], "extensionsRequired": ["KHR_texture_transform"]}
    if draw.random() < 0.1:
        head["extensionsRequired"] = [*head.get("extensionsRequired", ()), "KHR_draco_mesh_compression"]
        case.break_with("unknown required extension")
    if path.suffix == ".gltf":
        path.with_suffix(".bin").write_bytes(buffer)
        head["buffers"][0]["uri"] = path.with_suffix(".bin").name.replace("#", "%23")
        path.write_text(json.dumps(head, ensure_ascii=False), "utf-8")
        return path
    text = json.dumps(head).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
