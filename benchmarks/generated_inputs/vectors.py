"""Vector files of outlines and streets: height columns, frames, code pages and faults."""

from __future__ import annotations

import json
import math
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pandas as pd
import shapely
from geopandas import GeoDataFrame
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from benchmarks.generated_inputs.osm_pbf import write_pbf
from benchmarks.generated_inputs.truth import FOOT_M, Case, House, project

FORMATS = ("geojson", "gpkg", "shp", "parquet", "fgb")
STEMS = ("houses", "Häuser!", "a b;c", "x#1", "k=v", "дома", "buildings")
_HEIGHT_KINDS = (
    "metres metres metres text-m text-comma text-ft text-quote feet-column cm-column levels levels levels-text "
    "unknown-column unknown-column none absolute new-york feet-hint feet-plain"
)
HEIGHTS = tuple(_HEIGHT_KINDS.split())
_METRE_TEXT = "height HEIGHT Building_Height measuredHeight hoehe hauteur h_mean bldg_hgt H height_m"
_METRE_NAMES = tuple(_METRE_TEXT.split())
_FEET_NAMES = ("height_ft", "Height_Feet", "bldg_height_ft")
_ID_TEXT = "id gml_id uuid osm_id objectid egid bin identificatie"
_ID_NAMES = tuple(_ID_TEXT.split())
_BREAK_KINDS = (
    "null-cell nan-column words negative huge duplicate-ids bowtie hole multi empty null far-corner origin "
    "repeated-row spike open-point collection"
)
_BREAKS = tuple(_BREAK_KINDS.split())
_LEVEL_NAMES = ("building:levels", "levels", "num_floors", "storeys", "NumFloors", "geschosse", "floors")
_STRANGE_NAMES = ("wysokosc_bud", "vyska_m_n", "roof_z_rel", "elev_top", "AHN_hgt", "Höhe_ü_G", "q17", "dach_h")
_GROUND_NAMES = ("groundelev", "ground_elevation", "base_elev", "gelaendehoehe", "terrain_height")


def height_columns(draw: Random, case: Case, frame_is_feet: bool) -> dict[str, list[Any]]:
    """Draw how heights are stated; what the file does not state is forgotten."""
    kind = draw.choice(HEIGHTS)
    if kind in ("new-york", "feet-plain") and case.place.name != "new york":
        kind = "metres"
    heights = [house.height or 0.0 for house in case.houses]
    feet = [round(height / FOOT_M, 2) for height in heights]
    levels = [house.levels for house in case.houses]
    case.made["heights"] = kind
    if kind.startswith("levels"):
        texts = [str(level) for level in levels]
        return {draw.choice(_LEVEL_NAMES): texts if kind == "levels-text" else levels}
    case.forget(levels=None)
    if kind == "metres":
        name = draw.choice(_METRE_NAMES)
        if not frame_is_feet or name == "height_m":
            return {name: heights}
        case.made["heights"] = "frame-feet"
        return {name: feet}
    if kind == "text-m":
        return {"height": [f"{height:g} m" for height in heights]}
    if kind == "text-comma":
        return {"height": [f"{height:.2f}".replace(".", ",") + " m" for height in heights]}
    if kind == "text-ft":
        return {"height": [f"{height:g} {draw.choice(('ft', 'feet', 'FT'))}" for height in feet]}
    if kind == "text-quote":
        return {"height": [f"{int(h / FOOT_M)}'{round(h / FOOT_M % 1 * 12)}\"" for h in heights]}
    if kind == "feet-column":
        return {draw.choice(_FEET_NAMES): feet}
    if kind == "cm-column":
        return {"height_cm": [round(height * 100) for height in heights]}
    if kind == "unknown-column":
        case.sound = False
        return {draw.choice(_STRANGE_NAMES): heights}
    if kind == "none":
        case.sound = False
        return {}
    if kind == "absolute":
        unit = FOOT_M if frame_is_feet else 1.0
        return {
            "b3_h_dak_50p": [(case.ground + height) / unit for height in heights],
            "b3_h_maaiveld": [case.ground / unit] * len(heights),
        }
    if kind == "new-york":
        return {"HEIGHTROOF": feet, "GROUNDELEV": [round(case.ground / FOOT_M, 2)] * len(heights)}
    if frame_is_feet:
        return {"height": feet}
    case.sound = False  # feet, which nothing in the column states
    return {"height": feet} | ({"levels": levels} if kind == "feet-hint" else {})


