"""CityJSON and CityJSONSeq, on a house made by hand and changed in every way that a file may be, and on real cities."""

from __future__ import annotations

import copy
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalogs.features import BuildingModel, BuildingModels, Footprints
from catalogs.readers.cityjson.buildings import read_cityjson
from catalogs.readers.json_files import read_json_buildings
from facade_core.core.errors import InputError
from facade_core.core.types import SEMANTICS

# A gabled house, 10 x 8 m, 6 m to the eaves and 9 m to the ridge; the wall to the south is cut around a window and a door.
CORNERS = [
    *(
        (0, 0, 0),
        (10, 0, 0),
        (10, 8, 0),
        (0, 8, 0),
        (0, 0, 6),
        (10, 0, 6),
        (10, 8, 6),
        (0, 8, 6),
        (0, 4, 9),
        (10, 4, 9),
    ),
    *((1, 0, 2), (3, 0, 2), (3, 0, 4), (1, 0, 4), (5, 0, 0.1), (7, 0, 0.1), (7, 0, 3), (5, 0, 3)),
]
WINDOW, DOOR = [10, 11, 12, 13], [14, 15, 16, 17]
SURFACES = {
    "GroundSurface": [[[0, 3, 2, 1]]],
    "WallSurface": [[[0, 1, 5, 4], WINDOW[::-1], DOOR[::-1]], [[1, 2, 6, 9, 5]], [[2, 3, 7, 6]], [[3, 0, 4, 8, 7]]],
    "RoofSurface": [[[4, 5, 9, 8]], [[6, 7, 8, 9]]],
    "Window": [[WINDOW]],
    "Door": [[DOOR]],
}
KINDS = list(SURFACES)
SHELL = [surface for surfaces in SURFACES.values() for surface in surfaces]
VALUES = [KINDS.index(kind) for kind, surfaces in SURFACES.items() for _ in surfaces]
VOLUME = 10 * 8 * 7.5
ORIGIN = np.array([85_000.0, 447_000.0, 1.5])

Json = dict[str, Any]
Write = Callable[..., Path]


def solid(lod: Any = "2.2", **more: Any) -> Json:
    semantics = {"surfaces": [{"type": kind} for kind in KINDS], "values": [list(VALUES)]}
    return {"type": "Solid", "lod": lod, "boundaries": [copy.deepcopy(SHELL)], "semantics": semantics, **more}


def box(lod: Any, first: int = 0) -> Json:
    """The house up to its eaves, without semantics."""
    sides = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    return {"type": "MultiSurface", "lod": lod, "boundaries": [[[first + k for k in side]] for side in sides]}


def footprint(lod: Any = "0") -> Json:
    return {"type": "MultiSurface", "lod": lod, "boundaries": [[[0, 1, 2, 3]]]}


def house(*geometries: Json, kind: str = "Building", **more: Any) -> Json:
    return {"type": kind, "geometry": list(geometries), **more}


def city(objects: Json, version: str = "2.0", corners: Any = CORNERS, crs: str | None = "7415", **more: Any) -> Json:
    """A file of these objects; the corners are whole millimetres over ORIGIN."""
    frame = {"metadata": {"referenceSystem": f"https://www.opengis.net/def/crs/EPSG/0/{crs}"}} if crs else {}
    return {
        "type": "CityJSON",
        "version": version,
        "transform": {"scale": [0.001] * 3, "translate": ORIGIN.tolist()},
        "CityObjects": objects,
        "vertices": (np.array(corners) * 1000).round().astype(int).tolist(),
        **frame,
        **more,
    }


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def writer(*documents: Any, name: str = "a.city.json") -> Path:
        path = tmp_path / name
        path.write_text("\n".join(json.dumps(document) for document in documents), encoding="utf-8")
        return path

    return writer


@pytest.fixture
def read(write: Write) -> Callable[..., BuildingModels]:
    def reader(document: Json, lod: str | None = None) -> BuildingModels:
        return read_cityjson(write(document), lod)

    return reader


def areas(model: BuildingModel) -> dict[str, float]:
    a, b, c = (model.shell.vertices[model.shell.triangles[:, k]] for k in range(3))
    size = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    kinds = {SEMANTICS[k] for k in model.shell.semantic}
    return {kind: round(float(size[model.shell.semantic == SEMANTICS.index(kind)].sum()), 6) for kind in kinds}


def volume(model: BuildingModel) -> float:
    a, b, c = ((model.shell.vertices - model.shell.vertices[0])[model.shell.triangles[:, k]] for k in range(3))
    return float(np.einsum("nk,nk", np.cross(a, b), c) / 6)


HOUSE_AREAS = {"ground": 80.0, "roof": 100.0, "wall": 240 - 4 - 5.8, "window": 4.0, "door": 5.8}


