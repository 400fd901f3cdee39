"""The CityGML reader on small files of each version, on broken ones, and on real ones."""

from __future__ import annotations

import gzip
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalogs.features import BuildingModel, BuildingModels
from catalogs.readers.citygml.buildings import read_citygml
from facade_core.core.errors import InputError
from facade_core.core.types import SEMANTICS

SPACES = {
    "1.0": ("1.0", "gml"),
    "2.0": ("2.0", "gml"),
    "3.0": ("3.0", "gml/3.2"),
}
# corners of a 10 x 8 x 6 m box, per face, counter-clockwise from outside
BOX = {
    "GroundSurface": ["0 0 0", "0 8 0", "10 8 0", "10 0 0"],
    "RoofSurface": ["0 0 6", "10 0 6", "10 8 6", "0 8 6"],
    "WallSurface": ["0 0 0", "10 0 0", "10 0 6", "0 0 6"],
    "WallSurface2": ["10 0 0", "10 8 0", "10 8 6", "10 0 6"],
    "WallSurface3": ["10 8 0", "0 8 0", "0 8 6", "10 8 6"],
    "WallSurface4": ["0 8 0", "0 0 0", "0 0 6", "0 8 6"],
}


def moved(corners: list[str], x: float, y: float, z: float, unit: float = 1.0, swap: bool = False) -> str:
    """Corners as a posList, moved and closed."""
    rows = []
    for corner in [*corners, corners[0]]:
        a, b, c = (float(value) for value in corner.split())
        a, b = a * unit + x, b * unit + y
        rows.append(f"{b if swap else a!r} {a if swap else b!r} {c + z!r}")
    return " ".join(rows)


def polygon(positions: str, id: str = "", *, holes: str = "") -> str:
    name = f' gml:id="{id}"' if id else ""
    ring = f' gml:id="{id}_r"' if id else ""
    return (
        f"<gml:Polygon{name}><gml:exterior><gml:LinearRing{ring}><gml:posList>{positions}</gml:posList>"
        f"</gml:LinearRing></gml:exterior>{holes}</gml:Polygon>"
    )


def members(*surfaces: str, kind: str = "MultiSurface") -> str:
    inner = "".join(f"<gml:surfaceMember>{surface}</gml:surfaceMember>" for surface in surfaces)
    return f"<gml:{kind}>{inner}</gml:{kind}>"


def reference(id: str) -> str:
    return f'<gml:MultiSurface><gml:surfaceMember xlink:href="#{id}"/></gml:MultiSurface>'


def thematic(kind: str, surfaces: str, *, lod: int = 2, inner: str = "", property: str = "bldg:boundedBy") -> str:
    return (
        f"<{property}><bldg:{kind}><bldg:lod{lod}MultiSurface>{surfaces}</bldg:lod{lod}MultiSurface>{inner}"
        f"</bldg:{kind}></{property}>"
    )


def box(*, x: float = 0.0, y: float = 0.0, z: float = 0.0, lod: int = 2, id: str = "", boundary: str = "bldg:boundedBy",
        unit: float = 1.0, swap: bool = False) -> str:  # fmt: skip
    """The box as thematic surfaces; polygons are <id><face>."""
    return "".join(
        thematic(
            name.rstrip("234"),
            members(polygon(moved(corners, x, y, z, unit, swap), id and id + name)),
            lod=lod,
            property=boundary,
        )
        for name, corners in BOX.items()
    )


def solid(lod: int, *surfaces: str) -> str:
    shell = members(*surfaces, kind="CompositeSurface")
    return f"<bldg:lod{lod}Solid><gml:Solid><gml:exterior>{shell}</gml:exterior></gml:Solid></bldg:lod{lod}Solid>"


def building(inner: str, id: str = "b") -> str:
    return f'<core:cityObjectMember><bldg:Building gml:id="{id}">{inner}</bldg:Building></core:cityObjectMember>'


def write(folder: Path, *inner: str, version: str = "2.0", srs: str | None = "EPSG:25832", prolog: str = "") -> Path:
    city, gml = SPACES[version]
    bounds = (
        f'<gml:boundedBy><gml:Envelope srsName="{srs}" srsDimension="3"/></gml:boundedBy>' if srs is not None else ""
    )
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>{prolog}'
        f'<core:CityModel xmlns:core="http://www.opengis.net/citygml/{city}" xmlns:gml="http://www.opengis.net/{gml}"'
        f' xmlns:bldg="http://www.opengis.net/citygml/building/{city}"'
        f' xmlns:con="http://www.opengis.net/citygml/construction/{city}"'
        f' xmlns:app="http://www.opengis.net/citygml/appearance/{city}" xmlns:xlink="http://www.w3.org/1999/xlink">'
        f"{bounds}{''.join(inner)}</core:CityModel>"
    )
    path = folder / "city.gml"
    path.write_text(text, encoding="utf-8")
    return path


def counts(model: BuildingModel) -> dict[str, int]:
    return dict(Counter(SEMANTICS[index] for index in model.shell.semantic))