def write_outlines(draw: Random, case: Case, folder: Path, keys: dict[str, Any]) -> Path:
    """Write the buildings as outlines; `keys` receives the keys of `buildings`."""
    kind = draw.choice((*FORMATS, "geojson", "shp", "overture", "pbf"))
    case.made["format"] = kind
    stem = draw.choice(STEMS)
    if kind == "pbf":
        return _write_pbf(case, folder / f"{stem}.osm.pbf", draw)
    frame = draw_frame(draw, case, kind)
    is_feet = frame["crs"] == case.place.feet
    columns: dict[str, list[Any]] = {}
    if kind == "overture":
        columns |= _overture_columns(draw, case)
    else:
        columns |= height_columns(draw, case, is_feet)
        columns |= _id_columns(draw, case)
        if draw.random() < 0.8:
            name = draw.choice(("name", "Name", "bezeichnung", "building_name", "nom"))
            columns[name] = [house.name for house in case.houses]
        else:
            case.forget(name=None)
    unit = FOOT_M if is_feet else 1.0
    known_ground = any(name in columns for name in ("GROUNDELEV", "b3_h_maaiveld"))
    z = draw.choice(("none", "none", "sea", "ellipsoid", "zero"))
    level = {"none": None, "sea": case.ground, "ellipsoid": case.ground + case.place.geoid, "zero": 0.0}[z]
    if not known_ground and z not in ("sea", "ellipsoid"):
        if kind != "overture" and draw.random() < 0.2:
            columns[draw.choice(_GROUND_NAMES)] = [round(case.ground / unit, 2)] * len(case.houses)
        else:
            case.forget(base=None)
    elif not known_ground:
        case.houses = [replace(house, base=level) for house in case.houses]
    case.made["z"] = z
    shapes = [frame["move"](project(house.outline, case.place.frame, frame["crs"])) for house in case.houses]
    if level is not None:
        shapes = [shapely.force_3d(shape, level / unit) for shape in shapes]
    rows = {name: list(values) for name, values in columns.items()}
    if draw.random() < 0.35:
        shapes, rows = break_rows(draw, case, shapes, rows)
    keys |= frame["keys"]
    suffix = {"overture": draw.choice(("parquet", "geojson"))}.get(kind, kind)
    path = folder / f"{stem}.{'geoparquet' if suffix == 'parquet' and draw.random() < 0.3 else suffix}"
    write_table(draw, case, path, shapes, rows, frame["stated"], keys)
    return path


def draw_frame(draw: Random, case: Case, kind: str) -> dict[str, Any]:
    """Draw the frame of the coordinates, what the file states of it, and the keys that the block file gives."""
    place = case.place
    options = ["lonlat", "metric", "lonlat", "metric", "unstated-key"] * 2 + ["unstated", "swapped", "swapped-metric"]
    options += ["feet"] * 4 if place.feet else []
    options += ["prefixed", "prefixed", "prefix-unknown"] if place.prefixed else []
    if kind == "overture":
        options = ["lonlat"] * 5 + ["swapped"]
    what = draw.choice(options)
    case.made["frame"] = what
    crs = draw.choice(place.metric)
    frame: dict[str, Any] = {"crs": crs, "stated": crs, "keys": {}, "move": lambda shape: shape}

    def swap(shape: BaseGeometry) -> BaseGeometry:
        return shapely.transform(shape, lambda xy: xy[:, ::-1])

    if what == "lonlat":
        frame |= {"crs": "EPSG:4326", "stated": "EPSG:4326"}
    elif what == "feet":
        frame |= {"crs": place.feet, "stated": place.feet}
    elif what.startswith("unstated"):
        frame |= {"stated": None, "keys": {"crs": crs} if what == "unstated-key" else {}}
        case.sound = case.sound and what == "unstated-key"
    elif what == "swapped":
        frame |= {"crs": "EPSG:4326", "stated": "EPSG:4326", "move": swap}
        case.sound = False
    elif what == "swapped-metric":
        frame["move"] = swap
        case.sound = False
    elif what == "prefixed":
        assert place.prefixed is not None
        frame |= {"crs": place.prefixed[0], "stated": place.prefixed[0]}
    elif what == "prefix-unknown":
        assert place.prefixed is not None
        shift = place.prefixed[1]
        frame["move"] = lambda shape: shapely.transform(shape, lambda xy: xy + np.array([shift, 0.0]))
        case.sound = False
    return frame


