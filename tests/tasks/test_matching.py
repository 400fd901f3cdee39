"""`streetloom match`: a folder of photos to a block's, through a table that a person mends."""

from __future__ import annotations

import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from PIL import Image
from pyproj import Transformer

from benchmarks.matching import SIZE, WIDE_DEG, photo_of
from benchmarks.painter.street_truth import SyntheticStreet, synthetic_street
from catalogs.block.corrections import lock_input_folder
from catalogs.block.reader import read_block
from facade_core.core.errors import InputError
from facade_core.core.types import Pose
from flows.cli.commands import command_line
from tasks.city.blocks import partition_city_file
from tasks.matching.match_table import (
    COLUMNS,
    MatchDecision,
    MatchTable,
    apply_decisions,
    format_match_row,
    read_match_table,
    write_match_table,
)
from tasks.matching.photo_import import import_photos, plan_photo_import
from tests.pipeline.stages import EAST, NORTH, write_block

LONLAT = Transformer.from_crs("EPSG:32635", "EPSG:4326", always_xy=True)


@pytest.fixture(scope="module")
def painted() -> tuple[SyntheticStreet, np.ndarray, np.ndarray, float]:
    """A street, a photo of its first house, where it was taken and whither."""
    street = synthetic_street(4, seed=2, occluders=0, texels_per_metre=14.0)
    return street, *photo_of(street, street.charts[0], np.random.default_rng(0))


@pytest.fixture
def block_file(painted: tuple[SyntheticStreet, np.ndarray, np.ndarray, float], tmp_path: Path) -> Path:
    """Two houses side by side with the fronts of a painted street, and a folder of photos: of the first by EXIF, one of another
    place, one that tells none."""
    street, photo, place, heading = painted
    charts = street.scene.charts
    (w0, h0), (w1, h1) = (charts.size[chart] for chart in street.charts[:2])
    normal, along = charts.normals()[street.charts[0]], charts.axis_u[street.charts[0]]
    from_corner = np.append(place, 0.0) - charts.origin[street.charts[0]]
    right, before = float(from_corner @ along), float(from_corner @ normal)
    turned = (heading - float(np.degrees(np.arctan2(-normal[0], -normal[1])))) % 360
    # the fronts look south, the first house at the left, as seen from the street
    path = write_block(
        tmp_path / "in",
        buildings={"a": (4, 9, float(w0), 2.8, float(h0)), "b": (4 + float(w0), 9, float(w1), 2.8, float(h1))},
        streets={"1": [(0, 0), (60, 0)]},
    )
    photos = tmp_path / "photos"
    photos.mkdir()
    lon, lat = LONLAT.transform(EAST + 4 + right, NORTH + 9 - before)
    exif = Image.Exif()
    gps = {1: "N", 2: _dms(lat), 3: "E", 4: _dms(lon), 16: "T", 17: turned}
    exif[0x8825] = gps
    exif[0x8769] = {0xA405: round(43.27 / 2 / np.tan(np.radians(WIDE_DEG / 2)) / np.hypot(*SIZE) * SIZE[1])}
    Image.fromarray(photo).save(photos / "IMG_1.jpg", quality=92, exif=exif)
    gps[2] = _dms(lat + 0.02)
    exif[0x8825] = gps
    Image.fromarray(photo).save(photos / "far.jpg", exif=exif)
    Image.fromarray(photo).save(photos / "silent.jpg")
    return path


def _dms(degrees: float) -> tuple[float, float, float]:
    minutes = (degrees - int(degrees)) * 60
    return float(int(degrees)), float(int(minutes)), (minutes - int(minutes)) * 60