def areas(model: BuildingModel) -> dict[str, float]:
    """Area by semantic, in the square of the frame's unit."""
    corners = model.shell.vertices[model.shell.triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    found: dict[str, float] = {}
    for area, semantic in zip(np.linalg.norm(cross, axis=1) / 2, model.shell.semantic, strict=True):
        found[SEMANTICS[semantic]] = found.get(SEMANTICS[semantic], 0.0) + float(area)
    return found


def volume(model: BuildingModel) -> float:
    """Signed: positive where the triangles turn counter-clockwise seen from outside."""
    a, b, c = (model.shell.vertices[model.shell.triangles[:, k]] - model.shell.vertices[0] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


def reasons(models: BuildingModels) -> list[str]:
    return [remark.reason for remark in models.remarks]


WHOLE = {"ground": 80.0, "roof": 80.0, "wall": 216.0}
UTM: dict[str, Any] = {"x": 680_000.0, "y": 5_400_000.0, "z": 400.0}


@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_box_with_its_attributes(tmp_path: Path, version: str) -> None:
    facts = (
        "<gml:name> Old mill </gml:name><bldg:measuredHeight uom='#m'>6.5</bldg:measuredHeight>"
        "<bldg:storeysAboveGround>2</bldg:storeysAboveGround>"
    )
    models = read_citygml(write(tmp_path, building(facts + box(**UTM)), version=version))
    assert models.crs == "EPSG:25832"
    assert (models.textures, models.remarks, models.faults) == ((), (), ())
    (model,) = models.items
    assert (model.id, model.name, model.height, model.levels, model.base) == ("b", "Old mill", 6.5, 2.0, None)
    assert areas(model) == pytest.approx(WHOLE)
    assert volume(model) == pytest.approx(480)
    assert model.shell.vertices.min(axis=0) == pytest.approx([680_000, 5_400_000, 400])
    assert (model.shell.texture == -1).all()


def test_city_3_with_boundaries_fillings_parts_and_heights(tmp_path: Path) -> None:
    window = polygon(moved(["2 0 2", "4 0 2", "4 0 4", "2 0 4"], **UTM))
    wall = thematic(
        "WallSurface",
        members(polygon(moved(BOX["WallSurface"], **UTM))),
        inner=thematic("WindowSurface", members(window), property="con:fillingSurface"),
        property="core:boundary",
    ).replace("bldg:lod", "core:lod")
    inside = "<con:relationToConstruction>inside</con:relationToConstruction>" + box(**UTM)
    text = (
        "<con:height><con:Height><con:value uom='urn:ogc:def:uom:UCUM::m'>11</con:value></con:Height></con:height>"
        f"{wall}<bldg:buildingPart><bldg:BuildingPart>{box(x=680_010.0, y=5_400_000.0, boundary='core:boundary')}"
        "</bldg:BuildingPart></bldg:buildingPart>"
        f"<bldg:buildingInstallation><bldg:BuildingInstallation>{inside}</bldg:BuildingInstallation>"
        "</bldg:buildingInstallation>"
    )
    (model,) = read_citygml(write(tmp_path, building(text), version="3.0")).items
    assert model.height == 11
    assert areas(model) == pytest.approx({"wall": 216 + 60, "window": 4, "ground": 80, "roof": 80})


def test_windows_and_doors_in_holes(tmp_path: Path) -> None:
    opening = moved(["2 0 2", "4 0 2", "4 0 4", "2 0 4"], **UTM)
    hole = f"<gml:interior><gml:LinearRing><gml:posList>{opening}</gml:posList></gml:LinearRing></gml:interior>"
    fills = "".join(
        thematic(kind, members(polygon(moved(corners, **UTM))), lod=3, property="bldg:opening")
        for kind, corners in {
            "Window": ["2 0 2", "4 0 2", "4 0 4", "2 0 4"],
            "Door": ["6 0 0", "7 0 0", "7 0 2", "6 0 2"],
        }.items()
    )
    wall = thematic("WallSurface", members(polygon(moved(BOX["WallSurface"], **UTM), holes=hole)), lod=3, inner=fills)
    (model,) = read_citygml(write(tmp_path, building(wall))).items
    assert areas(model) == pytest.approx({"wall": 56, "window": 4, "door": 2})


def test_references_of_a_solid_count_no_polygon_twice(tmp_path: Path) -> None:
    references = [f'<gml:OrientableSurface orientation="-"><gml:baseSurface xlink:href="#{n}"/></gml:OrientableSurface>'
                  for n in BOX]  # fmt: skip
    text = building(solid(2, *references) + "".join(
        thematic(name.rstrip("234"), members(polygon(moved(corners, **UTM), name))) for name, corners in BOX.items()
    ))  # fmt: skip
    (model,) = read_citygml(write(tmp_path, text)).items
    assert areas(model) == pytest.approx(WHOLE)
    assert volume(model) == pytest.approx(480)


def test_boundaries_that_refer_to_the_solid_give_it_their_semantics(tmp_path: Path) -> None:
    inline = [polygon(moved(corners, **UTM), name) for name, corners in BOX.items()]
    boundaries = "".join(thematic(n.rstrip("234"), reference(n)) for n in BOX)
    (model,) = read_citygml(write(tmp_path, building(solid(2, *inline) + boundaries))).items
    assert areas(model) == pytest.approx(WHOLE)


def test_solid_that_repeats_its_boundary_counts_once(tmp_path: Path) -> None:
    inline = [polygon(moved(corners[2:] + corners[:2], **UTM)) for corners in BOX.values()]
    (model,) = read_citygml(write(tmp_path, building(solid(2, *inline) + box(**UTM)))).items
    assert areas(model) == pytest.approx(WHOLE)


def test_crossing_walls_of_one_extent_both_stay(tmp_path: Path) -> None:
    one, two = (["0 0 0", "5 5 0", "5 5 3", "0 0 3"], ["0 5 0", "5 0 0", "5 0 3", "0 5 3"])
    text = building(solid(1, polygon(moved(one, **UTM)), polygon(moved(two, **UTM))))
    (model,) = read_citygml(write(tmp_path, text)).items
    assert counts(model) == {"unknown": 4}


def test_turned_surfaces_face_the_other_way(tmp_path: Path) -> None:
    turned = [
        f'<gml:OrientableSurface orientation="-"><gml:baseSurface>{polygon(moved(corners[::-1], **UTM))}'
        "</gml:baseSurface></gml:OrientableSurface>"
        for corners in BOX.values()
    ]
    (model,) = read_citygml(write(tmp_path, building(solid(1, *turned)))).items
    assert volume(model) == pytest.approx(480)
    assert areas(model) == pytest.approx({"unknown": 376})


def test_inner_and_closing_surfaces_are_left_out_of_solids_too(tmp_path: Path) -> None:
    text = box(**UTM, id="w") + thematic(
        "ClosureSurface", members(polygon(moved(BOX["WallSurface"], x=0, y=20, z=0), "c"))
    )
    text += thematic("InteriorWallSurface", members(polygon(moved(BOX["WallSurface2"], x=0, y=20, z=0))))
    text += f"<bldg:lod2Solid>{members(polygon(moved(BOX['RoofSurface'], **UTM)))}</bldg:lod2Solid>"
    text += f"<bldg:lod2MultiSurface>{reference('c')}</bldg:lod2MultiSurface>"
    (model,) = read_citygml(write(tmp_path, building(text))).items
    assert areas(model) == pytest.approx(WHOLE)


def test_outer_ceilings_and_floors(tmp_path: Path) -> None:
    text = thematic("OuterCeilingSurface", members(polygon(moved(BOX["GroundSurface"], **UTM))))
    text += thematic("OuterFloorSurface", members(polygon(moved(BOX["RoofSurface"], **UTM))))
    (model,) = read_citygml(write(tmp_path, building(text))).items
    assert areas(model) == pytest.approx({"ceiling": 80, "roof": 80})


def test_triangles_and_single_positions(tmp_path: Path) -> None:
    corners = [f"<gml:pos>{a} {b} {c}</gml:pos>" for a, b, c in ((0, 0, 0), (4, 0, 0), (4, 3, 0))]
    ring = "<gml:exterior><gml:LinearRing>{}</gml:LinearRing></gml:exterior>"
    closed = "".join([*corners, corners[0]])
    patches = f"<gml:Triangle>{ring.format(closed)}</gml:Triangle>" + (
        f"<gml:Rectangle>{ring.format('<gml:posList>0 0 1 2 0 1 2 2 1 0 2 1</gml:posList>')}</gml:Rectangle>"
    )
    surface = f"<gml:TriangulatedSurface><gml:trianglePatches>{patches}</gml:trianglePatches></gml:TriangulatedSurface>"
    old = (
        "<gml:Polygon><gml:outerBoundaryIs><gml:LinearRing><gml:coordinates>0,0,2 1,0,2 1,1,2</gml:coordinates>"
        "</gml:LinearRing></gml:outerBoundaryIs></gml:Polygon>"
    )
    text = building(f"<bldg:lod1MultiSurface>{members(surface, old)}</bldg:lod1MultiSurface>")
    (model,) = read_citygml(write(tmp_path, text, srs=None)).items
    assert areas(model) == pytest.approx({"unknown": 6 + 4 + 0.5})


def test_references_in_a_circle_end(tmp_path: Path) -> None:
    loop = '<gml:CompositeSurface gml:id="c"><gml:surfaceMember xlink:href="#c"/>{}</gml:CompositeSurface>'
    member = f"<gml:surfaceMember>{polygon(moved(BOX['RoofSurface'], **UTM))}</gml:surfaceMember>"
    part = '<bldg:consistsOfBuildingPart xlink:href="#b"/>'
    text = building(f"<bldg:lod2MultiSurface>{members(loop.format(member))}</bldg:lod2MultiSurface>{part}")
    models = read_citygml(write(tmp_path, text))
    assert areas(models.items[0]) == pytest.approx({"unknown": 80})


# ---- levels of detail


@pytest.mark.parametrize(
    ("asked", "wall", "remark"),
    [
        (None, 4, []),
        ("3", 4, []),
        ("2", 1, ["buildings without LoD 2 read at LoD 1"]),
        ("1.2", 1, []),
        ("4", 4, ["buildings without LoD 4 read at LoD 3"]),
        ("0", 1, ["buildings without LoD 0 read at LoD 1"]),
    ],
)
def test_level_of_detail(tmp_path: Path, asked: str | None, wall: int, remark: list[str]) -> None:
    small = polygon(moved(["0 0 0", "1 0 0", "1 0 1", "0 0 1"], **UTM))
    large = polygon(moved(["0 0 0", "2 0 0", "2 0 2", "0 0 2"], **UTM))
    text = solid(1, small) + thematic("WallSurface", members(large), lod=3)
    models = read_citygml(write(tmp_path, building(text)), asked)
    assert sum(areas(models.items[0]).values()) == pytest.approx(wall)
    assert reasons(models) == remark


def test_parts_stay_whole_and_hulls_are_not_added(tmp_path: Path) -> None:
    def part(inner: str) -> str:
        return (
            f"<bldg:consistsOfBuildingPart><bldg:BuildingPart>{inner}</bldg:BuildingPart></bldg:consistsOfBuildingPart>"
        )

    hull = solid(1, polygon(moved(["0 0 9", "50 0 9", "50 50 9", "0 50 9"], **UTM)))
    coarse = solid(1, polygon(moved(["20 0 6", "21 0 6", "21 1 6", "20 1 6"], **UTM)))
    finer = f"<bldg:BuildingInstallation>{box(lod=3, **UTM)}</bldg:BuildingInstallation>"
    finer = f"<bldg:outerBuildingInstallation>{finer}</bldg:outerBuildingInstallation>"
    text = building(hull + part("<bldg:measuredHeight>7</bldg:measuredHeight>" + box(**UTM)) + part(coarse) + finer)
    (model,) = read_citygml(write(tmp_path, text)).items
    assert areas(model) == pytest.approx(WHOLE | {"unknown": 1}), "the hull and the finer installation stay out"
    assert model.height == 7
    (model,) = read_citygml(write(tmp_path, text), "1").items
    assert areas(model) == pytest.approx({"unknown": 2501})


# ---- frames


@pytest.mark.parametrize(
    ("srs", "crs"),
    [
        ("EPSG:25832", "EPSG:25832"),
        ("epsg:25832", "EPSG:25832"),
        ("25832", "EPSG:25832"),
        ("urn:ogc:def:crs:EPSG::25832", "EPSG:25832"),
        ("urn:ogc:def:crs:EPSG:6.12:25832", "EPSG:25832"),
        ("http://www.opengis.net/def/crs/EPSG/0/25832", "EPSG:25832"),
        ("http://www.opengis.net/gml/srs/epsg.xml#25832", "EPSG:25832"),
        ("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783", "EPSG:25832+5783"),
        ("urn:ogc:def:crs,crs:EPSG:6.12:25832,crs:EPSG:6.12:5783", "EPSG:25832+5783"),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NH", "EPSG:25832+5783"),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", "EPSG:25832+7837"),
        ("EPSG:5555", "EPSG:5555"),
        ("EPSG:25832+5783", "EPSG:25832+5783"),
        (
            "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/25832"
            "&amp;2=http://www.opengis.net/def/crs/EPSG/0/5783",
            "EPSG:25832+5783",
        ),
    ],
)
def test_spellings_of_a_frame(tmp_path: Path, srs: str, crs: str) -> None:
    models = read_citygml(write(tmp_path, building(box(**UTM)), srs=srs))
    assert models.crs == crs
    assert models.remarks == ()
    assert models.items[0].shell.vertices[:, 0].min() == 680_000


@pytest.mark.parametrize(("zone", "code"), [(31, 25831), (33, 25833)])
def test_other_zones_of_the_german_surveys(tmp_path: Path, zone: int, code: int) -> None:
    path = write(tmp_path, building(box(**UTM)), srs=f"urn:adv:crs:ETRS89_UTM{zone}*DE_DHHN2016_NH")
    assert read_citygml(path).crs == f"EPSG:{code}+7837"


@pytest.mark.parametrize("srs", ["EPSG:6697", "http://www.opengis.net/def/crs/EPSG/0/6697"])
def test_latitude_first_comes_out_longitude_first(tmp_path: Path, srs: str) -> None:
    text = building(box(x=139.77, y=35.5, z=3.0, unit=1e-5, swap=True))
    models = read_citygml(write(tmp_path, text, srs=srs))
    (model,) = models.items
    assert models.crs == "EPSG:6697"
    assert model.shell.vertices.min(axis=0) == pytest.approx([139.77, 35.5, 3.0])
    assert counts(model) == {"ground": 2, "roof": 2, "wall": 8}
    assert volume(model) > 0, "walls face outwards"


def test_longitude_first_in_a_frame_of_latitude_first_is_seen(tmp_path: Path) -> None:
    text = building(box(x=139.77, y=35.5, unit=1e-5))
    models = read_citygml(write(tmp_path, text, srs="EPSG:4326"))
    assert models.items[0].shell.vertices[:, :2].min(axis=0) == pytest.approx([139.77, 35.5])
    assert reasons(models) == ["frames whose axes are swapped"]


@pytest.mark.parametrize("swap", [False, True])
def test_both_orders_of_gauss_krueger(tmp_path: Path, swap: bool) -> None:
    text = building(box(x=4_468_000.0, y=5_333_000.0, swap=swap))
    models = read_citygml(write(tmp_path, text, srs="urn:ogc:def:crs:EPSG::31468"))
    assert models.items[0].shell.vertices[:, :2].min(axis=0) == pytest.approx([4_468_000, 5_333_000])
    assert reasons(models) == ([] if swap else ["frames whose axes are swapped"])


def test_an_order_that_is_assumed_is_said(tmp_path: Path) -> None:
    models = read_citygml(write(tmp_path, building(box(x=11.4, y=48.7, unit=1e-5, swap=True)), srs="EPSG:4326"))
    assert models.items[0].shell.vertices[:, :2].min(axis=0) == pytest.approx([11.4, 48.7])
    assert reasons(models) == ["frames whose first axis is taken to be north, as EPSG defines them"]


@pytest.mark.parametrize(
    ("srs", "metres"),
    [
        ("urn:ogc:def:crs,crs:EPSG::2263,crs:EPSG::6360", 1200 / 3937),
        ("urn:ogc:def:crs,crs:EPSG::2263,crs:EPSG::5703", 1.0),
        ("EPSG:2263", 1200 / 3937),
    ],
)
def test_feet_become_metres_of_height_only(tmp_path: Path, srs: str, metres: float) -> None:
    text = "<bldg:measuredHeight>6</bldg:measuredHeight><bldg:storeysAboveGround>2</bldg:storeysAboveGround>"
    models = read_citygml(write(tmp_path, building(text + box(x=980_000.0, y=190_000.0)), srs=srs))
    (model,) = models.items
    assert np.ptp(model.shell.vertices, axis=0) == pytest.approx([10, 8, 6 * metres])
    assert model.height == pytest.approx(6 * metres), "a figure without a unit is in that of the heights"
    assert model.levels == 2
    stated = text.replace("<bldg:measuredHeight", "<bldg:measuredHeight uom='m'")
    path = write(tmp_path, building(stated + box(x=980_000.0, y=190_000.0)), srs=srs)
    assert read_citygml(path).items[0].height == 6


def test_frame_of_the_geometry_without_an_envelope(tmp_path: Path) -> None:
    text = building(box(**UTM)).replace("<gml:MultiSurface>", '<gml:MultiSurface srsName="EPSG:25832">')
    assert read_citygml(write(tmp_path, text, srs=None)).crs == "EPSG:25832"
    models = read_citygml(write(tmp_path, building(box(**UTM)), srs=None))
    assert (models.crs, models.remarks, len(models.items)) == (None, (), 1)


def test_building_in_another_frame_is_set_aside(tmp_path: Path) -> None:
    other = building(box(**UTM), "c").replace("<gml:MultiSurface>", '<gml:MultiSurface srsName="EPSG:25833">')
    models = read_citygml(write(tmp_path, building(box(**UTM)), other))
    assert [model.id for model in models.items] == ["b"]
    assert [fault.id for fault in models.faults] == ["c"]
    assert "EPSG:25833" in models.faults[0].reason


def test_one_zone_under_two_names_is_one_frame(tmp_path: Path) -> None:
    other = building(box(**UTM), "c").replace("<gml:MultiSurface>", '<gml:MultiSurface srsName="EPSG:5555">')
    models = read_citygml(write(tmp_path, building(box(**UTM)), other))
    assert ([model.id for model in models.items], models.crs, models.faults) == (["b", "c"], "EPSG:25832", ())


def test_frames_that_are_unknown_or_far(tmp_path: Path) -> None:
    empty = building("<bldg:lod1MultiSurface></bldg:lod1MultiSurface>", "e")
    models = read_citygml(write(tmp_path, empty, empty, building(box(**UTM)), srs="my town"))
    assert models.crs is None
    models = read_citygml(write(tmp_path, building(box(**UTM)), building(box(**UTM), "c"), srs="my town"))
    assert reasons(models) == ["names of a CRS that are not understood"]
    assert reasons(read_citygml(write(tmp_path, building(box())))) == ["frames far from the area they are made for"]
    with pytest.raises(InputError, match="geocentric"):
        read_citygml(write(tmp_path, building(box()), srs="EPSG:4978"))


# ---- textures

WALL_UV = "0 0 1 0 1 0.5 0 0.5 0 0"


def textured(uri: str, target: str, coordinates: str = WALL_UV, theme: str = "rgbTexture") -> str:
    return (
        f"<app:appearanceMember><app:Appearance><app:theme>{theme}</app:theme><app:surfaceDataMember>"
        f"<app:ParameterizedTexture><app:imageURI>{uri}</app:imageURI>{target.format(coordinates)}"
        "</app:ParameterizedTexture></app:surfaceDataMember></app:Appearance></app:appearanceMember>"
    )


TARGET = (
    '<app:target uri="#wWallSurface"><app:TexCoordList><app:textureCoordinates ring="#wWallSurface_r">{}'
    "</app:textureCoordinates></app:TexCoordList></app:target>"
)
TARGET_3 = (
    "<app:textureParameterization><app:TextureAssociation><app:target>#wWallSurface</app:target>"
    "<app:textureParameterization><app:TexCoordList><app:textureCoordinates>{}</app:textureCoordinates>"
    "<app:ring>#wWallSurface_r</app:ring></app:TexCoordList></app:textureParameterization></app:TextureAssociation>"
    "</app:textureParameterization>"
)


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    (tmp_path / "a b").mkdir()
    for name in ("a b/w.jpg", "other.png"):
        (tmp_path / name).write_bytes(b"a picture")
    return tmp_path


@pytest.mark.parametrize(
    ("version", "target", "uri"),
    [("2.0", TARGET, "a b/w.jpg"), ("2.0", TARGET, "a%20b\\w.jpg"), ("3.0", TARGET_3, "a b/w.jpg")],
)
@pytest.mark.parametrize("inside", [False, True])
def test_texture_of_a_wall(pictures: Path, version: str, target: str, uri: str, inside: bool) -> None:
    appearance = textured(uri, target)
    within = appearance.replace("appearanceMember", "appearance") if inside else ""
    path = write(pictures, building(box(**UTM, id="w") + within), "" if inside else appearance, version=version)
    models = read_citygml(path)
    assert models.textures == (pictures / "a b" / "w.jpg",)
    shell = models.items[0].shell
    assert (shell.texture == 0).sum() == 2
    for triangle, uv in zip(shell.triangles[shell.texture == 0], shell.uv[shell.texture == 0], strict=True):
        x, y, z = (shell.vertices[triangle] - [680_000, 5_400_000, 400]).T
        assert (y == 0).all()
        assert uv == pytest.approx(np.column_stack([x / 10, z / 12])), "v points up"
    assert not shell.uv[shell.texture < 0].any()


def test_texture_of_a_turned_surface_turns_with_it(pictures: Path) -> None:
    base = polygon(moved(BOX["WallSurface"], **UTM), "wWallSurface")
    turned = f'<gml:OrientableSurface orientation="-"><gml:baseSurface>{base}</gml:baseSurface></gml:OrientableSurface>'
    text = building(thematic("WallSurface", members(turned)))
    shell = read_citygml(write(pictures, text, textured("a b/w.jpg", TARGET))).items[0].shell
    x, _, z = (shell.vertices[shell.triangles] - [680_000, 5_400_000, 400]).transpose(2, 0, 1)
    assert shell.uv == pytest.approx(np.stack([x / 10, z / 12], axis=-1))
    corners = shell.vertices[shell.triangles[0]]
    assert np.cross(corners[1] - corners[0], corners[2] - corners[0])[1] > 0


@pytest.mark.parametrize("themes", [("winter", "RGBTexture"), ("b", "a")])
def test_one_theme_wins(pictures: Path, themes: tuple[str, str]) -> None:
    other, first = textured("other.png", TARGET, theme=themes[0]), textured("a b/w.jpg", TARGET, theme=themes[1])
    for order in ((other, first), (first, other)):
        models = read_citygml(write(pictures, building(box(**UTM, id="w")), *order))
        assert models.textures == (pictures / "a b" / "w.jpg",)


def test_missing_pictures_are_one_remark(pictures: Path) -> None:
    gone = [textured(uri, TARGET) for uri in ("gone.jpg", "http://x.example/y.jpg", "../gone.jpg", "gone.jpg")]
    models = read_citygml(write(pictures, building(box(**UTM, id="w")), *gone, textured("other.png", "")))
    assert models.textures == ()
    assert (models.items[0].shell.texture == -1).all()
    assert [remark.id for remark in models.remarks] == ["3 of 4 of city.gml, the first gone.jpg"]


@pytest.mark.parametrize("coordinates", ["0 0 1 0", "0 0 1 0 x 1 0 1 0 0", "0 0 1 0 nan 1 0 1 0 0", ""])
def test_coordinates_that_do_not_fit_leave_the_wall_bare(pictures: Path, coordinates: str) -> None:
    text = textured("other.png", TARGET, coordinates)
    models = read_citygml(write(pictures, building(box(**UTM, id="w")), text))
    assert (models.items[0].shell.texture == -1).all()
    assert reasons(models) == ["buildings with texture coordinates that do not fit their rings"]


def test_texture_by_a_matrix_is_ignored(pictures: Path) -> None:
    matrix = "<app:TexCoordGen><app:worldToTexture>1 0 0</app:worldToTexture></app:TexCoordGen>"
    matrix = f'<app:target uri="#w">{matrix}</app:target>'
    models = read_citygml(write(pictures, building(box(**UTM, id="w")), textured("other.png", matrix)))
    assert models.textures == ()
    assert reasons(models) == ["textures placed by a matrix instead of coordinates ignored"]


# ---- what is broken


@pytest.mark.parametrize(
    ("inner", "reason"),
    [
        (box(**UTM).replace("680010.0", "NaN", 1), "finite"),
        (box(**UTM).replace("680010.0", "1e999", 1), "finite"),
        (box(**UTM).replace("680010.0", "?", 1), "finite"),
        (box(**UTM).replace("680010.0", "", 1), "x, y and z"),
        ("", "no geometry"),
        (f"<bldg:lod0FootPrint>{members(polygon('0 0 0 1 0 0 1 1 0'))}</bldg:lod0FootPrint>", "footprint only"),
        (f"<bldg:lod1MultiSurface>{members()}</bldg:lod1MultiSurface>", "no geometry"),
        (f"<bldg:lod1MultiSurface>{members(polygon('0 0 0 1 0 0 2 0 0'))}</bldg:lod1MultiSurface>", "no area"),
        (f"<bldg:lod1MultiSurface>{members(polygon('0 0 0 0 0 0'))}</bldg:lod1MultiSurface>", "no area"),
        (f"<bldg:lod1MultiSurface>{members(polygon(''))}</bldg:lod1MultiSurface>", "no area"),
        ("<bldg:lod1MultiSurface>" + reference("x") + "</bldg:lod1MultiSurface>", "no geometry"),
    ],
)  # fmt: skip
def test_a_broken_building_is_set_aside(tmp_path: Path, inner: str, reason: str) -> None:
    models = read_citygml(write(tmp_path, building(inner, "bad"), building(box(**UTM), "good")))
    assert [model.id for model in models.items] == ["good"]
    (fault,) = models.faults
    assert (fault.id, fault.kind) == ("bad", "building")
    assert reason in fault.reason
    assert "\n" not in fault.reason


def test_a_set_aside_building_has_a_place(tmp_path: Path) -> None:
    models = read_citygml(write(tmp_path, building(box(**UTM).replace("400.0", "NaN", 1), "bad")))
    place = models.faults[0].place
    assert (place.x, place.y) == pytest.approx((680_005, 5_400_004), abs=6)
    assert models.crs == "EPSG:25832"


def test_dirt_in_a_footprint_does_not_matter(tmp_path: Path) -> None:
    dirt = f"<bldg:lod0RoofEdge>{members(polygon('nan 0 0 1 0 0 1 1 0'))}</bldg:lod0RoofEdge>"
    models = read_citygml(write(tmp_path, building(dirt + box(**UTM))))
    assert (len(models.items), models.faults) == (1, ())


def test_ids_are_made_unique(tmp_path: Path) -> None:
    nameless = building(box(**UTM)).replace(' gml:id="b"', "")
    models = read_citygml(write(tmp_path, building(box(**UTM)), building(box(**UTM)), nameless))
    assert [model.id for model in models.items] == ["b", "b-2", "city-3"]


def test_unknown_figures_stay_unknown(tmp_path: Path) -> None:
    facts = (
        "<bldg:measuredHeight uom='m'>-9999</bldg:measuredHeight>"
        "<bldg:storeysAboveGround>9999</bldg:storeysAboveGround><gml:name> </gml:name>"
    )
    (model,) = read_citygml(write(tmp_path, building(facts + box(**UTM)))).items
    assert (model.height, model.levels, model.name) == (None, None, None)
    feet = "<bldg:measuredHeight uom='ft'>20</bldg:measuredHeight>"
    assert read_citygml(write(tmp_path, building(feet + box(**UTM)))).items[0].height is None


def test_prefixes_without_a_namespace_are_overlooked(tmp_path: Path) -> None:
    models = read_citygml(write(tmp_path, building("<energy:isHeated>1</energy:isHeated>" + box(**UTM))))
    assert areas(models.items[0]) == pytest.approx(WHOLE)


def test_zipped_files(tmp_path: Path) -> None:
    plain = write(tmp_path, building(box(**UTM)))
    zipped = tmp_path / "city.gml.gz"
    zipped.write_bytes(gzip.compress(plain.read_bytes()))
    assert areas(read_citygml(zipped).items[0]) == pytest.approx(WHOLE)
    zipped.write_bytes(zipped.read_bytes()[:-40])
    with pytest.raises(InputError, match=r"city\.gml\.gz"):
        read_citygml(zipped)


def test_truncated_file_names_the_line(tmp_path: Path) -> None:
    path = write(tmp_path, building(box(**UTM)), building("\n" + box(**UTM), "c"))
    path.write_text(path.read_text()[:-400])
    with pytest.raises(InputError, match=r"city\.gml is no well-formed XML \(line 2: "):
        read_citygml(path)


@pytest.mark.parametrize(
    "text", ["", "just text", "<html><body/></html>", "<kml xmlns='http://www.opengis.net/kml/2.2'/>", "\0\1\2"]
)
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "no.gml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"no\.gml") as caught:
        read_citygml(path)
    assert "\n" not in str(caught.value)


def test_absent_file_and_level_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.gml"):
        read_citygml(tmp_path / "none.gml")
    with pytest.raises(InputError, match="LoD 'high'"):
        read_citygml(write(tmp_path, building(box())), "high")


def test_city_without_buildings(tmp_path: Path) -> None:
    models = read_citygml(write(tmp_path))
    assert (models.crs, models.items, models.faults) == ("EPSG:25832", (), ())


@pytest.mark.parametrize("use", ['<gml:name x="&x9;"/>', "<gml:name>&x9;</gml:name>", ""])
def test_entities_are_refused(tmp_path: Path, use: str) -> None:
    entities = '<!ENTITY x0 "ha">' + "".join(f'<!ENTITY x{n} "{f"&x{n - 1};" * 10}">' for n in range(1, 10))
    path = write(tmp_path, use, building(box(**UTM)), prolog=f"<!DOCTYPE a [{entities}]>")
    with pytest.raises(InputError, match=r"city\.gml"):
        read_citygml(path)


def test_files_are_not_drawn_in(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    prolog = f'<!DOCTYPE a [<!ENTITY x SYSTEM "{(tmp_path / "secret").as_uri()}">]>'
    with pytest.raises(InputError, match="DTD"):
        read_citygml(write(tmp_path, building("<gml:name>&x;</gml:name>" + box(**UTM)), prolog=prolog))


# ---- real files
def test_plateau_with_its_photo_textures(data: Path) -> None:
    folder = data / "city" / "plateau_textured"
    models = read_citygml(folder / "53392642_bldg_6697_op2.gml")
    assert models.crs == "EPSG:6697"
    assert len(models.items) == 8
    assert (models.remarks, models.faults) == ((), ())
    assert sorted(texture.name for texture in models.textures)[:2] == ["hnap0034.png", "hnap0275.jpg"]
    assert len(models.textures) == 8
    for model in models.items:
        low, high = model.shell.vertices.min(axis=0), model.shell.vertices.max(axis=0)
        assert (low[:2] > [139.7745, 35.538]).all()
        assert (high[:2] < [139.7795, 35.542]).all()
        assert volume(model) > 0
        bare = model.shell.texture < 0
        assert {SEMANTICS[index] for index in model.shell.semantic[bare]} == {"ground"}
        assert model.shell.uv.min() >= -0.001
        assert model.shell.uv.max() <= 1.001


def test_plateau_photos_are_not_mirrored(data: Path) -> None:
    """Seen from outside, texture coordinates turn as the corners do: with v down they would turn the other way."""
    for model in read_citygml(data / "city" / "plateau_textured" / "53392642_bldg_6697_op2.gml").items:
        uv = model.shell.uv[model.shell.texture >= 0].astype(float)
        (u1, v1), (u2, v2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
        area = u1 * v2 - u2 * v1
        assert area[area > 0].sum() > 0.98 * np.abs(area).sum()


def test_plateau_file_that_is_no_xml(data: Path) -> None:
    with pytest.raises(InputError, match="TestCaseOfInvalidFileNameGml"):
        read_citygml(data / "city" / "plateau_textured" / "TestCaseOfInvalidFileNameGml.gml")


def test_ingolstadt_samples(data: Path) -> None:
    for name, height in {"0000000": 8.813, "4018142": 12.389, "4018213": 22.749}.items():
        models = read_citygml(data / "city" / "ingolstadt" / "citygml_samples" / f"{name}.xml")
        assert (models.crs, models.faults) == ("EPSG:32632", ())
        (model,) = models.items
        assert (model.id, model.height) == (name, height)
        assert np.ptp(model.shell.vertices[:, 2]) == pytest.approx(height, abs=0.02)
        assert {"wall", "roof", "ground"} == set(counts(model))


def part(inner: str) -> str:
    return f"<bldg:consistsOfBuildingPart><bldg:BuildingPart>{inner}</bldg:BuildingPart></bldg:consistsOfBuildingPart>"


def hull(x: float, y: float, width: float = 1.0) -> str:
    """The box as a solid without semantics, so many times as wide."""
    faces = [
        [" ".join((str(float(c.split()[0]) * width), *c.split()[1:])) for c in corners] for corners in BOX.values()
    ]
    return solid(2, *(polygon(moved(corners, x, y, 400.0)) for corners in faces))


def test_a_solid_around_its_parts_is_not_added_to_them(tmp_path: Path) -> None:
    x, y = UTM["x"], UTM["y"]
    parts = part(box(**UTM)) + part(box(**{**UTM, "x": x + 10}))
    [model] = read_citygml(write(tmp_path, building(hull(x, y, 2.0) + parts))).items
    assert areas(model)["roof"] == pytest.approx(160.0)
    assert "unknown" not in areas(model)


def test_a_main_body_keeps_its_annex(tmp_path: Path) -> None:
    x, y = UTM["x"], UTM["y"]
    inner = hull(x, y) + part(box(**{**UTM, "x": x + 11}))
    [model] = read_citygml(write(tmp_path, building(inner))).items
    assert volume(model) == pytest.approx(2 * 480.0)