def _id_columns(draw: Random, case: Case) -> dict[str, list[Any]]:
    kind = draw.choice(("id", "gml_id", "UUID", "number", "none", "identificatie"))
    if kind == "none":
        case.forget(id=None)
        return {}
    if kind == "number":
        ids = [10 ** draw.choice((3, 9)) + 3 * number for number in range(len(case.houses))]
        case.houses = [replace(house, id=str(id)) for house, id in zip(case.houses, ids, strict=True)]
        return {draw.choice(("osm_id", "OBJECTID", "egid", "bin")): ids}
    return {kind: [house.id for house in case.houses]}


def _overture_columns(draw: Random, case: Case) -> dict[str, list[Any]]:
    count = len(case.houses)
    columns: dict[str, list[Any]] = {
        "id": [f"08b2a100d2c{number:05x}" for number in range(count)],
        "names": [{"primary": house.name, "common": None} for house in case.houses],
        "class": [draw.choice(("residential", "office", None)) for _ in range(count)],
        "is_underground": [False] * count,
        "has_parts": [False] * count,
    }
    case.houses = [replace(house, id=id) for house, id in zip(case.houses, columns["id"], strict=True)]
    if draw.random() < 0.5:
        columns["height"] = [house.height for house in case.houses]
        case.forget(levels=None)
    else:
        columns["num_floors"] = [house.levels for house in case.houses]
    case.made["heights"] = "overture"
    if draw.random() < 0.5:
        number = draw.randrange(count)
        columns["is_underground"][number] = True
        case.houses[number] = replace(case.houses[number], present=False)
        case.made["underground"] = columns["id"][number]
    return columns


