"""Block files: what a good one gives, what each fault says, and when the digest changes."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from pathlib import Path

import geopandas
import pytest
import shapely
from distributed.protocol import deserialize, serialize
from PIL import Image

from catalogs.block.reader import Block, TextureSettings, read_block
from facade_core.core.errors import BlockFileError

Read = Callable[..., Block]


@pytest.mark.long
def test_a_block_in_full(read: Read, folder: Path) -> None:
    block = read("texture: {texels_per_metre: 25}\nseed: 7")
    assert block.crs.to_string() == "EPSG:32635"
    assert block.notes[0] == (
        "CRS of the block: EPSG:32635 (WGS 84 / UTM zone 35N), as the buildings lie at longitude 24.9435, latitude 60.1670"
    )
    assert len(block.buildings) == 79  # 64 outlines, some of which their parts replace
    assert block.shops
    assert all(300_000 < x < 500_000 and 6_600_000 < y < 6_700_000 for x, y in (*block.shops, *block.entrances))
    assert block.entrances
    assert {"Mikonkatu", "Kalevankatu", "Mannerheimintie"} <= {s.name for s in block.streets}
    assert block.exemplars == (folder / "facades" / "0.png", folder / "facades" / "1.png")
    assert block.texture == TextureSettings(texels_per_metre=25.0)
    assert (block.seed, block.storey, block.photos, block.geoid_separation) == (7, 3.2, {}, None)
    assert deserialize(*serialize(block)) == block, "it travels to workers"
    with pytest.raises(FrozenInstanceError):
        block.seed = 8  # type: ignore[misc]


def test_notes_speak_of_the_area_only(read: Read) -> None:
    assert "roofs without walls set aside: 1 (w580268890)" in read().notes


@pytest.mark.long
def test_streets_by_name_photos_by_facade_and_a_named_frame(read: Read, folder: Path) -> None:
    (folder / "photos").mkdir()
    Image.new("RGB", (40, 60)).save(folder / "photos" / "w1-f2.jpg")
    block = read(
        "crs: EPSG:3879",
        streets="streets: {path: city.osm.pbf, names: [Mikonkatu]}",
        imagery="imagery: {photos: {path: photos}, exemplars: {path: facades}}",
    )
    assert {s.name for s in block.streets} == {"Mikonkatu"}
    assert block.photos == {"w1-f2": folder / "photos" / "w1-f2.jpg"}
    assert block.photos_rectified
    raw = read(imagery="imagery: {photos: {path: photos, rectified: false}, exemplars: {path: facades}}")
    assert not raw.photos_rectified
    assert raw.digest != read(imagery="imagery: {photos: {path: photos}, exemplars: {path: facades}}").digest
    x, y = block.buildings[0].footprint.exterior.coords[0]
    assert 25_490_000 < x < 25_500_000, "easting first, whatever axis order the CRS declares"
    assert 6_670_000 < y < 6_680_000


@pytest.mark.long
@pytest.mark.parametrize(
    ("extra", "changes", "words"),
    [
        (
            "texture: {texels_per_meter: 20}",
            {},
            "texture.texels_per_meter: unknown key; did you mean texture.texels_per_metre?",
        ),
        ("texels_per_metre: 20", {}, "did you mean texture.texels_per_metre?"),
        ("texture: {texels_per_metre: 500}", {}, "texture.texels_per_metre: 500 is not a number, 1 to 100"),
        ("texture: {texels_per_metre: '20'}", {}, "texture.texels_per_metre: '20' is not a number"),
        ("texture: {texels_per_metre: .nan}", {}, "texture.texels_per_metre: nan is not a number, 1 to 100"),
        ("texture:", {}, "texture: holds nothing where keys are expected"),
        ("texture: {walls: brick}", {}, "texture.walls: 'brick' is not `exemplar` or `translate`"),
        (
            "models: {translator: block.yaml}",
            {},
            "models.translator: unknown key; known here are parser, layout",
        ),
        ("texture: {panorama_width: 1023}", {}, "texture.panorama_width: must be even"),
        ("seed: 1.5", {}, "seed: 1.5 is not a whole number"),
        (
            "seed: 1\nseed: 2",
            {},
            'line 7, column 1: found duplicate key "seed" with value "2" (original value: "1"); keep one',
        ),
        ("storey: [", {}, "line 6"),
        ("x: !!python/object:os.system 1", {}, "is a tag, and tags are not read; leave it out"),
        ("crs: EPSG:99999", {}, "crs: 'EPSG:99999' is not a known CRS; give one such as EPSG:32635"),
        ("crs: EPSG:4326", {}, "crs: 'EPSG:4326' (WGS 84) is not projected in metres"),
        ("crs: EPSG:3857", {}, "crs: EPSG:3857 (WGS 84 / Pseudo-Mercator) does not measure metres"),
        (
            "crs: EPSG:28992",
            {},
            "(Amersfoort / RD New) does not cover 24.9435, 60.1670; give e.g. EPSG:32635, or leave crs out",
        ),
        ("", {"name": ""}, "name: missing; write name: my-block"),
        (
            "",
            {"name": "name: a/b"},
            "name: use letters, digits, '.', '_' and '-' only, 80 at most, such as a-b, got 'a/b'",
        ),
        ("", {"buildings": "buildings: city.osm.pbf"}, "write buildings: {path: city.osm.pbf}"),
        (
            "",
            {"buildings": "buildings: {path: city.osm.pfb}"},
            "city.osm.pfb does not exist; did you mean city.osm.pbf?",
        ),
        (
            "",
            {"buildings": "buildings: {path: block.yaml}"},
            "block.yaml: files of type .yaml are not read; supported: .fgb",
        ),
        ("", {"buildings": "buildings: {path: facades}"}, "facades is a folder; name a file in it"),
        ("", {"buildings": ""}, "buildings: missing; write buildings: {path: FILE}"),
        ("", {"streets": "streets: {path: city.osm.pbf, names: [Mikkonkatu]}"}, "did you mean Mikonkatu?"),
        (
            "",
            {"area": "area: [1841780, 5173080, 1841800, 5173100]"},
            "area: must be [west, south, east, north] in degrees of longitude and latitude, not in metres, got",
        ),
        ("", {"area": "area: [24.947, 60.165, 24.940, 60.169]"}, "area: must be [west, south, east, north]"),
        (
            "",
            {"area": "area: [24.947, 60.165, 24.940, 60.169]"},
            "west and east, or south and north, are changed about",
        ),
        (
            "",
            {"area": "area: [60.165, 24.940, 60.169, 24.947]"},
            "latitudes come first there: write [24.94, 60.165, 24.947",
        ),
        (
            "cut: {metres: 400}",
            {},
            "cut: is a key of a city, and this is to be one block; run it with `streetloom city`",
        ),
        (
            "",
            {"area": "area: [24, 60, 25]"},
            "area: [24, 60, 25]: List should have at least 4 items after validation, not 3; write a list of 4 numbers",
        ),
        (
            "",
            {"area": "area: [4.0, 52.0, 4.1, 52.1]"},
            "has no buildings inside area [4.0, 52.0, 4.1, 52.1]; they span [24.9",
        ),
        (
            "",
            {"streets": "streets: {path: city.osm.pbf, names: [Unioninkatu]}"},
            "no streets of these names inside area",
        ),
        ("", {"imagery": ""}, "imagery.exemplars: missing, but texture.walls is exemplar"),
        ("", {"imagery": "imagery: {exemplars: {path: .}}"}, "holds no pictures; did you mean"),
        ("", {"imagery": "imagery: {panoramas: {path: p}}"}, "imagery.panoramas.path: "),
        ("terrain: {path: city.osm.pbf}", {}, "terrain.path: "),
        ("", {"buildings": "buildings: {path: '${NOT_SET_ANYWHERE}/b.pbf'}"}, "NOT_SET_ANYWHERE is not set"),
        ("", {"buildings": "buildings: {path: [city.osm.pbf, gone.json]}"}, "gone.json does not exist"),
        ("", {"buildings": "buildings: {path: []}"}, "buildings.path"),
        (
            "",
            {"buildings": "buildings: {path: city.osm.pbf, crs: EPSG:1}"},
            "buildings.crs: 'EPSG:1' is not a known CRS",
        ),
    ],
)
def test_each_fault_is_one_line_naming_file_key_and_remedy(
    read: Read, folder: Path, extra: str, changes: dict[str, str], words: str
) -> None:
    with pytest.raises(BlockFileError) as error:
        read(extra, **changes)
    message = str(error.value)
    assert message.startswith(f"{folder / 'block.yaml'}: ")
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("city.osm.pbf", b"not a pbf" * 99, "city.osm.pbf is not an OSM .pbf file"),
        ("city.osm.pbf", None, "city.osm.pbf cannot be read as OSM .pbf"),
    ],
)
def test_broken_files_are_named(read: Read, folder: Path, name: str, content: bytes | None, words: str) -> None:
    path = folder / name
    path.write_bytes(path.read_bytes()[:300_000] if content is None else content)
    with pytest.raises(BlockFileError, match=r"block.yaml: ") as error:
        read()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such block file"),
        (b"", "holds no keys"),
        (b"\xff\xfe\x00", "is not UTF-8"),
        (b"- 1", "holds no keys"),
    ],
)
def test_no_block_file_at_all(tmp_path: Path, content: bytes | None, words: str) -> None:
    path = tmp_path / "block.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BlockFileError, match=words):
        read_block(path)


def test_two_photos_of_one_facade(read: Read, folder: Path) -> None:
    (folder / "photos").mkdir()
    for name in ("f1.jpg", "f1.png"):
        Image.new("RGB", (4, 4)).save(folder / "photos" / name)
    with pytest.raises(BlockFileError, match="both name facade f1; remove one"):
        read(imagery="imagery: {exemplars: {path: facades}, photos: {path: photos}}")


@pytest.mark.long
def test_the_digest_is_of_content_not_of_places(
    read: Read, folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    digest = read().digest
    moved = tmp_path_factory.mktemp("elsewhere") / "deep"
    shutil.copytree(folder, moved)
    (moved / "city.osm.pbf").rename(moved / "renamed.osm.pbf")
    text = (moved / "block.yaml").read_text().replace("city.osm.pbf", "renamed.osm.pbf")
    (moved / "block.yaml").write_text("# a remark\n" + text)
    os.utime(moved / "facades" / "0.png", (1, 1))
    assert read_block(moved / "block.yaml").digest == digest
    assert read("texture: {texels_per_metre: 32}\nseed: 0").digest == digest, "a default written out changes nothing"


@pytest.mark.long
def test_the_digest_changes_with_every_byte_and_setting(read: Read, folder: Path) -> None:
    digests = [read().digest, read("seed: 1").digest, read("texture: {viewpoint_spacing: 4}").digest]
    digests += [read("crs: EPSG:3879").digest, read(area="area: [24.940, 60.165, 24.946, 60.169]").digest]
    digests.append(read(streets="streets: {path: city.osm.pbf, names: [Mikonkatu]}").digest)
    picture = folder / "facades" / "1.png"
    picture.write_bytes(picture.read_bytes() + b"\0")
    digests.append(read().digest)
    picture.rename(folder / "facades" / "2.png")
    digests.append(read().digest)
    assert len(set(digests)) == len(digests)


def test_a_folder_inside_a_harvested_one_is_answered_with_that(read: Read, tmp_path: Path) -> None:
    (tmp_path / "style" / "harvest" / "candidates").mkdir(parents=True)
    Image.new("RGB", (64, 64)).save(tmp_path / "style" / "facade.png")
    said = rf"holds no pictures; did you mean {re.escape(str(tmp_path / 'style'))}\?"
    with pytest.raises(BlockFileError, match=said):
        read(imagery=f"imagery: {{exemplars: {{path: {tmp_path / 'style' / 'harvest'}}}}}")


def test_a_block_with_real_exemplars(read: Read, data: Path) -> None:
    folder = data / "facades" / "ecp"
    with pytest.raises(BlockFileError, match=r"holds no pictures; did you mean .*images\?"):
        read(imagery=f"imagery: {{exemplars: {{path: {folder}}}}}")
    assert len(read(imagery=f"imagery: {{exemplars: {{path: {folder / 'images'}}}}}").exemplars) == 83


def test_swapped_degrees_are_named_where_the_frame_is_given(folder: Path) -> None:
    swapped = shapely.box(42.6977, 23.3219, 42.6979, 23.3221)
    geopandas.GeoDataFrame({"height": [9.0]}, geometry=[swapped], crs="EPSG:4326").to_file(folder / "a.geojson")
    (folder / "block.yaml").write_text(
        "name: a\ncrs: EPSG:32634\nbuildings: {path: a.geojson}\nimagery: {exemplars: {path: facades}}"
    )
    with pytest.raises(BlockFileError, match="longitude and latitude look swapped"):
        read_block(folder / "block.yaml")


def test_a_file_without_a_frame_is_named(folder: Path) -> None:
    (folder / "a.obj").write_text("v 0 0 0\nv 9 0 0\nv 9 8 0\nv 0 0 9\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    lines = "name: a\ncrs: EPSG:3067\nbuildings: {path: a.obj, offset: [386000, 6672000, 0]%s}\n"
    lines += "imagery: {exemplars: {path: facades}}"
    for given, count in (("", 1), (", crs: EPSG:3067", 0)):
        (folder / "block.yaml").write_text(lines % given)
        notes = read_block(folder / "block.yaml").notes
        assert sum("state no frame" in note for note in notes) == count


@pytest.mark.parametrize(("given", "count"), [("EPSG:3067", 0), ("EPSG:25835", 0), ("EPSG:32633", 1)])
def test_a_frame_that_overrules_the_one_a_file_states_is_noted(given: str, count: int, folder: Path) -> None:
    """No note where both name the same coordinates, as of two systems for one zone."""
    house = shapely.box(386_000, 6_672_000, 386_010, 6_672_010)
    geopandas.GeoDataFrame({"height": [9.0]}, geometry=[house], crs="EPSG:3067").to_file(folder / "a.gpkg")
    text = f"name: a\nbuildings: {{path: a.gpkg, crs: {given}}}\nimagery: {{exemplars: {{path: facades}}}}"
    (folder / "b.yaml").write_text(text)
    found = [note for note in read_block(folder / "b.yaml").notes if "files that state EPSG:3067" in note]
    assert len(found) == count
    assert all("a.gpkg" in note and "buildings.crs" in note for note in found)