def only(models: BuildingModels) -> BuildingModel:
    assert models.faults == ()
    (model,) = models.items
    return model


# ---- what is read


@pytest.mark.parametrize("version", ["1.0", "1.0.3", "1.1", "2.0", "2.0.1"])
def test_a_house_of_every_version(read: Callable[..., BuildingModels], version: str) -> None:
    attributes = {"measuredHeight": 9.0, "storeysAboveGround": 2, "name": " De Hoop ", "TerrainHeight": 1.4}
    others = {"r": {"type": "Road"}, "p1": {"type": "+Pavilion"}, "p2": {"type": "+Pavilion"}}
    models = read(city({"h": house(solid(), attributes=attributes), **others}, version))
    model = only(models)
    assert (models.crs, models.textures) == ("EPSG:7415", ())
    assert [(remark.id, remark.reason) for remark in models.remarks] == [
        (f"{kind} of a.city.json", "kinds of objects that are no buildings left out")
        for kind in ("2 +Pavilion", "1 Road")
    ]
    assert (model.id, model.height, model.levels, model.name, model.base) == ("h", 9.0, 2.0, "De Hoop", 1.4)
    assert areas(model) == pytest.approx(HOUSE_AREAS)
    assert volume(model) == pytest.approx(VOLUME), "closed, and seen from outside"
    np.testing.assert_allclose(model.shell.vertices.min(axis=0), ORIGIN)
    np.testing.assert_allclose(model.shell.vertices.max(axis=0), ORIGIN + np.array([10, 8, 9]))


def test_plain_coordinates_and_numeric_lods_of_version_1_0(read: Callable[..., BuildingModels]) -> None:
    document = city({"h": house(solid(2), box(1))}, "1.0")
    del document["transform"]
    document["vertices"] = [[float(c) for c in corner] for corner in CORNERS]
    assert volume(only(read(document))) == pytest.approx(VOLUME)
    assert volume(only(read(document, "1"))) == pytest.approx(480.0)


def as_surfaces(kind: str) -> Json:
    geometry = solid(type=kind, boundaries=copy.deepcopy(SHELL))
    geometry["semantics"]["values"] = list(VALUES)
    return geometry


def as_solids(kind: str) -> Json:
    geometry = solid(type=kind, boundaries=[[copy.deepcopy(SHELL)]])
    geometry["semantics"]["values"] = [[list(VALUES)]]
    return geometry


@pytest.mark.parametrize(
    "geometry",
    [
        *(as_surfaces(kind) for kind in ("MultiSurface", "CompositeSurface")),
        *(as_solids(kind) for kind in ("MultiSolid", "CompositeSolid")),
    ],
    ids=lambda geometry: geometry["type"],
)
def test_every_kind_of_geometry(read: Callable[..., BuildingModels], geometry: Json) -> None:
    assert areas(only(read(city({"h": house(geometry)})))) == pytest.approx(HOUSE_AREAS)


def test_voids_in_solids_are_left_out(read: Callable[..., BuildingModels]) -> None:
    geometry = solid()
    geometry["boundaries"].append([[WINDOW], [DOOR]])
    geometry["semantics"]["values"].append([0, None])
    several = as_solids("MultiSolid")
    several["boundaries"][0].append([[WINDOW]])
    several["boundaries"].append([[[DOOR]]])  # no semantics for the second solid
    models = read(city({"h": house(geometry), "m": house(several)}))
    assert areas(models.items[0]) == pytest.approx(HOUSE_AREAS)
    assert areas(models.items[1]) == pytest.approx(HOUSE_AREAS | {"unknown": 5.8})


def test_semantics_are_mapped_and_inner_surfaces_dropped(read: Callable[..., BuildingModels]) -> None:
    geometry = solid()
    kinds = ("OuterCeilingSurface", "ClosureSurface", "OuterFloorSurface", "InteriorWallSurface", "+Gutter")
    geometry["semantics"]["surfaces"] = [{"type": kind} for kind in kinds]
    found = areas(only(read(city({"h": house(geometry)}))))
    assert found == pytest.approx({"ceiling": 80.0, "roof": 100.0, "unknown": 5.8})
    wrong: Any
    for wrong in (
        {"values": VALUES},
        {"values": [None]},
        {"values": [[9] * 9]},
        {"values": [["a", -1]]},
        None,
        [],
        {},
    ):
        geometry = solid(semantics=wrong and {"surfaces": [{"type": "Door"}], **wrong})
        assert areas(only(read(city({"h": house(geometry)})))) == pytest.approx({"unknown": 420.0}), wrong
    geometry = solid()
    geometry["semantics"]["values"][0][0] = None
    assert areas(only(read(city({"h": house(geometry)}))))["unknown"] == pytest.approx(80.0)


# ---- what belongs to a building