def test_a_photo_comes_to_its_wall(block_file: Path) -> None:
    photos, table = block_file.parent.parent / "photos", block_file.parent / "matches.csv"
    ended = CliRunner().invoke(command_line, ["match", str(block_file), str(photos)])
    assert ended.exit_code == 0, ended.output
    assert "silent.jpg: no place\n" in ended.output
    assert ended.output.count("give their places with --poses FILE.csv") == 1
    with table.open(newline="") as file:
        rows = {row["photo"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"IMG_1.jpg", "far.jpg"}
    assert rows["far.jpg"]["facade"] == rows["far.jpg"]["candidates"] == ""
    facade = rows["IMG_1.jpg"]["facade"]
    assert facade.startswith("a")
    refused = CliRunner().invoke(command_line, ["match", str(block_file), str(photos)])
    assert refused.exit_code != 0
    assert "is there and may have been mended" in refused.output
    # as a spreadsheet saves it
    table.write_text(table.read_text().replace(",", ";"))
    taken = CliRunner().invoke(command_line, ["match", str(block_file), str(photos), "--take", str(table)])
    assert taken.exit_code == 0, taken.output
    block = read_block(block_file)
    assert block.photos == {facade: block_file.parent / "photos" / f"{facade}.jpg"}
    assert not block.photos_rectified
    assert block.photos[facade].read_bytes() == (photos / "IMG_1.jpg").read_bytes()
    again = plan_photo_import(block_file, photos, read_match_table(table))
    assert (again.count, again.copies, again.removals) == (1, {}, ()), "again is the same"
    assert import_photos(again) is None
    assert len(list((block_file.parent / "photos").iterdir())) == 1


def test_notes_on_the_poses_file_are_printed(block_file: Path) -> None:
    photos, poses = block_file.parent.parent / "photos", block_file.parent / "poses.csv"
    lon, lat = LONLAT.transform(EAST + 10, NORTH)
    poses.write_text(f"file,lon,lat,yaw,altitude\nIMG_1.jpg,{lon},{lat},0.5,17\nsilent.jpg,{lon},{lat},1.5,17\n")
    ended = CliRunner().invoke(command_line, ["match", str(block_file), str(photos), "--poses", str(poses)])
    assert ended.exit_code == 0, ended.output
    assert "altitude" in ended.output
    assert "fields of poses.csv with numbers that are not used" in ended.output


def test_photos_that_a_poses_file_lacks_are_to_be_added_to_it(block_file: Path) -> None:
    photos, poses = block_file.parent.parent / "photos", block_file.parent / "poses.csv"
    lon, lat = LONLAT.transform(EAST + 10, NORTH)
    poses.write_text(f"file,lon,lat,heading\nIMG_1.jpg,{lon},{lat},0\n")
    ended = CliRunner().invoke(command_line, ["match", str(block_file), str(photos), "--poses", str(poses)])
    assert ended.exit_code == 0, ended.output
    assert f"photos without a position: add a line for each to {poses}" in ended.output
    assert "--poses FILE" not in ended.output


def test_photos_of_which_none_can_be_matched_have_a_remedy_that_is_not_their_places(block_file: Path) -> None:
    photos, poses = block_file.parent.parent / "photos", block_file.parent / "poses.csv"
    for name in ("far.jpg", "silent.jpg"):
        (photos / name).unlink()
    poses.write_text("file,lon,lat\nIMG_1.jpg,,60\n")
    ended = CliRunner().invoke(command_line, ["match", str(block_file), str(photos), "--poses", str(poses)])
    assert ended.exit_code == 2
    assert "IMG_1.jpg: " in ended.output
    assert "none of its photos can be matched, for the reasons above" in ended.output
    assert "--poses" not in ended.output.splitlines()[-1]


def test_photos_without_any_place_are_told_before_the_block_is_read(tmp_path: Path) -> None:
    for name in ("one.jpg", "two.jpg"):
        Image.new("RGB", (64, 64)).save(tmp_path / name)
    (tmp_path / "block.yaml").write_text("no block")
    ended = CliRunner().invoke(command_line, ["match", str(tmp_path / "block.yaml"), str(tmp_path)])
    assert ended.exit_code == 2
    (line,) = ended.output.splitlines()
    assert "none of its 2 photos says where it was taken; give their places with --poses" in line


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("IMG_9.jpg,{a},1,", "line 2: there is no photo 'IMG_9.jpg'"),
        ("../IMG_1.jpg,{a},1,", "line 2: there is no photo"),
        ("IMG_1.jpg,nobody,1,", "line 2: the block has no facade 'nobody'"),
        ("IMG_1.jpg,{a},1,\nfar.jpg,{a},1,", "line 3: IMG_1.jpg shows"),
    ],
)
def test_a_table_that_names_what_is_not_there_takes_nothing(block_file: Path, rows: str, said: str) -> None:
    from tasks.stages.ingest.planning import make_plan

    facade = make_plan(read_block(block_file)).facades.id[0]
    table = block_file.parent / "mended.csv"
    table.write_text("photo,facade,probability,candidates\n" + rows.format(a=facade) + "\n")
    with pytest.raises(InputError, match=said):
        plan_photo_import(block_file, block_file.parent.parent / "photos", read_match_table(table))
    assert not (block_file.parent / "photos").exists()


