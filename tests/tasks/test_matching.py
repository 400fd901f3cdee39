"""`streetloom match`: a folder of photos to a block's, through a table that a person mends."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from pyproj import Transformer

from benchmarks.matching import SIZE, WIDE_DEG, photo_of
from catalogs.block import read_block
from facade_core.errors import InputError
from facade_core.synth.street_truth import SyntheticStreet, synthetic_street
from flows.cli.commands import main
from tasks.matching import take_matches
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
    normal, along = charts.normal()[street.charts[0]], charts.axis_u[street.charts[0]]
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
    ended = CliRunner().invoke(main, ["match", str(block_file), str(photos)])
    assert ended.exit_code == 0, ended.output
    assert "silent.jpg: it does not say where it was taken; name where with --poses" in ended.output
    with table.open(newline="") as file:
        rows = {row["photo"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"IMG_1.jpg", "far.jpg"}
    assert rows["far.jpg"]["facade"] == rows["far.jpg"]["candidates"] == ""
    facade = rows["IMG_1.jpg"]["facade"]
    assert facade.startswith("a")
    refused = CliRunner().invoke(main, ["match", str(block_file), str(photos)])
    assert refused.exit_code != 0
    assert "is there and may have been mended" in refused.output
    # as a spreadsheet saves it
    table.write_text(table.read_text().replace(",", ";"))
    again = CliRunner().invoke(main, ["match", str(block_file), str(photos), "--take", str(table)])
    assert again.exit_code == 0, again.output
    block = read_block(block_file)
    assert block.photos == {facade: block_file.parent / "photos" / f"{facade}.jpg"}
    assert not block.photos_rectified
    assert block.photos[facade].read_bytes() == (photos / "IMG_1.jpg").read_bytes()
    assert take_matches(block_file, photos, table) == (1, None), "again is the same"
    assert len(list((block_file.parent / "photos").iterdir())) == 1


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
    from tasks.stages.planning import plan_of

    facade = plan_of(read_block(block_file)).facades.id[0]
    table = block_file.parent / "mended.csv"
    table.write_text("photo,facade,probability,candidates\n" + rows.format(a=facade) + "\n")
    with pytest.raises(InputError, match=said):
        take_matches(block_file, block_file.parent.parent / "photos", table)
    assert not (block_file.parent / "photos").exists()


def test_a_file_that_is_no_table_is_refused(block_file: Path) -> None:
    (wrong := block_file.parent / "wrong.csv").write_text("file,wall\nIMG_1.jpg,a\n")
    with pytest.raises(InputError, match="has no columns `photo` and `facade`"):
        take_matches(block_file, block_file.parent.parent / "photos", wrong)