def break_rows(
    draw: Random, case: Case, shapes: list[BaseGeometry], rows: dict[str, list[Any]]
) -> tuple[list[BaseGeometry], dict[str, list[Any]]]:
    """Break one row or one column; the truth stays, except where the break states another one."""
    number = draw.randrange(len(shapes))
    house = case.houses[number]
    what = draw.choice(_BREAKS)
    case.break_with(what)
    lengths = [name for name in rows if _is_length(name)]
    ids = [name for name in rows if name.lower() in _ID_NAMES]
    outline = shapes[number]
    if what in ("null-cell", "words", "negative", "huge") and lengths:
        name = lengths[0]
        is_text = isinstance(rows[name][number], str)
        codes = {"null-cell": None, "words": "unknown", "negative": -5, "huge": draw.choice((999, 9999, 99999))}
        value: Any = codes[what]
        value = str(value) if is_text and value is not None else value
        if what == "words" and not is_text:
            rows[name] = [str(one) for one in rows[name]]
        rows[name][number] = value
    elif what == "nan-column" and lengths:
        rows[lengths[0]] = [math.nan] * len(shapes)
    elif what == "duplicate-ids" and ids:
        rows[ids[0]][number] = rows[ids[0]][number - 1]
    elif what == "bowtie":
        xy = shapely.get_coordinates(outline, include_z=shapely.has_z(outline))
        xy[[1, 2]] = xy[[2, 1]]
        shapes[number] = Polygon(xy)
        if shapes[number].is_valid:  # of an L it is another outline, and no broken one
            plain = shapely.get_coordinates(house.outline)
            plain[[1, 2]] = plain[[2, 1]]
            case.houses[number] = replace(house, outline=Polygon(plain))
    elif what == "hole":
        xy = shapely.get_coordinates(outline, include_z=shapely.has_z(outline))
        inner = xy[:3].mean(axis=0) + (xy[:3] - xy[:3].mean(axis=0)) * 0.5
        plain = shapely.get_coordinates(house.outline)
        hole = plain[:3].mean(axis=0) + (plain[:3] - plain[:3].mean(axis=0)) * 0.5
        shapes[number] = Polygon(xy, [inner])
        case.houses[number] = replace(house, outline=Polygon(plain, [hole]))
    elif what == "multi":
        other = (number + 1) % len(shapes)
        shapes[number] = shapely.MultiPolygon([shapes[number], shapes[other]])
        rows = {name: [value for row, value in enumerate(values) if row != other] for name, values in rows.items()}
        shapes = [shape for row, shape in enumerate(shapes) if row != other]
        case.houses[number] = replace(house, id=None)
        case.houses[other] = replace(house, id=None, outline=case.houses[other].outline)
    elif what == "empty":
        shapes[number] = Polygon()
    elif what == "null":
        shapes[number] = None
    elif what == "far-corner":
        xy = shapely.get_coordinates(outline, include_z=shapely.has_z(outline))
        xy[1, 0] = 1e300  # GDAL writes no NaN
        shapes[number] = Polygon(xy)
    elif what == "origin":
        xy = shapely.get_coordinates(outline, include_z=shapely.has_z(outline))
        xy[:, :2] -= xy[0, :2]
        shapes[number] = Polygon(xy)
    elif what == "repeated-row":
        shapes.append(outline)
        rows = {name: [*values, values[number]] for name, values in rows.items()}
    elif what == "spike":
        xy = shapely.get_coordinates(outline, include_z=shapely.has_z(outline))
        shapes[number] = Polygon(np.concatenate([xy[:1], xy[:2], xy[:1], xy[1:]]))
    elif what == "open-point":
        shapes[number] = shapely.Point(shapely.get_coordinates(outline)[0])
    elif what == "collection":
        shapes[number] = shapely.GeometryCollection([outline, shapely.Point(shapely.get_coordinates(outline)[0])])
    return shapes, rows


def _is_length(name: str) -> bool:
    return name in (
        *_METRE_NAMES,
        *_LEVEL_NAMES,
        "height_ft",
        "Height_Feet",
        "bldg_height_ft",
        "height_cm",
        "HEIGHTROOF",
    )


def write_table(
    draw: Random,
    case: Case,
    path: Path,
    shapes: list[BaseGeometry],
    rows: dict[str, list[Any]],
    crs: str | None,
    keys: dict[str, Any],
) -> None:
    """Write shapes and columns in the format of the suffix."""
    suffix = path.suffix
    if suffix == ".geojson":
        write_geojson(path, shapes, rows, crs, "utf-8-sig" if draw.random() < 0.15 else "utf-8")
        return
    if suffix in (".shp", ".fgb"):  # hold one kind of geometry
        kinds = ("Polygon", "MultiPolygon", "LineString")
        drawn = [shape is not None and not shape.is_empty and shape.geom_type in kinds for shape in shapes]
        shapes = [shape if good else None for shape, good in zip(shapes, drawn, strict=True)]
    frame = GeoDataFrame(
        {name: pd.Series(values) for name, values in rows.items()}, geometry=np.array(shapes, dtype=object), crs=crs
    )
    if "parquet" in suffix:
        frame.to_parquet(path)
        return
    frame = frame.drop(columns=[name for name in frame if isinstance(frame[name].iloc[0], dict)])
    if suffix != ".shp":
        unindexed = {"SPATIAL_INDEX": "NO"} if suffix == ".fgb" else {}
        _write_gdal(frame, path, {".gpkg": "GPKG", ".fgb": "FlatGeobuf"}[suffix], **unindexed)
        return
    text = "".join([*rows, *(str(value) for values in rows.values() for value in values)])
    possible = [page for page in ("utf-8", "latin-1", "cp1251") if _encodes(text, page)]
    page = draw.choice(possible)
    _write_gdal(frame, path, "ESRI Shapefile", encoding=page.upper().replace("LATIN-1", "ISO-8859-1"))
    stated = draw.choice(("cpg", "none", "none", "key"))
    case.made["code page"] = f"{page}, {stated}"
    if stated != "cpg":
        path.with_suffix(".cpg").unlink(missing_ok=True)
    if stated == "none" and not text.isascii() and page != "utf-8":
        case.sound = False  # nothing says which
    if stated == "key":
        keys["encoding"] = page
    if crs is None:
        path.with_suffix(".prj").unlink(missing_ok=True)