def test_parts_and_installations_join_their_building(read: Callable[..., BuildingModels]) -> None:
    beside = [[x + 10, y, z] for x, y, z in CORNERS]
    objects = {
        "b-0": house(solid(), kind="BuildingPart", parents=["b"], attributes={"measuredHeight": 9}),
        "b": {"type": "Building", "children": ["b-0", "b-1", "dormer", "room"], "geometry": [box("1.2"), footprint()]},
        "b-1": house(box("1.3", 18), kind="BuildingPart", parents=["b"]),
        "dormer": house({"type": "MultiSurface", "lod": "3", "boundaries": [[WINDOW]]}, kind="BuildingInstallation"),
        "room": house(solid("3"), kind="BuildingRoom", parents=["b"]),
        "g": {"type": "CityObjectGroup", "children": ["lone"]},
        "lone": house(box("1", 18), kind="BuildingPart", parents=["absent"]),
        "stray": house(box("1"), kind="BuildingInstallation"),
    }
    document = city(objects, corners=CORNERS + beside)
    models = read(document)
    assert [model.id for model in models.items] == ["b", "lone"]
    model = models.items[0]
    assert areas(model) == pytest.approx(HOUSE_AREAS | {"unknown": 376.0 + 4.0}), "a part without LoD 2.2 at its best"
    assert model.height == 9.0
    low = read(document, "1.2").items[0]
    assert areas(low) == pytest.approx({"unknown": 376.0}), "the whole building has LoD 1.2"


@pytest.mark.parametrize(("own", "parts"), [((0, 18), (0, 18)), ((0,), (18,)), ((0,), (0,))])
def test_a_solid_around_its_parts_is_not_added_to_them(
    read: Callable[..., BuildingModels], own: tuple[int, ...], parts: tuple[int, ...]
) -> None:
    """Each of two boxes is there once, whether the building, its parts or both have it."""
    beside = [[x + 10, y, z] for x, y, z in CORNERS]
    body = [surface for first in own for surface in box("1", first)["boundaries"]]
    children = {f"p{first}": house(box("1", first), kind="BuildingPart", parents=["b"]) for first in parts}
    whole = {"type": "Building", "geometry": [{**box("1"), "boundaries": body}], "children": list(children)}
    [model] = read(city({"b": whole, **children}, corners=CORNERS + beside)).items
    assert sum(areas(model).values()) == pytest.approx(376.0 * len({*own, *parts}))


def test_a_building_of_its_elements_only(read: Callable[..., BuildingModels]) -> None:
    objects = {"b": house(), "e": house(solid(), kind="BuildingConstructiveElement", parents=["b"])}
    assert volume(only(read(city(objects)))) == pytest.approx(VOLUME)
    objects["b"]["geometry"] = [box("1")]
    assert volume(only(read(city(objects)))) == pytest.approx(480.0)


def test_circles_of_parents_end(read: Callable[..., BuildingModels]) -> None:
    objects = {"a": house(box("1"), parents=["b"]), "b": house(box("1", 8), parents=["a"]), "c": house(box("1"))}
    objects["c"] |= {"parents": ["c"], "children": ["c"]}
    corners = [*CORNERS[:8], *([x + 10, y, z] for x, y, z in CORNERS[:8])]
    models = read(city(objects, corners=corners))
    assert sum(sum(areas(model).values()) for model in models.items) == pytest.approx(3 * 376.0)


@pytest.mark.parametrize(
    ("lod", "expected", "noted"),
    [
        (None, VOLUME, None),
        ("2", VOLUME, None),
        ("2.2", VOLUME, None),
        ("1", 480.0, None),
        ("1.2", 480.0, "buildings without LoD 1.2 read at LoD 1"),
        ("2.1", 480.0, "buildings without LoD 2.1 read at LoD 1"),
        ("3", VOLUME, "buildings without LoD 3 read at LoD 2.2"),
    ],
)
def test_levels_of_detail(
    read: Callable[..., BuildingModels], lod: str | None, expected: float, noted: str | None
) -> None:
    models = read(city({"h": house(footprint(), box("1"), solid())}), lod)
    assert volume(only(models)) == pytest.approx(expected)
    assert [remark.reason for remark in models.remarks] == ([noted] if noted else [])
    assert all(remark.id == "h" and remark.geometry.area == pytest.approx(80) for remark in models.remarks)


def test_nearest_higher_level_where_there_is_no_lower(read: Callable[..., BuildingModels]) -> None:
    models = read(city({"h": house(solid("3.1"), solid("2.2"))}), "1.3")
    assert [remark.reason for remark in models.remarks] == ["buildings without LoD 1.3 read at LoD 2.2"]
    for lod in ("0", "x", "-1", ""):
        with pytest.raises(InputError, match="not a level"):
            read(city({"h": house(solid())}), lod)


