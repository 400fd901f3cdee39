"""Models that name files outside their own folder: pictures, materials and buffers are not looked at there."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from catalogs.features import BuildingModels
from catalogs.readers.formats import read_buildings
from catalogs.readers.referenced_files import OUTSIDE_FOLDER_REASON
from facade_core.core.errors import InputError

WALL = np.array([(0, 0, 0), (9, 0, 0), (9, 0, 6), (0, 0, 6)], np.float32)


def obj(folder: Path, uri: str) -> Path:
    (folder / "a.mtl").write_text(f"newmtl brick\nmap_Kd {uri}\n")
    lines = ["mtllib a.mtl", *(f"v {x} {y} {z}" for x, y, z in WALL), "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    (folder / "a.obj").write_text("\n".join([*lines, "g one", "usemtl brick", "f 1/1 2/2 3/3 4/4", ""]))
    return folder / "a.obj"


def gltf(folder: Path, uri: str, buffer: str = "a.bin") -> Path:
    indices, uv = np.array([0, 1, 2, 0, 2, 3], np.uint32), WALL[:, [0, 2]] / 9
    wall = WALL[:, [0, 2, 1]]  # y is up in glTF
    (folder / "a.bin").write_bytes(wall.tobytes() + uv.tobytes() + indices.tobytes())
    views = [(0, WALL.nbytes), (WALL.nbytes, uv.nbytes), (WALL.nbytes + uv.nbytes, indices.nbytes)]
    kinds = [("VEC3", 5126, 4), ("VEC2", 5126, 4), ("SCALAR", 5125, 6)]
    header = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "one", "mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": uri}],
        "accessors": [
            {"bufferView": i, "componentType": kind, "count": n, "type": shape, "min": [0, 0, 0], "max": [9, 9, 9]}
            for i, (shape, kind, n) in enumerate(kinds)
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in views],
        "buffers": [{"uri": buffer, "byteLength": sum(views[-1])}],
    }
    (folder / "a.gltf").write_text(json.dumps(header))
    return folder / "a.gltf"


def cityjson(folder: Path, uri: str) -> Path:
    city = {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [1, 1, 1], "translate": [0, 0, 0]},
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/25832"},
        "appearance": {
            "textures": [{"type": "PNG", "image": uri}],
            "vertices-texture": [[0, 0], [1, 0], [1, 1], [0, 1]],
            "default-theme-texture": "t",
        },
        "CityObjects": {
            "one": {
                "type": "Building",
                "geometry": [
                    {
                        "type": "MultiSurface",
                        "lod": "2",
                        "boundaries": [[[0, 1, 2, 3]]],
                        "texture": {"t": {"values": [[[0, 0, 1, 2, 3]]]}},
                    }
                ],
            }
        },
        "vertices": WALL.astype(int).tolist(),
    }
    (folder / "a.city.json").write_text(json.dumps(city))
    return folder / "a.city.json"


def citygml(folder: Path, uri: str) -> Path:
    ring = " ".join(str(v) for corner in [*WALL, WALL[0]] for v in corner)
    (folder / "a.gml").write_text(
        f"""<CityModel xmlns="http://www.opengis.net/citygml/2.0" xmlns:gml="http://www.opengis.net/gml"
 xmlns:bldg="http://www.opengis.net/citygml/building/2.0" xmlns:app="http://www.opengis.net/citygml/appearance/2.0">
<gml:boundedBy><gml:Envelope srsName="EPSG:25832" srsDimension="3"/></gml:boundedBy>
<cityObjectMember><bldg:Building gml:id="one"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>
<gml:Polygon gml:id="p"><gml:exterior><gml:LinearRing gml:id="r"><gml:posList>{ring}</gml:posList></gml:LinearRing>
</gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></cityObjectMember>
<app:appearanceMember><app:Appearance><app:theme>rgbTexture</app:theme><app:surfaceDataMember><app:ParameterizedTexture>
<app:imageURI>{uri}</app:imageURI><app:target uri="#p"><app:TexCoordList>
<app:textureCoordinates ring="#r">0 0 1 0 1 1 0 1 0 0</app:textureCoordinates></app:TexCoordList></app:target>
</app:ParameterizedTexture></app:surfaceDataMember></app:Appearance></app:appearanceMember></CityModel>"""
    )
    return folder / "a.gml"


WRITERS = {"obj": obj, "gltf": gltf, "cityjson": cityjson, "citygml": citygml}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model's folder with pictures in it, below it and outside it, and links that lead there."""
    model = tmp_path / "model"
    (model / "textures").mkdir(parents=True)
    for place in (model / "in.png", model / "textures" / "in deep.png", tmp_path / "secret.png"):
        Image.new("RGB", (8, 8), "red").save(place)
    os.symlink(tmp_path / "secret.png", model / "link.png")
    os.symlink(tmp_path, model / "up")
    os.symlink("circle.png", model / "circle.png")
    return model


@pytest.mark.parametrize("write", WRITERS.values(), ids=WRITERS)
def test_pictures_stay_below_the_folder_of_their_model(write: Callable[[Path, str], Path], folder: Path) -> None:
    def read(uri: str) -> BuildingModels:
        found = read_buildings(write(folder, uri))
        assert isinstance(found, BuildingModels)
        assert [model.id for model in found.items] == ["one"]
        return found

    for uri in ("in.png", "textures/../in.png", "textures/in deep.png"):
        assert [path.resolve() for path in read(uri).textures] == [(folder / uri).resolve()], uri
    for uri in (
        "../secret.png",
        "textures/../../secret.png",
        str(folder.parent / "secret.png"),
        "link.png",
        "up/secret.png",
        "/etc/passwd",
    ):
        found = read(uri)
        assert found.textures == (), uri
        assert [remark.id for remark in found.remarks if remark.reason == OUTSIDE_FOLDER_REASON] == [uri]
    for uri in (
        "absent.png",
        "../absent.png",
        "circle.png",
        "x" * 5000 + ".png",
        "file:///etc/passwd",
        "http://127.0.0.1:9/x.png",
    ):
        found = read(uri)
        assert found.textures == ()
        assert found.remarks


def test_material_files_and_buffers_stay_there_too(folder: Path) -> None:
    (folder.parent / "out.mtl").write_text("newmtl brick\nmap_Kd in.png\n")
    path = obj(folder, "in.png")
    path.write_text(path.read_text().replace("mtllib a.mtl", "mtllib ../out.mtl"))
    found = read_buildings(path)
    assert isinstance(found, BuildingModels)
    assert found.textures == ()
    assert "outside the model's folder" in found.remarks[0].reason
    for buffer in ("../a.bin", "up/a.bin", str(folder.parent / "a.bin"), "absent.bin"):
        path = gltf(folder, "in.png", buffer)
        os.replace(folder / "a.bin", folder.parent / "a.bin")
        with pytest.raises(InputError, match=r"its buffer .* (outside its folder|not there); copy it beside the model"):
            read_buildings(path)


def test_no_picture_of_a_scan_is_opened(folder: Path) -> None:
    rows = "\n".join(f"{x} {y} {z}" for x, y, z in WALL)
    (folder / "a.ply").write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile ../secret.png\nelement vertex 4\nproperty float x\nproperty float y\n"
        f"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}\n4 0 1 2 3\n"
    )
    (folder.parent / "secret.png").unlink()
    os.mkfifo(folder.parent / "secret.png")  # opening it would wait for ever
    assert len(read_buildings(folder / "a.ply").items) == 1