def _write_gdal(frame: GeoDataFrame, path: Path, driver: str, **options: str) -> None:
    """Write by GDAL under a plain name, which it does not parse, and rename all files of it."""
    with tempfile.TemporaryDirectory(dir=path.parent) as scratch, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # names cut to 10 characters
        frame.to_file(Path(scratch) / f"layer{path.suffix}", driver=driver, engine="pyogrio", **options)
        for file in Path(scratch).iterdir():
            file.rename(path.with_suffix(file.suffix))


def _encodes(text: str, page: str) -> bool:
    try:
        text.encode(page)
    except UnicodeEncodeError:
        return False
    return True


def write_geojson(
    path: Path, shapes: list[BaseGeometry], rows: dict[str, list[Any]], crs: str | None, encoding: str = "utf-8"
) -> None:
    """Write GeoJSON; a frame other than degrees is stated as the `crs` of 2008."""
    features = []
    for number, shape in enumerate(shapes):
        drawn = None if shape is None else json.loads(shapely.to_geojson(shape))
        properties = {name: _plain(values[number]) for name, values in rows.items()}
        features.append({"type": "Feature", "properties": properties, "geometry": drawn})
    content: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if crs not in (None, "EPSG:4326"):
        content["crs"] = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:{crs.replace(':', '::')}"}}
    path.write_text(json.dumps(content, ensure_ascii=False), encoding=encoding)


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def _write_pbf(case: Case, path: Path, draw: Random) -> Path:
    case.forget(base=None)
    case.made |= {"frame": "lonlat", "heights": "osm"}
    by_height = draw.random() < 0.6
    if by_height:
        case.forget(levels=None)
    ways = []
    for number, house in enumerate(case.houses):
        tags = {"building": "yes", "name": house.name or "house"}
        if by_height:
            tags["height"] = draw.choice(
                (f"{house.height:g}", f"{house.height:g} m", f"{(house.height or 0) / FOOT_M:.2f} ft")
            )
        else:
            tags["building:levels"] = str(house.levels)
        ways.append(
            (1000 + number, shapely.get_coordinates(project(house.outline, case.place.frame, "EPSG:4326")), tags)
        )
    for number, (name, line) in enumerate(case.streets.items()):
        xy = shapely.get_coordinates(project(line, case.place.frame, "EPSG:4326"))
        ways.append((2000 + number, xy, {"highway": "residential", "name": name}))
    write_pbf(path, ways)
    case.houses = [replace(house, id=f"w{1000 + number}") for number, house in enumerate(case.houses)]
    return path


def write_streets(draw: Random, case: Case, folder: Path, keys: dict[str, Any]) -> Path:
    """Write the streets; `keys` receives the keys of `streets`."""
    suffix = draw.choice(FORMATS)
    path = folder / f"{draw.choice(('streets', 'roads;1', 'strassen!', 'ways ü'))}.{suffix}"
    crs = draw.choice(("EPSG:4326", *case.place.metric, *((case.place.feet,) if case.place.feet else ())))
    shapes = [project(line, case.place.frame, crs) for line in case.streets.values()]
    rows: dict[str, list[Any]] = {draw.choice(("name", "street_name", "STR_NAME")): list(case.streets)}
    if draw.random() < 0.6:
        rows[draw.choice(("highway", "fclass", "class"))] = ["residential"] * len(shapes)
    case.made["streets"] = f"{suffix}, {crs}"
    write_table(draw, case, path, shapes, rows, crs, keys)
    return path


__all__ = ["House", "write_outlines", "write_streets"]
