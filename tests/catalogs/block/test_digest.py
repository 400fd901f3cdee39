"""The digest of a block is of what was read: of every file that a named one leads to, and not of how it is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import geopandas
import numpy as np
import pytest
import rasterio
import rasterio.shutil
import shapely
import trimesh
import yaml
from PIL import Image

from catalogs.block.corrections import Correction, Corrections
from catalogs.block.declared_keys import Effect, declared_keys
from catalogs.block.digest import block_digest, plan_input_digest
from catalogs.block.key_faults import validate_block_settings
from catalogs.block.keys import BlockFileSettings
from catalogs.block.part import CityPart
from catalogs.block.reader import Block, read_block
from catalogs.readers.pictures.materials import MaterialPicture, RoofPicture
from facade_core.core.types import TrainedModelFiles

EAST, NORTH = 385_000.0, 6_671_000.0
Edit = Callable[[Path], Any]
KEYS = declared_keys(BlockFileSettings)


def write(folder: Path, **keys: Any) -> Path:
    block = {
        "name": "small",
        "crs": "EPSG:32635",
        "buildings": {"path": "houses.geojson", "crs": "EPSG:32635"},
        "texture": {"walls": "translate"},
        **keys,
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(block))
    return folder / "block.yaml"


def houses(folder: Path, suffix: str, heights: tuple[float, ...] = (7.0, 9.0)) -> None:
    boxes = [shapely.box(EAST + 20 * i, NORTH, EAST + 20 * i + 10, NORTH + 10) for i in range(len(heights))]
    columns = {"id": [str(i) for i in range(len(heights))], "height": heights}
    geopandas.GeoDataFrame(columns, geometry=boxes, crs="EPSG:32635").to_file(folder / f"houses{suffix}")


def text(name: str, old: str, new: str) -> Edit:
    def edit(folder: Path) -> None:
        content = (folder / name).read_text()
        assert old in content
        (folder / name).write_text(content.replace(old, new))

    return edit


def again(name: str, **options: Any) -> Edit:
    """Write a JSON file anew, its keys the other way round."""

    def turned(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: turned(value[key]) for key in reversed(value)}
        return [turned(one) for one in value] if isinstance(value, list) else value

    def edit(folder: Path) -> None:
        (folder / name).write_text(json.dumps(turned(json.loads((folder / name).read_text())), **options))

    return edit


def renamed(old: str, new: str) -> Edit:
    def edit(folder: Path) -> None:
        for path in list(folder.glob(f"{old}.*")):
            path.rename(path.with_name(path.name.replace(old, new, 1)))
        text("block.yaml", f"{old}.", f"{new}.")(folder)

    return edit


def shapefile(folder: Path) -> Path:
    houses(folder, ".shp")
    return write(folder, buildings={"path": "houses.shp"})


def geojson(folder: Path) -> Path:
    houses(folder, ".geojson", (7.0, 0.1))
    return write(folder)


def gltf(folder: Path) -> Path:
    scene = trimesh.Scene()
    for i in range(2):
        mesh = trimesh.creation.box((10, 6, 8))
        mesh.apply_translation([20 * i, 3, 0])
        scene.add_geometry(mesh, node_name=f"house {i}", geom_name=f"house {i}")
    files = trimesh.exchange.gltf.export_gltf(scene, merge_buffers=True)
    for name, content in files.items():
        (folder / name.replace("model.gltf", "houses.gltf")).write_bytes(content)
    return write(folder, buildings={"path": "houses.gltf", "crs": "EPSG:32635", "offset": [EAST, NORTH, 0.0]})


def raised(folder: Path) -> None:
    path = next(folder.glob("*.bin"))
    data = np.frombuffer(path.read_bytes(), np.float32).copy()
    data[data == 6.0] = 7.0
    path.write_bytes(data.tobytes())


def obj(folder: Path) -> Path:
    points = "".join(f"v {x} {y} {z}\n" for z in (0, 6) for x, y in ((0, 0), (10, 0), (10, 8), (0, 8)))
    faces = "".join(f"f {' '.join(f'{i}/1' for i in face)}\n" for face in ("1265", "2376", "3487", "4158", "5678"))
    (folder / "houses.obj").write_text(f"mtllib walls.mtl\n{points}vt 0 0\no a\nusemtl brick\n{faces}f 4 3 2 1\n")
    (folder / "walls.mtl").write_text("newmtl brick\nmap_Kd one.png\n")
    for name, colour in (("one", 10), ("two", 20)):
        Image.new("RGB", (8, 8), (colour, 0, 0)).save(folder / f"{name}.png")
    return write(folder, buildings={"path": "houses.obj", "crs": "EPSG:32635", "offset": [EAST, NORTH, 0.0]})


def _ground(folder: Path, height: float) -> None:
    place = rasterio.Affine(2, 0, EAST - 300, 0, -2, NORTH + 300)
    options = {"count": 1, "width": 300, "height": 300, "dtype": "float32", "crs": "EPSG:32635", "transform": place}
    with rasterio.open(folder / "ground.tif", "w", driver="GTiff", **options) as raster:
        raster.write(np.full((1, 300, 300), height, np.float32))


def terrain(folder: Path) -> Path:
    houses(folder, ".geojson")
    _ground(folder, 5.0)
    rasterio.shutil.copy(folder / "ground.tif", folder / "ground.vrt", driver="VRT")
    return write(folder, terrain={"path": "ground.vrt"})


def above(folder: Path) -> Path:
    houses(folder, ".geojson")
    Image.new("RGB", (200, 200), (9, 9, 9)).save(folder / "above.png")
    (folder / "above.pgw").write_text(f"0.5\n0\n0\n-0.5\n{EAST - 20}\n{NORTH + 60}\n")
    return write(folder, imagery={"aerial": {"path": "above.png", "crs": "EPSG:32635"}})


def panoramas(folder: Path) -> Path:
    houses(folder, ".geojson")
    (folder / "panoramas").mkdir()
    Image.new("RGB", (64, 32)).save(folder / "panoramas" / "p.jpg")
    pose = {"p.jpg": {"x": EAST - 5, "y": NORTH - 5, "z": 2.5, "heading": 10.0}}
    (folder / "poses.json").write_text(json.dumps({"crs": "EPSG:32635", "poses": pose}, indent=1))
    return write(folder, imagery={"panoramas": {"path": "panoramas", "poses": "poses.json"}})


CASES: dict[str, tuple[Callable[[Path], Path], Edit, bool]] = {
    ".dbf beside .shp": (shapefile, lambda folder: houses(folder, ".shp", (7.0, 9.5)), True),
    ".prj beside .shp": (shapefile, text("houses.prj", "27.0", "21.0"), True),
    "shapefile renamed": (shapefile, renamed("houses", "built"), False),
    "a corner": (geojson, text("houses.geojson", "385030.0", "385031.0"), True),
    "a height": (geojson, text("houses.geojson", '"height": 7.0', '"height": 7.5'), True),
    "numbers written otherwise": (geojson, text("houses.geojson", '"height": 7.0', '"height": 7'), False),
    "order of keys and indent": (geojson, again("houses.geojson", indent=3), False),
    "GeoJSON renamed": (geojson, renamed("houses", "built"), False),
    ".bin beside .gltf": (gltf, raised, True),
    "glTF written otherwise": (gltf, again("houses.gltf", indent=2), False),
    ".mtl names another picture": (obj, text("walls.mtl", "one.png", "two.png"), True),
    "a remark in .mtl": (obj, text("walls.mtl", "newmtl", "# brick\nnewmtl"), False),
    "a picture that .mtl names": (obj, lambda f: Image.new("RGB", (8, 8)).save(f / "one.png"), True),
    "a source of a VRT": (terrain, lambda folder: _ground(folder, 6.0), True),
    "a remark in a VRT": (terrain, text("ground.vrt", "<VRTRasterBand", "<!-- one -->\n<VRTRasterBand"), False),
    "a world file": (above, text("above.pgw", "0.5\n0\n0", "0.25\n0\n0"), True),
    "blanks in a world file": (above, text("above.pgw", "0.5\n0\n0", "0.50 \n0.0\n0"), False),
    "an orthophoto renamed": (above, renamed("above", "ortho"), False),
    "a pose": (panoramas, text("poses.json", "10.0", "11.0"), True),
    "poses written otherwise": (panoramas, again("poses.json"), False),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_read_counts(case: str, tmp_path: Path) -> None:
    make, edit, differs = CASES[case]
    block_file = make(tmp_path)
    before = read_block(block_file)
    assert not before.faults
    assert read_block(block_file).digest == before.digest
    edit(tmp_path)
    assert (read_block(block_file).digest != before.digest) == differs


def test_every_value_of_a_block_counts(tmp_path: Path) -> None:
    block = read_block(terrain(tmp_path))
    assert block.terrain is not None
    picture = tmp_path / "a.png"
    Image.new("RGB", (8, 8)).save(picture)
    changes: dict[str, Any] = {
        "crs": block.crs.geodetic_crs,
        "buildings": block.buildings[:1],
        "streets": (*block.streets, *block.streets, "one"),
        "shops": ((1.0, 2.0),),
        "entrances": ((1.0, 2.0),),
        "ground": replace(block.ground, ways=(*block.ground.ways, "one")),
        "terrain": replace(block.terrain, heights=block.terrain.heights + 1),
        "exemplars": (picture,),
        "style": (picture,),
        "photos": {"a-0": picture},
        "panoramas": read_block(panoramas(tmp_path)).panoramas,
        "textures": (picture,),
        "aerial": read_block(above(tmp_path)).aerial,
        "roof_material": RoofPicture(picture, 0.01),
        "materials": (MaterialPicture("slabs", picture, 0.8),),
        "geoid_separation": 17.0,
        "faults": (*block.faults, "one"),
        "corrections": Corrections({"a-0": {"facade": Correction("a-0", "facade", False)}}),
        "models": TrainedModelFiles(layout=picture),
        "part": CityPart(("a",), (), (), ("street",), (-1,)),
        "neighbours": block.buildings[:1],
    }
    assert changes.keys() | {"digest", "notes", "settings"} == {field.name for field in fields(Block)}
    digests = {block_digest(replace(block, **{name: value})) for name, value in changes.items()}
    assert len(digests | {block.digest}) == len(changes) + 1
    assert block_digest(replace(block, digest="", notes=(*block.notes, "one"))) == block.digest


# Another value of every setting.
OTHER_SETTINGS: dict[str, Any] = {
    "name": "other",
    "texture.texels_per_metre": 20.0,
    "texture.viewpoint_spacing": 4.0,
    "texture.viewpoint_height": 3.0,
    "texture.visibility_range": 50.0,
    "texture.walls": "exemplar",
    "texture.panorama_width": 512,
    "texture.levelling": False,
    "texture.relief": "off",
    "texture.roof_material": {"path": "a.png", "metres_per_pixel": 0.02},
    "texture.light": False,
    "texture.sun": {"azimuth": 200.0, "elevation": 30.0},
    "imagery.photos": {"path": "photos", "rectified": False},
    "imagery.privacy": "mask",
    "props": "off",
    "storey": 3.5,
    "failed_limit": 0.5,
    "seed": 1,
}


def test_every_setting_counts_by_its_effect(tmp_path: Path) -> None:
    """Only settings that change a result change the digest, and only those of the plan change that of its inputs."""
    block = read_block(geojson(tmp_path))
    stated = {"name": "small", "buildings": {"path": "houses.geojson"}, "texture": {"walls": "translate"}}
    whole, plan = {block.digest}, {plan_input_digest(block)}
    for key, value in OTHER_SETTINGS.items():
        section, _, leaf = key.rpartition(".")
        changed = stated | ({section: stated.get(section, {}) | {leaf: value}} if section else {leaf: value})
        other = replace(block, settings=validate_block_settings(changed))
        [effect] = {one.key.effect for name, one in KEYS.items() if f"{name}.".startswith(f"{key}.") if one.key.effect}
        assert (block_digest(other) not in whole) == (effect is not Effect.NOTHING), key
        assert (plan_input_digest(other) not in plan) == (effect is Effect.PLAN), key
        whole.add(block_digest(other))
        plan.add(plan_input_digest(other))
    settings = {name for name, one in KEYS.items() if one.key.effect is not None}
    assert {name for name in settings if not any(f"{name}.".startswith(f"{key}.") for key in OTHER_SETTINGS)} == set()


def test_where_a_value_is_read_from_does_not_count(tmp_path: Path) -> None:
    block = read_block(geojson(tmp_path))
    stated = {
        "name": "small",
        "texture": {"walls": "translate"},
        "buildings": {"path": "b", "crs": "EPSG:3879", "lod": "2"},
    }
    assert block_digest(replace(block, settings=validate_block_settings(stated))) == block.digest
