"""Sound small files that are neither buildings, streets, pictures nor rasters, and how each is read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import geopandas as gpd
import yaml
from shapely.geometry import box

from catalogs.block.corrections import Correction, append_corrections_to_file, read_corrections
from catalogs.block.extract import read_city_part, write_city_part_file
from catalogs.block.reader import city_part_file_values, read_block
from catalogs.city.tile_index import tile_files_in_area
from catalogs.imagery.fetch_log import FetchedPicture, FetchLog, read_fetch_log
from catalogs.readers.annotations import read_correction_annotations
from catalogs.readers.formats import read_ground_features
from catalogs.readers.layouts import read_partial_layout
from catalogs.readers.pictures.cameras.cameras import read_cameras
from facade_core.core.json_model import read_json_model
from facade_core.core.model_file import open_inference_session, read_model_record
from tasks.city.blocks import read_city_keys
from tasks.matching.match_table import read_match_table
from tests.catalogs.readers.pictures.camera_files import (
    BOUNDS,
    LOCAL,
    SAME,
    UTM,
    in_frame,
    ring,
    write_colmap,
    write_metashape,
    write_opensfm,
    write_pictures,
)
from tests.pipeline.stages import write_block
from training.model_files import write_json_model, write_model

POSES = ring(3)


class SmallFile(NamedTuple):
    """How a file is written and read."""

    write: Callable[[Path], object]
    read: Callable[[Path], object]


def text(content: object) -> Callable[[Path], object]:
    """Return a function that writes a text, or an object as JSON."""
    found = content if isinstance(content, str) else json.dumps(content)
    return lambda path: path.write_text(found)


def corrections(path: Path) -> None:
    boxes = [("window", 0.1, 0.2, 0.3, 0.4), ("door", 0.4, 0.7, 0.5, 1.0)]
    facade = Correction("a-0", "elements", boxes, (24.94, 60.16), 12.5, "anna", "2026-01-02T03:04:05Z", "seen")
    append_corrections_to_file(path.with_name("block.yaml"), [facade, Correction("a", "height", 12.5)])


def write_fetch_log(path: Path) -> None:
    log = FetchLog(path.parent, {})
    for name in ("a", "ä b"):
        log.append(FetchedPicture("stac", name, f"{name}.jpg", "0" * 64, 5, 24.94, 60.16, 12.0, z=3.0, author="A"))


def part(path: Path) -> None:
    folder = path.parents[1] / "block-of-part"
    block = read_block(write_block(folder))
    write_city_part_file(path, city_part_file_values(block, block))


def cameras(write: Callable[[Path], object]) -> SmallFile:
    def write_all(path: Path) -> None:
        write_pictures(path.parents[1] / "pictures", list(POSES))
        write(path)

    return SmallFile(write_all, lambda path: read_cameras(path.parents[1] / "pictures", path, UTM, BOUNDS))


def camera_table(path: Path) -> None:
    rows = [f"{name},{p.x},{p.y},{p.z},{p.heading},{p.pitch},{p.roll},141" for name, p in POSES.items()]
    path.write_text("\n".join(["file,x,y,z,heading,pitch,roll,focal_px", *rows]))


def control_points(path: Path) -> None:
    write_pictures(path.parents[1] / "pictures", list(POSES))
    write_colmap(path.parents[1] / "local", POSES, LOCAL)
    rows = [
        ",".join(map(str, (name, *in_frame(pose, LOCAL)[1], pose.x, pose.y, pose.z))) for name, pose in POSES.items()
    ]
    path.write_text("\n".join(["name,model_x,model_y,model_z,x,y,z", *rows]))


def read_control(path: Path) -> object:
    return read_cameras(path.parents[1] / "pictures", path.parents[1] / "local", UTM, BOUNDS, path)


def read_annotations(path: Path) -> object:
    return read_correction_annotations(path, {"a-0.png": "a-0"})


def tables(path: Path) -> None:
    frame = gpd.GeoDataFrame({"id": ["a", "b"], "height_m": [9.0, 12.5]}, geometry=[box(0, 0, 1, 1)] * 2, crs=UTM)
    frame.to_file(path, layer="buildings", engine="pyogrio")


def tile_index(path: Path) -> None:
    (path.parents[1] / "tile.gpkg").touch()
    frame = gpd.GeoDataFrame({"location": ["../tile.gpkg"]}, geometry=[box(24.9, 60.1, 25.0, 60.2)], crs=4326)
    frame.to_parquet(path) if path.suffix == ".parquet" else frame.to_file(path, engine="pyogrio")


def ground(path: Path) -> None:
    frame = gpd.GeoDataFrame({"landuse": ["grass", "park"]}, geometry=[box(24.9, 60.1, 25.0, 60.2)] * 2, crs=4326)
    frame.to_file(path, engine="pyogrio")


def city(path: Path) -> None:
    keys = yaml.safe_load(write_block(path.parents[1] / "block-of-city").read_text())
    path.write_text(yaml.safe_dump(keys | {"name": "town", "cut": {"metres": 70}}))


def network(path: Path) -> None:
    import onnx
    from onnx import TensorProto, helper

    values = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1]) for name in "xy"]
    graph = helper.make_graph([helper.make_node("Abs", ["x"], ["y"])], "g", values[:1], values[1:])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.checker.check_model(model)
    write_model(model.SerializeToString(), path, {})


MATCHES = (
    "photo,facade,probability,candidates,why,x,y,heading,by\n"
    "1.jpg,a-0,0.95,a-0 0.95; a-1 0.05,near; far,385100.00,6671700.00,12.0,\n"
    "'=2.jpg,,0.40,b-0 0.40,far,385101.00,6671701.00,,anna\n"
)
COCO = {
    "images": [{"id": 1, "file_name": "a-0.png", "width": 100, "height": 50}],
    "categories": [{"id": 1, "name": "window"}],
    "annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [10, 5, 20, 10]}],
}
LABELME = {
    "imagePath": "a-0.png",
    "imageWidth": 100,
    "imageHeight": 50,
    "shapes": [{"label": "door", "points": [[10, 5], [20, 50]], "shape_type": "rectangle"}],
}
OWN = {"corrections": [{"facade_id": "a-0", "elements": [["door", 0.4, 0.7, 0.5, 1.0]], "hide": [[0, 0, 0.1, 0.1]]}]}
CITYJSON = {
    "type": "CityJSON",
    "version": "2.0",
    "CityObjects": {"a": {"type": "Building", "attributes": {"eavesHeight": 9.5, "measuredHeight": 12.0}}},
}
LAYOUT = {
    "width": 10.0,
    "height": 8.0,
    "objects": [{"label": "window", "x0": 1, "y0": 1, "x1": 2, "y1": 3}],
    "visible": [{"x0": 0, "y0": 0, "x1": 5, "y1": 8}],
}
STAC = {
    "type": "Feature", "stac_version": "1.0.0", "id": "tile", "bbox": [24.9, 60.1, 25.0, 60.2], "links": [],
    "geometry": {"type": "Point", "coordinates": [24.95, 60.15]}, "properties": {"datetime": "2026-01-01T00:00:00Z"},
    "assets": {"data": {"href": "./tile.json", "roles": ["data"]}},
}  # fmt: skip

SMALL_FILES: Mapping[str, SmallFile] = {
    "block.corrections.jsonl": SmallFile(corrections, lambda path: read_corrections(path.with_name("block.yaml"))),
    "matches.csv": SmallFile(text(MATCHES), lambda path: read_match_table(path).matches()),
    "fetched.jsonl": SmallFile(write_fetch_log, lambda path: read_fetch_log(path.parent)),
    "part.npz": SmallFile(part, read_city_part),
    "images.txt": cameras(lambda path: write_colmap(path.parent, POSES, SAME, binary=False)),
    "images.bin": cameras(lambda path: write_colmap(path.parent, POSES, SAME, binary=True)),
    "reconstruction.json": cameras(lambda path: write_opensfm(path, POSES)),
    "cameras.xml": cameras(lambda path: write_metashape(path, POSES)),
    "cameras.csv": cameras(camera_table),
    "control.csv": SmallFile(control_points, read_control),
    "coco.json": SmallFile(text(COCO), read_annotations),
    "labelme.json": SmallFile(text(LABELME), read_annotations),
    "own.json": SmallFile(text(OWN), read_annotations),
    "model.city.json": SmallFile(text(CITYJSON), read_annotations),
    "model.city.jsonl": SmallFile(text(f"{json.dumps(CITYJSON)}\n{json.dumps(CITYJSON)}\n"), read_annotations),
    "corrections.gpkg": SmallFile(tables, read_annotations),
    "layout.json": SmallFile(text(LAYOUT), read_partial_layout),
    "tile.json": SmallFile(text(STAC), lambda path: tile_files_in_area(path, None)),
    "tiles.gpkg": SmallFile(tile_index, lambda path: tile_files_in_area(path, None)),
    "tiles.parquet": SmallFile(tile_index, lambda path: tile_files_in_area(path, None)),
    "ground.geojson": SmallFile(ground, read_ground_features),
    "ground.gpkg": SmallFile(ground, read_ground_features),
    "town.yaml": SmallFile(city, read_city_keys),
    "model.json": SmallFile(
        lambda path: write_json_model(path, {"a": [1, 2]}, {"version": 1}),
        lambda path: read_json_model(path, "layout model", {"version": 1}, "train it anew"),
    ),
    "network.onnx": SmallFile(network, lambda path: open_inference_session(path, read_model_record(path), threads=1)),
}