def test_a_solid_that_repeats_its_surfaces_counts_once(read: Callable[..., BuildingModels]) -> None:
    bare = solid()
    del bare["semantics"]
    assert areas(only(read(city({"h": house(bare, as_surfaces("MultiSurface"))})))) == pytest.approx(HOUSE_AREAS)


def test_instances_of_templates(read: Callable[..., BuildingModels]) -> None:
    store: Json = {"templates": [solid()], "vertices-templates": [[float(c) for c in corner] for corner in CORNERS]}
    matrix = [0, -2, 0, 5, 2, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]
    instance = {"type": "GeometryInstance", "template": 0, "boundaries": [1], "transformationMatrix": matrix}
    templates: Any = {"geometry-templates": store}
    document = city({"h": house(instance)}, **templates)
    model = only(read(document))
    assert volume(model) == pytest.approx(8 * VOLUME)
    np.testing.assert_allclose(model.shell.vertices.min(axis=0), ORIGIN + np.array([10 + 5 - 16, 0, 0]), atol=1e-6)
    for key, wrong in (("template", 1), ("boundaries", [99]), ("transformationMatrix", [1, 2])):
        broken = read(city({"h": house(instance | {key: wrong})}, **templates))
        assert len(broken.faults) == 1
        assert "instance" in broken.faults[0].reason


# ---- frames


@pytest.mark.parametrize(
    ("name", "crs"),
    [
        ("https://www.opengis.net/def/crs/EPSG/0/28992", "EPSG:28992"),
        ("http://www.opengis.net/def/crs/EPSG/0/7415", "EPSG:7415"),
        ("urn:ogc:def:crs:EPSG::7415", "EPSG:7415"),
        ("urn:ogc:def:crs:EPSG:9.8.4:28992", "EPSG:28992"),
        ("urn:ogc:def:crs,crs:EPSG::28992,crs:EPSG::5709", "EPSG:28992+5709"),
        ("EPSG:28992", "EPSG:28992"),
        ("", None),
        (None, None),
    ],
)
def test_names_of_frames(read: Callable[..., BuildingModels], name: str | None, crs: str | None) -> None:
    models = read(city({"h": house(solid())}, metadata={"referenceSystem": name}))
    assert (models.crs, models.remarks) == (crs, ())
    assert read(city({"h": house(solid())}, crs=None)).crs is None


@pytest.mark.parametrize("name", ["https://www.opengis.net/def/crs/EPSG/0/", "RD New", "EPSG:999999", "EPSG:5709"])
def test_a_frame_that_is_not_understood_is_said(read: Callable[..., BuildingModels], name: str) -> None:
    models = read(city({"h": house(solid())}, metadata={"referenceSystem": name}))
    assert models.crs is None
    assert [remark.reason for remark in models.remarks] == ["names of a CRS that are not understood"]


def degrees(first: float, second: float, *, north_first: bool) -> Json:
    """The transform that makes whole millimetres of the house into degrees at a place."""
    north, east = 0.001 / 111_000, 0.001 / 68_000
    scale = [north, east, 0.001] if north_first else [east, north, 0.001]
    return {"scale": scale, "translate": [first, second, 30.0]}


@pytest.mark.parametrize(
    ("crs", "place", "north_first", "remarked"),
    [
        ("6697", (35.5, 139.5), True, 0),
        ("6697", (139.5, 35.5), False, 1),
        ("4979", (52.0, 4.4), True, 0),
        ("4979", (-100.0, 35.0), False, 1),
    ],
)
def test_degrees_come_out_as_longitude_and_latitude(
    read: Callable[..., BuildingModels], crs: str, place: tuple[float, float], north_first: bool, remarked: int
) -> None:
    document = city({"h": house(solid())}, crs=crs)
    document["transform"] = degrees(*place, north_first=north_first)
    if north_first:
        document["vertices"] = [[y, x, z] for x, y, z in document["vertices"]]
    models = read(document)
    model = only(models)
    longitude, latitude = place[::-1] if north_first else place
    np.testing.assert_allclose(model.shell.vertices.min(axis=0), [longitude, latitude, 30.0], atol=1e-9)
    np.testing.assert_allclose(np.ptp(model.shell.vertices, axis=0), [10 / 68_000, 8 / 111_000, 9], rtol=1e-6)
    assert {SEMANTICS[k] for k in model.shell.semantic} == set(HOUSE_AREAS), "nothing was too small to be cut"
    assert len(models.remarks) == remarked