def test_rows_that_nobody_asked_for_are_told_and_others_taken(block_file: Path) -> None:
    photos, path = block_file.parent.parent / "photos", block_file.parent / "matches.csv"
    path.write_text("photo,facade\nIMG_1.jpg,a-0\nfar.jpg,nobody\ngone.jpg,b-0\nfar.jpg,a-1\nsilent.jpg,a-1\n")
    done = plan_photo_import(block_file, photos, read_match_table(path), {"IMG_1.jpg"})
    assert (done.count, list(done.copies)) == (1, ["a-0"])
    for said, fault in zip(
        ("no facade 'nobody'", "no photo 'gone.jpg'", "far.jpg shows a-1"), done.faults, strict=True
    ):
        assert said in fault
    with pytest.raises(InputError, match=r"far\.jpg shows a-1 already"):
        plan_photo_import(block_file, photos, read_match_table(path), {"silent.jpg"})


def test_a_file_that_is_no_table_is_refused(block_file: Path) -> None:
    (wrong := block_file.parent / "wrong.csv").write_text("file,wall\nIMG_1.jpg,a\n")
    with pytest.raises(InputError, match="has no columns `photo` and `facade`"):
        read_match_table(wrong)


def test_what_is_decided_otherwise_leaves_the_block(block_file: Path) -> None:
    """A photo that was taken for one house goes to the other with the table, and a person's `none` is kept as such."""
    photos, path = block_file.parent.parent / "photos", block_file.parent / "matches.csv"
    assert CliRunner().invoke(command_line, ["match", str(block_file), str(photos)]).exit_code == 0
    table = read_match_table(path)
    first, far = sorted(table.matches(), key=lambda match: match.photo)
    assert first.candidates[0].facade == first.facade
    assert first.candidates[0].probability > 0.8
    assert "degrees off the stated heading, its roof at " in first.candidates[0].why
    assert first.place is not None
    assert first.heading is not None
    assert (far.is_decided, far.candidates) == (False, ())
    import_photos(plan_photo_import(block_file, photos, table))
    other = next(f"b-{n}" for n in range(4) if f"b-{n}" != first.facade)
    none = MatchDecision("far.jpg", "", True, ("", ""))
    table = apply_decisions(table, [MatchDecision("IMG_1.jpg", other, True, (first.facade, "")), none], who="anna")
    write_match_table(table)
    assert read_match_table(path) == table
    assert {match.photo: (match.facade, match.decided_by) for match in read_match_table(path).matches()} == {
        "IMG_1.jpg": (other, "anna"),
        "far.jpg": ("", "anna"),
    }
    import_photos(plan_photo_import(block_file, photos, table))
    assert [file.name for file in (block_file.parent / "photos").iterdir()] == [f"{other}.jpg"]
    assert list(read_block(block_file).photos) == [other]
    with pytest.raises(InputError, match="meanwhile"):
        apply_decisions(table, [none], who="ben")
    with pytest.raises(InputError, match=r"has no photo 'IMG_7\.jpg' any more"):
        apply_decisions(table, [MatchDecision("IMG_7.jpg", "", True, ("", ""))], who="ben")
    nothing = apply_decisions(table, [MatchDecision("IMG_1.jpg", "", True, (other, "anna"))], who="ben")
    with pytest.raises(InputError, match=r"no photo would be left; remove imagery\.photos"):
        plan_photo_import(block_file, photos, nothing)


def test_a_photo_that_somebody_named_by_hand_stays(block_file: Path) -> None:
    """What the table leaves open says nothing of the block's photos."""
    photos, path = block_file.parent.parent / "photos", block_file.parent / "matches.csv"
    path.write_text("photo,facade\nIMG_1.jpg,a-0\n")
    import_photos(plan_photo_import(block_file, photos, read_match_table(path)))
    path.write_text("photo,facade,candidates\nIMG_1.jpg,,a-0 0.5; b-0 0.4\n")
    table = read_match_table(path)
    assert [(one.facade, one.probability) for one in table.matches()[0].candidates] == [("a-0", 0.5), ("b-0", 0.4)]
    assert plan_photo_import(block_file, photos, table).removals == ()


def test_photos_that_are_nobodys_copies_stay(block_file: Path) -> None:
    """Neither a photo that lies where a copy would go, nor the block's own where that folder itself was matched."""
    photos, path, own = (
        block_file.parent.parent / "photos",
        block_file.parent / "matches.csv",
        block_file.parent / "photos",
    )
    path.write_text("photo,facade,by\nIMG_1.jpg,a-0,\n")
    own.mkdir()
    (own / "a-0.jpg").write_bytes((photos / "silent.jpg").read_bytes())  # the block's file names none
    with pytest.raises(InputError, match=r"a-0\.jpg is there and is another photo"):
        plan_photo_import(block_file, photos, read_match_table(path))
    assert (own / "a-0.jpg").read_bytes() == (photos / "silent.jpg").read_bytes()
    (own / "a-0.jpg").unlink()
    import_photos(plan_photo_import(block_file, photos, read_match_table(path)))
    for facade in ("", "b-0"):
        path.write_text(f"photo,facade,by\na-0.jpg,{facade},anna\n")
        table = read_match_table(path)
        with pytest.raises(InputError, match=r"a-0\.jpg is the block's own photo, of which no copy is kept"):
            plan_photo_import(block_file, own, table)


