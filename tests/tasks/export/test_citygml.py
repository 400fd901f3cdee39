"""CityGML: an export fits the schemas, and is read back as the buildings, openings and textures that it is of."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from catalogs.readers.citygml.buildings import read_citygml
from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock

Run = tuple[Path, dict[str, Any]]


@pytest.fixture(scope="module")
def path(undisturbed: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(str(export_run(undisturbed[0], "citygml", tmp_path_factory.mktemp("export") / "gml").files[0]))


def test_it_fits_the_schemas_of_citygml_2_and_they_do_check(path: Path, tmp_path: Path) -> None:
    schema = pytest.importorskip("citysmith.schema", reason="citysmith is not there, which brings the schemas")
    report = schema.validate_schema(str(path))
    assert report.checked
    assert (report.valid, report.messages) == (True, [])
    wrong = tmp_path / "wrong.gml"
    wrong.write_bytes(path.read_bytes().replace(b"measuredHeight", b"measuredHeigth"))
    assert not schema.validate_schema(str(wrong)).valid


def test_every_reference_leads_to_one_id(path: Path) -> None:
    tree = etree.parse(path)
    ids = Counter(tree.xpath("//@*[local-name()='id' and namespace-uri()='http://www.opengis.net/gml']"))
    assert set(ids.values()) == {1}
    led = {one.removeprefix("#") for one in tree.xpath("//@*[local-name()='href'] | //@uri | //@ring")}
    assert led <= ids.keys()
    assert tree.xpath("//*[local-name()='TriangulatedSurface']")
    for image in {one.text for one in tree.iterfind(".//{*}imageURI")}:
        assert (path.parent / image).is_file()


def test_it_is_read_back_where_it_was(found: PublishedBlock, path: Path) -> None:
    again = read_citygml(path)
    assert not again.faults
    assert not again.remarks
    assert again.crs == found.crs
    assert {model.id for model in again.items} == {found.names[b] for b in found.select_buildings(()).tolist()}
    assert again.textures
    mesh, charts = found.plan.scene.mesh, found.plan.scene.charts
    number = {name: index for index, name in found.names.items()}
    for model in again.items:
        corners = mesh.vertices[mesh.triangles[charts.building[mesh.chart] == number[model.id]].ravel()]
        assert (model.shell.vertices.min(axis=0) < corners.min(axis=0) + 0.02).all()
        assert (model.shell.vertices.max(axis=0) > corners.max(axis=0) - 0.02).all()
        assert abs(model.shell.vertices[:, 2].max() - corners[:, 2].max()) < 0.02
        assert model.height is not None


def test_it_says_what_the_city_json_of_lod3_says(
    found: PublishedBlock, undisturbed: Run, path: Path, tmp_path: Path
) -> None:
    city = json.loads(export_run(undisturbed[0], "lod3", tmp_path / "lod3").files[0].read_text())
    buildings = {one.get("{http://www.opengis.net/gml}id"): one for one in etree.parse(path).iterfind(".//{*}Building")}
    theirs = {id: one for id, one in city["CityObjects"].items() if one["type"] == "Building"}
    assert buildings.keys() == theirs.keys()
    for id, building in buildings.items():
        said = theirs[id]["attributes"]
        assert float(building.findtext("{*}measuredHeight")) == said["measuredHeight"]
        stated = {one.get("name"): one.findtext("{*}value") for one in building if one.tag.endswith("Attribute")}
        assert stated["heightSource"] == said["heightSource"]
        assert int(stated["windows"]) == said["windows"]
        (geometry,) = theirs[id]["geometry"]
        kinds = Counter(surface["type"] for surface in geometry["semantics"]["surfaces"])
        mine = {kind: len(building.findall(f".//{{*}}{kind}")) for kind in ("Window", "Door")}
        assert mine == {kind: kinds[kind] for kind in mine}
        faces = geometry["boundaries"][0] if geometry["type"] == "Solid" else geometry["boundaries"]
        own = [one for one in building.iterfind(".//{*}Polygon") if not _stands_out(one)]
        assert len(own) == len(faces)
        shell = building.findall("{*}lod3Solid//{*}surfaceMember") + building.findall("{*}lod2Solid//{*}surfaceMember")
        assert len(shell) == (len(faces) if geometry["type"] == "Solid" else 0)
        assert len(building.findall("{*}outerBuildingInstallation")) == len(theirs[id].get("children", ()))


def _stands_out(polygon: Any) -> bool:
    return next(polygon.iterancestors("{*}BuildingInstallation"), None) is not None


def test_textures_lie_on_every_corner_of_a_ring(path: Path) -> None:
    tree = etree.parse(path)
    corners = {
        ring.get("{http://www.opengis.net/gml}id"): len(ring.findtext("{*}posList").split()) // 3
        for ring in tree.iterfind(".//{*}LinearRing")
    }
    lists = list(tree.iterfind(".//{*}textureCoordinates"))
    assert len(lists) > 0.5 * len(corners)
    for one in lists:
        places = np.array(one.text.split(), float).reshape(-1, 2)
        assert len(places) == corners[one.get("ring").removeprefix("#")]
        assert places.min() >= 0
        assert places.max() <= 1