def test_projected_frames_with_north_first_and_feet(read: Callable[..., BuildingModels]) -> None:
    document = city({"h": house(solid())}, crs="2180")  # Poland: the first axis is the northing
    document["transform"]["translate"] = [500_000.0, 600_000.0, 0.0]
    np.testing.assert_allclose(only(read(document)).shell.vertices.min(axis=0), [600_000.0, 500_000.0, 0.0])
    document = city({"h": house(solid(), attributes={"measuredHeight": 30})}, crs="2263")  # New York, in feet
    document["transform"]["translate"] = [985_000.0, 219_000.0, 0.0]
    model = only(read(document))
    assert model.shell.vertices[:, 2].max() == pytest.approx(9 * 0.3048, rel=1e-4)
    assert model.height == pytest.approx(30 * 0.3048, rel=1e-4)
    with pytest.raises(InputError, match=r"a\.city\.json is in geocentric EPSG:4978; reproject"):
        read(city({"h": house(solid())}, crs="4978"))


# ---- textures


def textured(*images: str, theme: str = "photo", **more: Any) -> Json:
    """The house with the first picture on the wall to the south, its u along x and v up, and the second on the roof."""
    uv = [[x / 10, z / 9] for x, _, z in CORNERS]
    values: list[Any] = [[[None]]] * len(SHELL)
    values[1] = [[0, *ring] for ring in SHELL[1]]
    values[5] = [[1, *SHELL[5][0]]]
    appearance = {"textures": [{"type": "PNG", "image": image} for image in images], "vertices-texture": uv, **more}
    return city({"h": house(solid(texture={theme: {"values": [values]}}))}, appearance=appearance)


def test_textures_that_exist_are_kept(write: Write, tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    for name in ("south wall.png", "roof.png", "unused.png"):
        (tmp_path / "tex" / name).touch()
    path = write(textured("tex/south%20wall.png", "tex\\roof.png", "tex/unused.png"))
    models = read_cityjson(path)
    shell = only(models).shell
    assert models.textures == (tmp_path / "tex" / "south wall.png", tmp_path / "tex" / "roof.png")
    assert models.remarks == ()
    corners = shell.vertices[shell.triangles] - ORIGIN
    on_wall = shell.texture == 0
    assert {SEMANTICS[k] for k in shell.semantic[on_wall]} == {"wall"}
    assert (corners[on_wall][..., 1] == 0).all()
    np.testing.assert_allclose(shell.uv[on_wall], corners[on_wall][..., [0, 2]] / (10, 9), atol=1e-6)
    assert {SEMANTICS[k] for k in shell.semantic[shell.texture == 1]} == {"roof"}
    assert areas(only(models)) == pytest.approx(HOUSE_AREAS)


def test_missing_pictures_take_the_texture_with_them(write: Write, tmp_path: Path) -> None:
    (tmp_path / "roof.png").touch()
    models = read_cityjson(write(textured("gone.png", "roof.png", "never-used.png")))
    shell = only(models).shell
    assert models.textures == (tmp_path / "roof.png",)
    assert set(shell.texture.tolist()) == {-1, 0}
    assert {SEMANTICS[k] for k in shell.semantic[shell.texture == 0]} == {"roof"}
    assert not shell.uv[shell.texture == -1].any()
    (remark,) = models.remarks
    assert remark.reason == "files read without 1 of their 2 texture images, which are missing"


def test_the_default_theme_is_shown_else_the_first_by_name(write: Write, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        (tmp_path / name).touch()
    document = textured("a.png", "b.png")
    texture = document["CityObjects"]["h"]["geometry"][0]["texture"]
    texture["night"] = {"values": [[None, [[1, 0, 1, 5, 4], *texture["photo"]["values"][0][1][1:]]]]}
    assert read_cityjson(write(document)).textures == (tmp_path / "b.png",), "night comes before photo"
    document["appearance"]["default-theme-texture"] = "photo"
    assert read_cityjson(write(document)).textures == (tmp_path / "a.png", tmp_path / "b.png")
    document["appearance"]["default-theme-texture"] = "none such"
    assert read_cityjson(write(document)).textures == (tmp_path / "b.png",)


@pytest.mark.parametrize(
    "ring", [[0, 0, 1, 5], [9, 0, 1, 5, 4], [0, 0, 1, 5, 99], [0, 0, 1, 5, -1], [None], [], None, "x", [0, 0, 1, 5, 18]]
)
def test_texture_values_that_do_not_fit_leave_the_surface_bare(write: Write, tmp_path: Path, ring: Any) -> None:
    for name in ("a.png", "b.png"):
        (tmp_path / name).touch()
    document = textured("a.png", "b.png")
    document["appearance"]["vertices-texture"].append([float("nan"), 0])
    values = document["CityObjects"]["h"]["geometry"][0]["texture"]["photo"]["values"]
    values[0][1] = [ring, *values[0][1][1:]]
    models = read_cityjson(write(document))
    assert models.textures == (tmp_path / "b.png",)
    assert areas(only(models)) == pytest.approx(HOUSE_AREAS)


# ---- broken buildings


def broken(change: Callable[[Json], None]) -> Json:
    """Two houses, the second changed."""
    objects = {"good": house(solid()), "bad": house(solid())}
    document = city(objects, corners=[*CORNERS, [20, 0, 0]])
    change(document)
    return document


def corner(value: Any) -> Callable[[Json], None]:
    def change(document: Json) -> None:
        document["vertices"].append(value)
        document["CityObjects"]["bad"]["geometry"][0]["boundaries"][0][0][0][0] = len(document["vertices"]) - 1

    return change


def bad(**changes: Any) -> Callable[[Json], None]:
    return lambda document: document["CityObjects"]["bad"].update(changes)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (corner([float("nan"), 0, 0]), "vertex 19 is not three finite numbers"),
        (corner([0, float("inf"), 0]), "vertex 19 is not three finite numbers"),
        (corner([0, 0]), "vertex 19 is not three finite numbers"),
        (corner(None), "vertex 19 is not three finite numbers"),
        (corner([0, 0, "high"]), "vertex 19 is not three finite numbers"),
        (corner([0, 0, 10**400]), "vertex 19 is not three finite numbers"),
        (bad(geometry=[solid(boundaries=[[[[0, 1, 99]]]])]), "vertex 99 of a list of 19"),
        (bad(geometry=[solid(boundaries=[[[[0, 1, -1]]]])]), "vertex -1 of a list of 19"),
        (bad(geometry=[solid(boundaries=[[[[0, 1, 2.5]]]])]), "list of vertex numbers"),
        (bad(geometry=[solid(boundaries=[[[[0, None, 2]]]])]), "list of vertex numbers"),
        (bad(geometry=[solid(boundaries=SHELL)]), "not nested as their type asks"),
        (bad(geometry=[solid(type="MultiSurface")]), "list of vertex numbers"),
        (bad(geometry=[solid(boundaries="none")]), "no lists"),
        (bad(geometry=[solid(boundaries=[[[[0, 1, 0, 1]]]])]), "enclose no area"),
        (bad(geometry=[solid(boundaries=[[[[0, 1]]]])]), "enclose no area"),
        (bad(geometry=[solid(boundaries=[[[[0, 1, 2, 3]]]])]), "one height"),
        (bad(geometry=[footprint()]), "only a footprint"),
        (bad(geometry=[]), "no surfaces"),
        (bad(geometry=None), "no surfaces"),
        (bad(geometry=[{"type": "MultiPoint", "boundaries": [0, 1], "lod": "1"}]), "no surfaces"),
        (bad(geometry={"type": "Solid"}), "not a list of geometries"),
        (lambda document: document["CityObjects"].update(bad=[]), "no CityObject"),
    ],
)
def test_a_broken_building_is_set_aside(
    read: Callable[..., BuildingModels], change: Callable[[Json], None], said: str
) -> None:
    models = read(broken(change))
    assert [model.id for model in models.items] == ["good"]
    assert areas(models.items[0]) == pytest.approx(HOUSE_AREAS)
    (fault,) = models.faults
    assert (fault.id, fault.kind) == ("bad", "building")
    assert fault.reason.startswith("a.city.json: ")
    assert said in fault.reason
    assert "\n" not in fault.reason
    if "vertex 19" in said:
        np.testing.assert_allclose(fault.place.bounds, (85_000, 447_000, 85_010, 447_008))


