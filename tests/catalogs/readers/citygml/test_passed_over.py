"""Materials, and what CityGML states that is not read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from PIL import Image

from catalogs.readers.citygml.buildings import UNMATCHED_TEXTURES_REASON, read_citygml

NAMESPACES = (
    'xmlns="http://www.opengis.net/citygml/2.0" xmlns:bldg="http://www.opengis.net/citygml/building/2.0" '
    'xmlns:gml="http://www.opengis.net/gml" xmlns:app="http://www.opengis.net/citygml/appearance/2.0"'
)
PLAN = ((0, 0), (14, 0), (14, 9), (0, 9))


def surface(kind: str, id: str, corners: Sequence[tuple[float, ...]], more: str = "") -> str:
    text = " ".join(str(value) for corner in (*corners, corners[0]) for value in corner)
    return (
        f'<bldg:boundedBy><bldg:{kind} gml:id="s-{id}"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>'
        f'<gml:Polygon gml:id="{id}"><gml:exterior><gml:LinearRing gml:id="r-{id}"><gml:posList>{text}</gml:posList>'
        "</gml:LinearRing></gml:exterior></gml:Polygon></gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface>"
        f"{more}</bldg:{kind}></bldg:boundedBy>"
    )


def write_city(path: Path, surface_data: str = "", more: str = "") -> Path:
    """Write a box of 14 x 9 x 9 m with surface data, and more in its first wall."""
    walls = []
    for i, ((a, b), (c, d)) in enumerate(zip(PLAN, (*PLAN[1:], PLAN[0]), strict=True)):
        corners = [(a, b, 10), (c, d, 10), (c, d, 19), (a, b, 19)]
        walls.append(surface("WallSurface", f"p{i}", corners, more if i == 0 else ""))
    roof = surface("RoofSurface", "p4", [(*place, 19) for place in PLAN])
    ground = surface("GroundSurface", "p5", [(*place, 10) for place in PLAN[::-1]])
    member = f"<app:appearanceMember><app:Appearance><app:theme>rgbTexture</app:theme>{surface_data}</app:Appearance>"
    path.write_text(
        f"<CityModel {NAMESPACES}>{member}</app:appearanceMember><cityObjectMember>"
        f'<bldg:Building gml:id="b">{"".join(walls)}{roof}{ground}</bldg:Building></cityObjectMember></CityModel>'
    )
    return path


def data(name: str, content: str) -> str:
    return f"<app:surfaceDataMember><app:{name}>{content}</app:{name}></app:surfaceDataMember>"


def material(colour: str, *targets: str) -> str:
    named = "".join(f"<app:target>#{target}</app:target>" for target in targets)
    return data("X3DMaterial", f"<app:diffuseColor>{colour}</app:diffuseColor>{named}")


@pytest.mark.parametrize("targets", [("p0", "p1", "p2", "p3"), ("s-p0", "s-p1", "s-p2", "s-p3")])
def test_materials_are_the_colours_of_walls_and_roof(tmp_path: Path, targets: tuple[str, ...]) -> None:
    path = write_city(tmp_path / "c.gml", material("0.9 0.1 0.1", *targets) + material("0 0 1", "p4"))
    found = read_citygml(path)
    assert (found.items[0].finish.wall_colour, found.items[0].finish.roof_colour) == ((230, 26, 26), (0, 0, 255))
    assert found.remarks == ()


def test_several_colours_are_noted(tmp_path: Path) -> None:
    found = read_citygml(write_city(tmp_path / "c.gml", material("1 0 0", "p0", "p2") + material("0 1 0", "p1")))
    assert found.items[0].finish.wall_colour == (255, 0, 0)
    assert [(one.id, one.reason) for one in found.remarks] == [
        ("b", "buildings with several colours of materials, read in that of the largest area")
    ]


@pytest.mark.parametrize("name", ["lod3ImplicitRepresentation", "lod2MultiCurve", "lod2TerrainIntersection"])
def test_geometries_that_are_not_read_are_counted(tmp_path: Path, name: str) -> None:
    opening = f"<bldg:opening><bldg:Window><bldg:{name}/></bldg:Window></bldg:opening>"
    found = read_citygml(write_city(tmp_path / "c.gml", more=opening * 2))
    assert [(one.id, one.reason) for one in found.remarks] == [
        (f"2 {name} of c.gml", "geometries of buildings that are not read")
    ]


def test_georeferenced_textures_are_counted(tmp_path: Path) -> None:
    found = read_citygml(write_city(tmp_path / "c.gml", data("GeoreferencedTexture", "<app:imageURI>a</app:imageURI>")))
    assert [one.id for one in found.remarks] == ["1 of c.gml"]
    assert found.remarks[0].reason.startswith("georeferenced textures ignored")


@pytest.mark.parametrize(
    ("mode", "most", "is_noted"), [("wrap", 3, False), ("none", 3, True), ("border", 1, False), ("mirror", 2, True)]
)
def test_pictures_that_end_inside_a_surface_are_counted(tmp_path: Path, mode: str, most: int, is_noted: bool) -> None:
    Image.new("RGB", (32, 32)).save(tmp_path / "wall.png")
    numbers = f"0 0 {most} 0 {most} {most} 0 {most} 0 0"
    content = (
        f"<app:imageURI>wall.png</app:imageURI><app:wrapMode>{mode}</app:wrapMode><app:target uri='#p0'><app:TexCoordList>"
        f"<app:textureCoordinates ring='#r-p0'>{numbers}</app:textureCoordinates></app:TexCoordList></app:target>"
    )
    found = read_citygml(write_city(tmp_path / "c.gml", data("ParameterizedTexture", content)))
    assert found.textures == (tmp_path / "wall.png",)
    assert any("wrapMode" in one.reason for one in found.remarks) == is_noted


def test_textures_of_unknown_rings_are_noted(tmp_path: Path) -> None:
    Image.new("RGB", (32, 32)).save(tmp_path / "w.png")
    for ring, reasons in (("r-p0", []), ("p0", [UNMATCHED_TEXTURES_REASON])):
        coordinates = f'<app:textureCoordinates ring="#{ring}">0 0 1 0 1 1 0 1 0 0</app:textureCoordinates>'
        target = f'<app:target uri="#p0"><app:TexCoordList>{coordinates}</app:TexCoordList></app:target>'
        texture = data("ParameterizedTexture", f"<app:imageURI>w.png</app:imageURI>{target}")
        found = read_citygml(write_city(tmp_path / "c.gml", texture))
        assert [remark.reason for remark in found.remarks] == reasons