def test_a_part_of_a_city_takes_none(block_file: Path) -> None:
    """Its photos are the city's: what its own file names would not be read."""
    keys = yaml.safe_load(block_file.read_text()) | {"name": "town", "cut": {"metres": 300}}
    (city := block_file.parent / "town.yaml").write_text(yaml.safe_dump(keys))
    part = partition_city_file(city, block_file.parent / "out").blocks[0].file
    (table := block_file.parent / "mended.csv").write_text("photo,facade\nIMG_1.jpg,a-0\n")
    with pytest.raises(InputError, match="it is a part of a city and has the photos of that"):
        plan_photo_import(part, block_file.parent.parent / "photos", read_match_table(table))


@pytest.mark.parametrize(
    ("text", "remarks"),
    [
        ("photo,facade,\n1.jpg,a-0,,blurred\n", {"remark": "blurred"}),
        ("photo,facade,,remark,\n1.jpg,a-0,so,dark,too\n", {"remark 2": "so", "remark": "dark", "remark 3": "too"}),
    ],
)
def test_a_remark_in_no_column_is_not_lost(tmp_path: Path, text: str, remarks: dict[str, str]) -> None:
    (path := tmp_path / "matches.csv").write_text(text)
    write_match_table(read_match_table(path))
    (row,) = read_match_table(path).rows
    assert remarks.items() <= row.items()
    path.write_text("photo,facade,why,why\n1.jpg,a-0,x,y\n")
    with pytest.raises(InputError, match="two columns of one name"):
        read_match_table(path)
    path.write_text("photo,facade,,\n1.jpg,a-0,,,,\n\n2.jpg\n")
    assert [(one.photo, one.facade) for one in read_match_table(path).matches()] == [("1.jpg", "a-0"), ("2.jpg", "")]


def test_who_decides_at_once_loses_nothing(tmp_path: Path) -> None:
    path, photos = tmp_path / "matches.csv", [f"{number}.jpg" for number in range(24)]
    rows = tuple(format_match_row(photo, None, [], Pose(0, 0, 0, 0), has_heading=False) for photo in photos)
    write_match_table(MatchTable(path, COLUMNS, rows), new=True)

    def decide(photo: str) -> None:
        with lock_input_folder(path.parent):
            write_match_table(
                apply_decisions(read_match_table(path), [MatchDecision(photo, "a-0", True, ("", ""))], who="anna")
            )

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(decide, photos))
    assert all(match.facade == "a-0" for match in read_match_table(path).matches())
    with pytest.raises(InputError, match="was written meanwhile"):
        write_match_table(MatchTable(path, COLUMNS, ()), new=True)
    assert [one.name for one in tmp_path.iterdir()] == ["matches.csv"]
    assert len(read_match_table(path).rows) == 24


@pytest.mark.parametrize("name", ["=1+1.jpg", "+a.jpg", "-a.jpg", "@a.jpg", "'=a.jpg", "''-a.jpg", "'a.jpg", "a=1.jpg"])
def test_no_cell_of_the_table_is_a_formula(name: str, tmp_path: Path) -> None:
    row = format_match_row(name, "=facade", [], Pose(-5.0, 6.0, None, 0.0), has_heading=False)
    write_match_table(MatchTable(tmp_path / "matches.csv", COLUMNS, (row,)))
    with (tmp_path / "matches.csv").open(newline="") as file:
        (cells,) = csv.DictReader(file)
    assert all(not cells[column].startswith(("=", "+", "-", "@")) for column in ("photo", "facade"))
    assert cells["x"] == "-5.00"
    table = read_match_table(tmp_path / "matches.csv")
    assert table.rows == (row,)
    write_match_table(table)
    assert read_match_table(tmp_path / "matches.csv").rows == (row,)


def test_a_table_of_before_keeps_its_names(tmp_path: Path) -> None:
    (tmp_path / "matches.csv").write_text("photo,facade\n=a.jpg,'b\n")
    (row,) = read_match_table(tmp_path / "matches.csv").rows
    assert (row["photo"], row["facade"]) == ("=a.jpg", "'b")