def test_codes_for_unknown_are_no_values(read: Callable[..., BuildingModels]) -> None:
    for attributes in (
        {"measuredHeight": -9999, "storeysAboveGround": 9999, "TerrainHeight": -9999, "name": ""},
        {"measuredHeight": None, "storeysAboveGround": "?", "TerrainHeight": float("nan"), "name": 7},
        {"measuredHeight": True, "storeysAboveGround": 0, "TerrainHeight": [], "gml_name": "  "},
        None,
    ):
        model = only(read(city({"h": house(solid(), attributes=attributes)})))
        assert (model.height, model.levels, model.base, model.name) == (None,) * 4
    model = only(read(city({"h": house(solid(), attributes={"measuredHeight": "9.5", "gml_name": "Hof"})})))
    assert (model.height, model.name) == (9.5, "Hof")


# ---- broken files


def without(key: str) -> Json:
    document = city({"h": house(solid())})
    del document[key]
    return document


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (json.dumps(city({"h": house(solid())}))[:900], "truncated"),
        (json.dumps(city({"h": house(solid())}))[:-1], "truncated"),
        (json.dumps(city({"h": house(solid())}), indent=1)[:700], "truncated"),
        ("", "empty"),
        (" \n", "empty"),
        ("<CityModel/>", "not JSON"),
        ('{"type": "CityJSON", }, "version": "2.0", "CityObjects": {}, "vertices": []}', "not JSON"),
        ("\xff\xfe", "not JSON"),
        ('{"type": "CityJSON", "caf\xe9": "x", "version": "2.0"}', "no UTF-8"),
        ('{"type": "CityJSON", "caf\xc3', "truncated"),
        ("[" * 100_000 + "]" * 100_000, "not usable JSON"),
        ("[]", "not CityJSON"),
        ('"CityJSON"', "not CityJSON"),
        (json.dumps(without("type")), "not CityJSON"),
        (json.dumps(without("version")), "1.0, 1.1 and 2.0 are read"),
        (json.dumps(without("vertices")), "no CityObjects or no vertices"),
        (json.dumps(without("CityObjects")), "no CityObjects or no vertices"),
        (json.dumps(city({}, "0.9")), "CityJSON 0.9"),
        (json.dumps(city({}, "3.0")), "CityJSON 3.0"),
        (json.dumps(city({}) | {"transform": {"scale": [1, 1], "translate": [0, 0, 0]}}), "transform"),
        (json.dumps(city({}) | {"transform": {"scale": [1, 1, float("nan")], "translate": [0, 0, 0]}}), "transform"),
        (json.dumps(city({}) | {"type": "CityJSONFeature"}), "begins with a feature"),
    ],
    ids=range(22),
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.city.json"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(InputError) as caught:
        read_cityjson(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_path_that_is_no_file(tmp_path: Path) -> None:
    for name in ("absent.city.json", "absent.city.jsonl", ""):
        with pytest.raises(InputError, match="cannot be opened"):
            read_cityjson(tmp_path / name)


def test_a_file_without_buildings_has_no_items(read: Callable[..., BuildingModels]) -> None:
    models = read(city({"r": {"type": "Road"}}, corners=np.empty((0, 3))))
    assert (models.items, models.faults, models.crs) == ((), (), "EPSG:7415")


def test_a_byte_order_mark_does_no_harm(write: Write) -> None:
    path = write(city({"h": house(solid())}))
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(read_cityjson(path).items) == 1


# ---- sequences


def feature(id: str, shift: float = 0.0, **objects: Json) -> Json:
    corners = [[x + shift, y, z] for x, y, z in CORNERS]
    vertices = (np.array(corners) * 1000).round().astype(int).tolist()
    return {"type": "CityJSONFeature", "id": id, "CityObjects": objects or {id: house(solid())}, "vertices": vertices}


@pytest.mark.parametrize("name", ["a.city.jsonl", "a.jsonl", "a.city.json"])
def test_a_sequence_reads_as_the_same_buildings(write: Write, name: str) -> None:
    parts = {"p": house(kind="Building", children=["p-0"]), "p-0": house(solid(), kind="BuildingPart", parents=["p"])}
    path = write(city({}, corners=np.empty((0, 3))), feature("a"), "", feature("p", 20, **parts), name=name)
    path.write_text(path.read_text().replace('""', ""))
    models = read_json_buildings(path)
    assert isinstance(models, BuildingModels)
    assert models.faults == ()
    assert models.crs == "EPSG:7415"
    assert [model.id for model in models.items] == ["a", "p"]
    for model, x in zip(models.items, (0, 20), strict=True):
        np.testing.assert_allclose(model.shell.vertices.min(axis=0), ORIGIN + np.array([x, 0, 0]))
        assert areas(model) == pytest.approx(HOUSE_AREAS)


def test_broken_features_are_set_aside(write: Write) -> None:
    head, spoilt = city({}, corners=np.empty((0, 3))), feature("n")
    spoilt["vertices"][0][0] = float("nan")
    path = write(head, feature("a"), spoilt, [1], {"type": "Feature"}, feature("a", 30), name="a.city.jsonl")
    path.write_text(path.read_text() + "\n" + json.dumps(feature("cut"))[:300])
    models = read_cityjson(path)
    assert [model.id for model in models.items] == ["a", "a-2"]
    assert [fault.id for fault in models.faults] == ["n", "line 4", "line 5", "line 7"]
    assert "truncated" in models.faults[-1].reason
    assert [remark.id for remark in models.remarks] == ["a-2"]


def test_textures_of_a_sequence_are_counted_once(write: Write, tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "c.png"):
        (tmp_path / name).touch()
    features = []
    for id, images in (("h", ("a.png", "b.png")), ("i", ("c.png", "a.png"))):
        whole = textured(*images)
        objects = {id: whole["CityObjects"]["h"]}
        features.append(feature(id, **objects) | {"appearance": whole["appearance"]})
    models = read_cityjson(write(city({}, corners=np.empty((0, 3))), *features, name="a.city.jsonl"))
    assert models.textures == tuple(tmp_path / name for name in ("a.png", "b.png", "c.png"))
    roof = SEMANTICS.index("roof")
    assert [set(m.shell.texture[m.shell.semantic == roof].tolist()) for m in models.items] == [{-1, 1}, {-1, 0}]


def test_a_sequence_needs_its_head(write: Write) -> None:
    head = city({}, corners=np.empty((0, 3)))
    bare = {key: value for key, value in head.items() if key != "transform"}
    for documents, said in (
        ((feature("a"), feature("b")), "begins with a feature"),
        ((bare, feature("a")), "no transform in its first line"),
        ((head, feature("a"), head), "line 3 begins a second sequence"),
        ((), "empty"),
    ):
        with pytest.raises(InputError, match=said):
            read_cityjson(write(*documents, name="a.city.jsonl"))


# ---- which reader


def test_json_goes_to_the_reader_of_what_it_is(write: Write) -> None:
    assert [model.id for model in read_json_buildings(write(city({"h": house(solid())}))).items] == ["h"]
    with pytest.raises(InputError, match="is not CityJSON"):
        read_json_buildings(write(without("type")))
    document: Any
    for document in ([], {}, 7, {"type": "Topology"}, {"walls": []}):
        with pytest.raises(InputError, match="holds no buildings"):
            read_json_buildings(write(document))
    wall = [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]]
    walls = read_json_buildings(write({"crs": "EPSG:28992", "walls": {"w": {"south": wall}}}))
    assert isinstance(walls, Footprints)
    assert [item.id for item in walls.items] == ["w"]
    outline = {"type": "Polygon", "coordinates": [[[4.4, 52.0], [4.5, 52.0], [4.5, 52.1], [4.4, 52.0]]]}
    feature = {"type": "Feature", "properties": {"height": 7.0}, "geometry": outline}
    footprints = read_json_buildings(write({"type": "FeatureCollection", "features": [feature]}))
    assert isinstance(footprints, Footprints)
    assert [item.height for item in footprints.items] == [7.0]


