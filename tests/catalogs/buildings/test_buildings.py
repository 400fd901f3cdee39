"""From what sources state to the buildings of a block: repair, faults, heights, doubles, models and their outlines."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS
from shapely import MultiPolygon, Polygon, box

from catalogs.buildings.assembly import assemble_buildings
from catalogs.buildings.models import shell_outline
from catalogs.buildings.settings import HEIGHTS
from catalogs.features import BuildingModel, BuildingModels, Fault, Footprint, Footprints
from catalogs.readers.faces import PlanarFace, triangulate_faces

RD = CRS.from_epsg(28992)


def footprint(id: str, outline: object, height: float | None = None, levels: float | None = None) -> Footprint:
    return Footprint(id, outline, height, levels, None)


def house(
    x: float, y: float, wide: float = 8.0, deep: float = 10.0, low: float = 1.0, high: float = 9.0
) -> list[PlanarFace]:
    """A box without a name: four walls, a roof and a ground surface."""
    corners = np.array([[x, y], [x + wide, y], [x + wide, y + deep], [x, y + deep]])

    def at(z: float) -> np.ndarray:
        return np.column_stack([corners, np.full(4, z)])

    walls = [
        PlanarFace([np.array([at(low)[i], at(low)[i - 3], at(high)[i - 3], at(high)[i]])], "wall") for i in range(4)
    ]
    return [*walls, PlanarFace([at(high)], "roof"), PlanarFace([at(low)[::-1]], "ground")]


def model(id: str, faces: list[PlanarFace], **known: float) -> BuildingModel:
    shell = triangulate_faces(faces)
    assert shell is not None
    return BuildingModel(id, shell, **known)  # type: ignore[arg-type]


def test_heights_are_stated_from_levels_or_assumed() -> None:
    source = Footprints(
        "EPSG:28992",
        (
            footprint("a", box(0, 0, 10, 10), 9.0),
            footprint("b", box(20, 0, 30, 10), None, 4),
            footprint("c", box(40, 0, 50, 10)),
        ),
    )
    built = assemble_buildings([source], RD, area=None, floor_height=3.0)
    told = [
        (b.height + (b.roof.height if b.height_source == "height" and b.roof else 0.0), b.height_source)
        for b in built.items
    ]
    assert told[:2] == [(pytest.approx(9.0), "height"), (12.0, "levels")]
    assert told[2][1] == "default"
    assert told[2][0] in (3.0, 6.0, 9.0, 12.0, 15.0)
    alone = assemble_buildings([Footprints("EPSG:28992", source.items[2:])], RD, area=None, floor_height=3.0)
    assert abs(alone.items[0].height - HEIGHTS.fallback_height_m) <= 3.0


def test_broken_outlines_are_set_aside_by_name_and_the_rest_is_kept() -> None:
    bowtie = Polygon([(0, 0), (10, 10), (10, 0), (0, 10)])
    touching = Polygon([(20, 0), (30, 0), (30, 10), (25, 0), (20, 10)])  # a ring that touches itself encloses well
    sliver = Polygon([(200, 0), (210, 0), (210, 10), (200, 10), (200, 4), (199.98, 6)])
    nowhere = Polygon([(40, 0), (50, 0), (float("nan"), 10)])
    source = Footprints(
        "EPSG:28992",
        (
            footprint("bow", bowtie),
            footprint("touch", touching),
            footprint("nan", nowhere),
            footprint("good", box(60, 0, 70, 10)),
            footprint("sliver", sliver),
            footprint("two", MultiPolygon([box(90, 0, 100, 10), box(80, 0, 86, 10)])),
        ),
        faults=(Fault("gone", "building", "no geometry; remove it"),),
    )
    built = assemble_buildings([source], RD, area=None, floor_height=3.0)
    assert {fault.id for fault in built.faults} == {"bow", "nan", "gone"}
    assert "crosses itself" in next(f.reason for f in built.faults if f.id == "bow")
    ids = [building.id for building in built.items]
    assert {"good", "two-0", "two-1", "sliver"} <= set(ids)
    assert all(building.footprint.is_valid for building in built.items)
    assert ids.index("two-0") < ids.index("two-1")


def test_faults_outside_the_area_are_not_told() -> None:
    far = Polygon([(1000, 1000), (1010, 1010), (1010, 1000), (1000, 1010)])
    source = Footprints("EPSG:28992", (footprint("far", far), footprint("here", box(0, 0, 10, 10))))
    assert assemble_buildings([source], RD, area=box(-20, -20, 50, 50), floor_height=3.0).faults == ()


def test_a_model_has_its_ground_as_outline_and_its_height_from_the_ground() -> None:
    eaves = PlanarFace([np.array([[-1.0, -1, 9], [9, -1, 9], [9, 11, 9], [-1, 11, 9]])], "roof")
    source = BuildingModels("EPSG:28992", (model("h", [*house(0, 0)[:4], eaves, house(0, 0)[5]]),))
    (building,) = assemble_buildings([source], RD, area=None, floor_height=3.0).items
    assert building.footprint.equals(box(0, 0, 8, 10)), "the roof reaches over the walls"
    assert (building.base, building.height, building.height_source) == (1.0, 8.0, "model")
    assert building.shell is not None


def test_an_outline_survives_triangles_that_miss_each_other_by_a_hair() -> None:
    one = np.array([[0.0, 0, 5], [10, 0, 5], [10, 10, 5]])
    two = np.array([[0.0, 0, 5], [10.0004, 10, 5], [0, 10, 5]])
    shell = triangulate_faces([PlanarFace([one], "roof"), PlanarFace([two], "roof")])
    assert shell is not None
    outline = shell_outline(shell)
    assert outline.geom_type == "Polygon"
    assert len(outline.interiors) == 0
    assert outline.area == pytest.approx(100, abs=0.1)


def test_models_that_cannot_be_used_are_set_aside() -> None:
    walls_only = model("w", house(0, 0)[:4])
    tower = model("t", house(50, 0, high=9000))
    built = assemble_buildings(
        [
            BuildingModels(
                "EPSG:28992", (walls_only, tower, model("k", house(100, 0, 2, 2)), model("ok", house(200, 0)))
            )
        ],
        RD,
        area=None,
        floor_height=3.0,
    )
    assert [building.id for building in built.items] == ["ok"]
    assert {fault.id: fault.reason.partition(";")[0] for fault in built.faults} == {
        "w": "it covers no ground (walls only)",
        "t": "it is over 1500 m high",
    }
    assert "models that cover under 10 m2 set aside: 1 (k)" in built.notes


def test_what_an_earlier_file_states_is_kept_and_textures_are_counted_on() -> None:
    face = PlanarFace([np.array([[0.0, 0, 9], [8, 0, 9], [8, 10, 9], [0, 10, 9]])], "roof", 0, [np.zeros((4, 2))])
    first = BuildingModels("EPSG:28992", (model("a", [*house(0, 0)[:4], face]),), textures=("a.jpg",))  # type: ignore[arg-type]
    far = PlanarFace([face.rings[0] + [100, 0, 0]], "roof", 0, [np.zeros((4, 2))])
    second = BuildingModels(
        "EPSG:28992",
        (model("same-place", house(1, 1)), model("b", [*house(100, 0)[:4], far])),
        textures=("b.jpg",),  # type: ignore[arg-type]
    )
    built = assemble_buildings(
        [first, second, Footprints("EPSG:28992", (footprint("a", box(6, 0, 16, 10)),))], RD, area=None, floor_height=3.0
    )
    assert [building.id for building in built.items] == ["a", "b"]
    assert built.notes == ("buildings stated twice, the first kept: 2 (a, same-place)",)
    assert built.textures == ("a.jpg", "b.jpg")
    shell = built.items[1].shell
    assert shell is not None
    assert set(shell.texture.tolist()) == {-1, 1}


def test_an_id_that_another_building_elsewhere_has_is_numbered() -> None:
    def row(*ids_and_places: tuple[str, float]) -> Footprints:
        return Footprints("EPSG:28992", tuple(footprint(id, box(x, 0, x + 10, 10), 7.0) for id, x in ids_and_places))

    beside = row(("0", 9.9), ("1", 100.0), ("0-2", 200.0))
    again = row(("0", 300.0), ("1", 102.0), ("0-3", 400.0))
    built = assemble_buildings([row(("0", 0.0), ("1", 50.0)), beside, again], RD, area=None, floor_height=3.0)
    places = {building.id: building.footprint.bounds[0] for building in built.items}
    assert places == {
        "0": 0.0,
        "0-2": 200.0,
        "0-3": 9.9,
        "0-3-2": 400.0,
        "0-4": 300.0,
        "1": 50.0,
        "1-2": 100.0,
    }
    assert built.notes == (
        "buildings numbered since one elsewhere has their id: 4 (0-3, 0-3-2, 0-4, 1-2)",
        "buildings stated twice, the first kept: 1 (1)",
    )


def test_models_of_a_second_file_under_the_same_names_are_kept() -> None:
    files = [BuildingModels("EPSG:28992", (model("building_1", house(x, 0)),)) for x in (0, 100)]
    built = assemble_buildings(files, RD, area=None, floor_height=3.0)
    assert [building.id for building in built.items] == ["building_1", "building_1-2"]


def test_slivers_are_repaired_and_named() -> None:
    corners = np.array([(0, 0), (20, 0), (20, 20), (10, 20), (10, 20.01), (10.01, 19.99), (9.99, 20), (0, 20)])
    sliver = Polygon(corners)
    assert not sliver.is_valid
    source = Footprints("EPSG:28992", (footprint("a", sliver, 9.0), footprint("b", box(100, 0, 120, 20), 9.0)))
    note = "outlines that cross themselves in a sliver repaired: 1 (a)"
    for area, ids, is_noted in (
        (None, ["a", "b"], True),
        (box(-9, -9, 50, 50), ["a"], True),
        (box(90, -9, 150, 50), ["b"], False),
    ):
        built = assemble_buildings([source], RD, area=area, floor_height=3.2)
        assert [one.id for one in built.items] == ids
        assert (note in built.notes) == is_noted
