"""Poses assembled field by field from tables, XMP, sidecars and EXIF; the right values are stated beside each case."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from catalogs.features import Remark
from catalogs.readers.pictures.panoramas import read_panoramas
from catalogs.readers.pictures.poses import read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose
from facade_core.core.errors import InputError
from facade_core.core.types import Pose
from tests.catalogs.readers.pictures.test_panoramas import CONVERGENCE, EAST, LAT, LON, NORTH, UTM, XMP, gps, picture

TILT = 'GPano:PosePitchDegrees="12" GPano:PoseRollDegrees="-3"'
HEADING = 'GPano:PoseHeadingDegrees="75"'
XMP_GPS = (
    'xmlns:exif="http://ns.adobe.com/exif/1.0/" exif:GPSLatitude="48,34.90566N" exif:GPSLongitude="7,45.19038E" '
    'exif:GPSImgDirection="2705/10" exif:GPSImgDirectionRef="T"'
)


def read_pose(folder: Path, table: str | None = None) -> tuple[Pose, tuple[Remark, ...]]:
    poses = None
    if table is not None:
        poses = folder / "poses.csv"
        poses.write_text(table)
    found = read_panoramas(folder, poses, UTM)
    assert not found.faults
    return found.items[0].pose, found.remarks


@dataclass(frozen=True)
class Case:
    heading: float  # from true north
    pitch: float
    roll: float
    exif: dict[int, Any] = field(default_factory=lambda: gps(heading=None))
    xmp: str = ""
    sidecar: str = ""
    table: str | None = None


CASES = {
    "tilt of GPano, heading of EXIF": Case(30, 12, -3, gps(), TILT),
    "all of GPano": Case(75, 12, -3, gps(), f"{TILT} {HEADING}"),
    "heading of GPano alone": Case(75, 0, 0, gps(heading=None), HEADING),
    "sidecar over GPano": Case(75, 5, -3, gps(), TILT, f'{HEADING} GPano:PosePitchDegrees="5"'),
    "place and heading of a sidecar": Case(270.5, 12, -3, {}, TILT, XMP_GPS),
    "place of XMP in the picture": Case(270.5, 0, 0, {}, XMP_GPS),
    "table without tilt": Case(10, 12, -3, gps(), TILT, "", f"file,lon,lat,heading\np.jpg,{LON},{LAT},10\n"),
    "table of angles": Case(10, 2, 0, gps(), "", "", "file,heading,pitch\np.jpg,10,2\n"),
    "table without heading": Case(30, 0, 0, gps(), "", "", f"file,x,y\np.jpg,{EAST},{NORTH}\n"),
    "table of rolls": Case(30, 0, 1, gps(), "", "", "file,roll\np.jpg,1\n"),
    "table of a database": Case(
        30, 12, -3, gps(), TILT, "", f"file,lon,lat,heading,pitch,roll\np.jpg,{LON},{LAT},NULL,nan,\n"
    ),
    "table of ExifTool with groups": Case(
        75,
        12,
        0,
        {},
        "",
        "",
        "SourceFile,EXIF:GPSLatitude,EXIF:GPSLatitudeRef,EXIF:GPSLongitude,XMP:PoseHeadingDegrees,XMP-GPano:PosePitchDegrees\n"
        f"./p.jpg,{LAT},North,{LON},75,12\n",
    ),
    "fractions and decimal commas": Case(
        30, 12.5, -3, gps(), 'GPano:PosePitchDegrees="12,5" GPano:PoseRollDegrees="-6/2"'
    ),
    "table with an empty heading": Case(
        30, 1, 0, gps(), "", "", f"file,lon,lat,heading,pitch\np.jpg,{LON},{LAT},,1\nq.jpg,{LON},{LAT},3,4\n"
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
@pytest.mark.parametrize("name", ["p.jpg.xmp", "p.xmp", "P.XMP"])
def test_each_field_is_of_the_best_source_that_states_it(tmp_path: Path, case: Case, name: str) -> None:
    picture(tmp_path / "p.jpg", gps=case.exif, xmp=XMP.format(attributes=case.xmp, elements=""))
    if case.sidecar:
        (tmp_path / name).write_text(XMP.format(attributes=case.sidecar, elements=""))
    pose, _ = read_pose(tmp_path, case.table)
    assert (pose.x, pose.y) == pytest.approx((EAST, NORTH), abs=0.02)
    assert (pose.heading - case.heading + CONVERGENCE + 180) % 360 - 180 == pytest.approx(0, abs=0.01)
    assert (pose.pitch, pose.roll) == (case.pitch, case.roll)


def test_sources_are_noted_where_they_differ(tmp_path: Path) -> None:
    picture(tmp_path / "p.jpg", gps=gps(), xmp=XMP.format(attributes=TILT, elements=""))
    assert [remark.reason for remark in read_pose(tmp_path)[1]] == [
        "panoramas posed by several sources: heading from EXIF; pitch, roll from XMP"
    ]
    _, remarks = read_pose(tmp_path, f"file,lon,lat,heading\np.jpg,{LON},{LAT},10\n")
    assert [remark.reason for remark in remarks] == [
        "panoramas posed by several sources: place, heading from poses.csv; pitch, roll from XMP"
    ]


def test_usual_panoramas_are_not_noted(tmp_path: Path) -> None:
    picture(tmp_path / "p.jpg", gps=gps(), xmp=XMP.format(attributes=f"{TILT} {HEADING}", elements=""))
    assert not read_pose(tmp_path)[1]


def test_magnetic_reference_counts_only_with_its_heading(tmp_path: Path) -> None:
    picture(tmp_path / "p.jpg", gps=gps(reference="M"), xmp=XMP.format(attributes=HEADING, elements=""))
    assert not read_pose(tmp_path)[1]


@pytest.mark.parametrize(
    ("table", "xmp", "source"),
    [
        ("pitch\np.jpg,89\n", "", "poses.csv"),
        ("roll\np.jpg,-179\n", "", "poses.csv"),
        (None, 'GPano:PosePitchDegrees="-90"', "XMP"),
        (None, TILT, None),
    ],
)
def test_large_tilts_are_noted_by_their_source(tmp_path: Path, table: str | None, xmp: str, source: str | None) -> None:
    picture(tmp_path / "p.jpg", gps=gps(), xmp=XMP.format(attributes=xmp, elements=""))
    _, remarks = read_pose(tmp_path, None if table is None else f"file,{table}")
    tilts = [remark.reason for remark in remarks if "by over 45 degrees" in remark.reason]
    assert [f"panoramas that {source} tilts" in tilt for tilt in tilts] == ([True] if source else [])


def test_angles_that_are_no_numbers_are_noted(tmp_path: Path) -> None:
    picture(tmp_path / "p.jpg", gps=gps(), xmp=XMP.format(attributes='GPano:PosePitchDegrees="up"', elements=""))
    pose, [remark] = read_pose(tmp_path)
    assert (pose.pitch, remark.reason) == (0, "panoramas whose GPano PosePitchDegrees is no number: read without")


def test_southern_latitudes_of_exiftool_have_their_hemisphere(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text(
        "SourceFile,GPS:GPSLatitude,GPS:GPSLatitudeRef,GPS:GPSLongitude,heading\np.jpg,33.5,S,18.2,9\n"
    )
    stated = read_poses_file(tmp_path / "poses.csv").poses["p.jpg"]
    assert isinstance(stated, SourcePose)
    assert (stated.x, stated.y) == (18.2, -33.5)


def test_pose_that_no_source_places_is_named(tmp_path: Path) -> None:
    picture(tmp_path / "p.jpg", xmp=XMP.format(attributes=HEADING, elements=""))
    with pytest.raises(InputError, match=r"poses.csv states no place; add its place there"):
        read_pose(tmp_path, "file,heading,pitch\np.jpg,10,2\n")


def test_panoramas_in_folders_have_the_poses_of_their_paths(tmp_path: Path) -> None:
    for number, name in enumerate(("2023/p.jpg", "2024/p.jpg")):
        (tmp_path / name).parent.mkdir()
        picture(tmp_path / name, size=(64 + 2 * number, 32 + number))
    (tmp_path / "poses.csv").write_text(
        f"file,lon,lat,heading\n2024/p.jpg,{LON},{LAT},30\n2023\\p.jpg,{LON},{LAT},20\n"
    )
    found = read_panoramas(tmp_path, tmp_path / "poses.csv", UTM)
    assert not found.faults
    headings = {one.id: one.pose.heading + CONVERGENCE for one in found.items}
    assert headings == {"2023-p": pytest.approx(20, abs=0.01), "2024-p": pytest.approx(30, abs=0.01)}