# ---- real cities
def test_delfshaven(data: Path) -> None:
    models = read_cityjson(data / "city" / "delfshaven" / "3-20-DELFSHAVEN.city.json")
    assert (models.crs, len(models.items), models.faults, models.textures) == ("EPSG:28992", 853, (), ())
    assert [remark.reason for remark in models.remarks] == [
        "files read without 148 of their 148 texture images, which are missing"
    ]
    kinds = Counter(kind for model in models.items for kind in areas(model))
    assert kinds == {"roof": 853, "wall": 853, "ground": 853}
    assert sum(volume(model) > 0 for model in models.items) > 840, "seen from outside"
    assert all(model.base is not None and -2 < model.base < 5 for model in models.items)
    low, high = np.min([m.shell.vertices.min(axis=0) for m in models.items], axis=0), [91453.879, 436089.946, 41.158]
    np.testing.assert_allclose(low, [90409.32, 435440.44, 0.0], atol=1e-6)
    np.testing.assert_allclose(np.max([m.shell.vertices.max(axis=0) for m in models.items], axis=0), high, atol=1e-6)


def test_delft_and_a_house_made_of_parts(data: Path) -> None:
    delft = read_cityjson(data / "city" / "delft" / "delft.city.json")
    assert (delft.crs, len(delft.items), delft.faults) == ("EPSG:7415", 160, ())
    assert all(model.height is not None for model in delft.items)
    fzk = read_cityjson(data / "city" / "fzk_haus" / "AC20-FZK-Haus.city.json")
    assert fzk.crs is None
    assert only(fzk).id == "Building"
    np.testing.assert_allclose(np.ptp(only(fzk).shell.vertices, axis=0), [18.0, 13.5, 7.3177])


@pytest.mark.parametrize("of_all", [False, True])
def test_colours_of_materials_are_those_of_walls_and_roof(read: Callable[..., BuildingModels], of_all: bool) -> None:
    materials = [{"name": "brick", "diffuseColor": [0.6, 0.2, 0.1]}, {"name": "tiles", "diffuseColor": [0.4, 0.4, 0.4]}]
    numbers = [1 if KINDS[kind] == "RoofSurface" else 0 for kind in VALUES]
    used = {"summer": {"value": 0} if of_all else {"values": [numbers]}}
    document = city({"a": house(solid(material=used))}, appearance={"materials": materials})
    finish = only(read(document)).finish
    assert finish.wall_colour == (153, 51, 26)
    assert finish.roof_colour == ((153, 51, 26) if of_all else (102, 102, 102))


@pytest.mark.parametrize("key", ["Name", "NAME", "naam", "Bezeichnung"])
def test_names_are_found_in_any_case(write: Write, key: str) -> None:
    path = write(city({"h": house(solid(), attributes={key: "Alte Post"})}))
    (model,) = read_json_buildings(path).items
    assert model.name == "Alte Post"
