"""Panoramas with their poses, and photos of facades, in conventions of cameras and programs."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import shapely
from PIL import Image

from benchmarks.generated_inputs.truth import CAMERA_HEIGHT_M, FOOT_M, Case, project

_HEADINGS = ("heading", "yaw", "azimuth", "compass_angle", "Heading")
_ANGLES = {"": 1.0, "_deg": 1.0, "[deg]": 1.0, " (rad)": math.pi / 180, "_rad": math.pi / 180}

_BREAKS = (
    "no heading",
    "nan",
    "twice",
    "unknown name",
    "radians unnamed",
    "swapped",
    "lens",
    "cut picture",
    "flat",
)


def write_panoramas(draw: Random, case: Case, folder: Path) -> dict[str, Any]:
    """Write three panoramas and their poses; return the keys of `imagery.panoramas`."""
    pictures = folder / draw.choice(("panos", "panos;1", "Panos ü!"))
    pictures.mkdir()
    for camera in case.cameras:
        _picture(draw, (256, 128)).save(pictures / f"{camera.stem}.{draw.choice(('jpg', 'png', 'JPG'))}")
    frame = draw.choice(("EPSG:4326", case.place.frame, case.place.frame))
    crs_stated = draw.random() < 0.6 or frame == "EPSG:4326"
    datum = draw.choice(("none", "sea", "ellipsoid", "ground", "sea-feet"))
    level = {"none": None, "ground": 0.0, "ellipsoid": case.ground + case.place.geoid}.get(datum, case.ground)
    z = None if level is None else level + CAMERA_HEIGHT_M
    z_name, z_unit = ("z_ft", FOOT_M) if datum == "sea-feet" else (draw.choice(("z", "z_m")), 1.0)
    heading_name, unit = draw.choice(_HEADINGS), draw.choice(list(_ANGLES))
    names = ("lon", "lat") if frame == "EPSG:4326" else ("x", "y")
    if frame != "EPSG:4326":
        names = draw.choice((names, ("easting", "northing"), ("X", "Y")))
    records: list[dict[str, Any]] = []
    for camera in case.cameras:
        place = project(shapely.Point(camera.x, camera.y), case.place.frame, frame)
        heading = camera.heading
        if frame == "EPSG:4326":  # from true north
            ahead = shapely.Point(
                camera.x + math.sin(math.radians(heading)), camera.y + math.cos(math.radians(heading))
            )
            there = project(ahead, case.place.frame, frame)
            east = (there.x - place.x) * math.cos(math.radians(place.y))
            heading = math.degrees(math.atan2(east, there.y - place.y)) % 360.0
        record = {names[0]: place.x, names[1]: place.y, f"{heading_name}{unit}": heading * _ANGLES[unit]}
        if z is not None:
            record[z_name] = z / z_unit
        records.append({"file": f"{camera.stem}"} | record)
    case.cameras = [replace(camera, z=None if z is None else z) for camera in case.cameras]
    broken = draw.choice((None, None, None, *_BREAKS))
    kind = draw.choice(("csv", "csv", "json", "csv-semicolon", "csv-tab"))
    case.made |= {"poses": f"{kind}, {frame}, {datum}, {heading_name}{unit}", "broken poses": broken}
    if broken:
        case.sound = False
        _break_poses(draw, case, broken, records, pictures, names, f"{heading_name}{unit}")
    path = folder / f"poses.{'json' if kind == 'json' else 'csv'}"
    if kind == "json":
        content: dict[str, Any] = {
            "poses": {one["file"]: {k: v for k, v in one.items() if k != "file"} for one in records}
        }
        if crs_stated:
            content["crs"] = frame
        path.write_text(json.dumps(content), "utf-8")
    else:
        text = io.StringIO()
        separator = {"csv": ",", "csv-semicolon": ";", "csv-tab": "\t"}[kind]
        writer = csv.DictWriter(text, list(records[0]), delimiter=separator)
        writer.writeheader()
        writer.writerows(records)
        path.write_text(text.getvalue(), draw.choice(("utf-8", "utf-8", "utf-8-sig")))
    return {"path": pictures.name, "poses": path.name}


def _break_poses(
    draw: Random,
    case: Case,
    what: str,
    records: list[dict[str, Any]],
    pictures: Path,
    names: tuple[str, str],
    heading: str,
) -> None:
    number = draw.randrange(len(records))
    record = records[number]
    if what == "no heading":
        for one in records:
            del one[heading]
    elif what == "nan":
        record[draw.choice(names)] = "nan"
    elif what == "twice":
        records.append(dict(record))
    elif what == "unknown name":
        record["file"] = "other"
    elif what == "radians unnamed":
        for one in records:
            del one[heading]
            one["yaw"] = round(math.radians(case.cameras[records.index(one)].heading), 6)
    elif what == "swapped":
        for one in records:
            one[names[0]], one[names[1]] = one[names[1]], one[names[0]]
    elif what == "lens":
        _picture(draw, (300, 200)).save(next(pictures.glob(f"{case.cameras[number].stem}.*")))
    elif what == "cut picture":
        path = next(pictures.glob(f"{case.cameras[number].stem}.*"))
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    elif what == "flat":
        for one in records:
            one[names[0]] = 0.0


def write_photos(draw: Random, case: Case, folder: Path) -> dict[str, Any]:
    """Write two photos, one perhaps broken; return the keys of `imagery.photos`."""
    pictures = folder / "photos"
    pictures.mkdir()
    for number in range(2):
        stem = f"{case.houses[number].id or number}-{number}".replace("/", "_")
        path = pictures / f"{stem}.{draw.choice(('jpg', 'png', 'bmp', 'jpe', 'webp', 'tif'))}"
        picture = _picture(draw, (60, 90))
        format = {".jpg": "JPEG", ".jpe": "JPEG", ".tif": "TIFF"}.get(path.suffix, path.suffix[1:].upper())
        what = draw.choice((None, None, None, "other format", "cut", "empty", "text", "svg", "tiny"))
        picture.resize((8, 8) if what == "tiny" else picture.size).save(
            path, "PNG" if what == "other format" else format
        )
        case.photos.append(path.stem)
        if what in (None, "other format"):
            continue
        case.break_with(f"photo: {what}")
        if what == "cut":
            path.write_bytes(path.read_bytes()[:40])
        elif what == "empty":
            path.write_bytes(b"")
        elif what == "text":
            path.write_text("not a picture")
        elif what == "svg":
            path.rename(path.with_suffix(".svg"))
    return {"path": pictures.name, "rectified": draw.choice((True, False))}


def _picture(draw: Random, size: tuple[int, int]) -> Image.Image:
    random = np.random.default_rng(draw.randrange(2**32))
    coarse = random.integers(0, 255, (8, 8, 3), dtype=np.uint8)
    return Image.fromarray(coarse).resize(size)
