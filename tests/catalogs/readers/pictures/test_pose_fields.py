"""Fields of poses files: units, other names, empty cells, and what is not used."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from catalogs.features import feature_ids_by_reason, format_reason_notes
from catalogs.readers.pictures.picture_matches import select_entries
from catalogs.readers.pictures.pose_fields import parse_capture_day
from catalogs.readers.pictures.poses import PosesFile, read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose
from facade_core.core.errors import InputError

UNUSED = (
    "fields of poses.csv with numbers that are not used; call those meant z (with its unit: z_m, z_ft), heading, pitch or "
    "roll"
)


def read(folder: Path, text: str, suffix: str = ".csv") -> PosesFile:
    (folder / f"poses{suffix}").write_text(text)
    return read_poses_file(folder / f"poses{suffix}")


def pose(found: PosesFile, name: str = "p.jpg") -> SourcePose:
    picture = Path("pictures") / name
    one = select_entries(found.poses, "poses", picture.parent, [picture])[picture]
    assert isinstance(one, SourcePose), one
    return one


@pytest.mark.parametrize(
    ("header", "row", "expected"),
    [
        ("x,y,z_ft", "5,6,10", (5.0, 6.0, 3.048)),
        ("x,y,Z [feet]", "5,6,10", (5.0, 6.0, 3.048)),
        ("x,y,z (US-ft)", "5,6,10", (5.0, 6.0, 3.048)),
        ("x,y,z_m", "5,6,10", (5.0, 6.0, 10.0)),
        ("x,y,z_cm", "5,6,250", (5.0, 6.0, 2.5)),
        ("x_mm,y_mm,z_mm", "5000,6000,2500", (5.0, 6.0, 2.5)),
        ("easting_ft,northing_ft,z", "10,20,3", (3.048, 6.096, 3.0)),
    ],
)
def test_units_of_lengths(header: str, row: str, expected: tuple[float, float, float], tmp_path: Path) -> None:
    found = pose(read(tmp_path, f"file,{header},heading\np.jpg,{row},90\n"))
    assert (found.x, found.y, found.z) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("crs", "field", "z"), [("EPSG:2263", "z", 3.048), ("EPSG:2263", "z_m", 10.0), ("EPSG:3067", "z_ft", 3.048)]
)
def test_a_unit_in_the_name_counts_before_that_of_the_frame(crs: str, field: str, z: float, tmp_path: Path) -> None:
    text = f'{{"crs": "{crs}", "poses": {{"p.jpg": {{"x": 1000, "y": 2000, "{field}": 10, "heading": 0}}}}}}'
    found = pose(read(tmp_path, text, ".json"))
    assert (found.x, found.y) == (1000, 2000)
    assert found.z == pytest.approx(z, rel=1e-5)


@pytest.mark.parametrize(
    ("field", "value"), [("heading_gon", 100), ("Heading[grad]", 100), ("heading_rad", 1.5707963267948966)]
)
def test_units_of_angles(field: str, value: float, tmp_path: Path) -> None:
    assert pose(read(tmp_path, f"file,x,y,{field}\np.jpg,5,6,{value}\n")).heading == pytest.approx(90.0)


@pytest.mark.parametrize(
    "columns", [["elev"], ["Altitude (ft)"], ["ground_z"], ["omega", "phi", "kappa"], ["hdop"], ["yaw"]]
)
def test_numbers_that_are_not_used_are_named_once(columns: list[str], tmp_path: Path) -> None:
    cells = ",".join("7" for _ in columns)
    text = f"file,x,y,heading,{','.join(columns)}\na.jpg,5,6,90,{cells}\nb.jpg,5,6,90,{cells}\n"
    found = read(tmp_path, text)
    assert format_reason_notes(feature_ids_by_reason(found.remarks)) == (
        f"{UNUSED}: {len(columns)} ({', '.join(sorted(columns))})",
    )
    assert pose(found, "a.jpg").z is None


def test_what_says_nothing_of_a_pose_is_not_named(tmp_path: Path) -> None:
    text = (
        "file,x,y,z,heading,pitch,roll,captured,author,width,height,note\np.jpg,5,6,7,8,1,2,2024-05-17,a,4000,2000,b\n"
    )
    found = read(tmp_path, text)
    assert found.remarks == ()
    assert pose(found).remarks == ()


def test_a_cell_left_empty_is_named_with_what_stands_in_its_place(tmp_path: Path) -> None:
    text = "file,x,y,z,heading,yaw,pitch\na.jpg,5,6,7,8,9,1\nb.jpg,5,6,,,9,\nc.jpg,5,6,7,,,1\n"
    found = read(tmp_path, text)
    assert (pose(found, "a.jpg").heading, pose(found, "a.jpg").remarks) == (8.0, ())
    b = pose(found, "b.jpg")
    assert (b.heading, b.z, b.pitch) == (9.0, None, None)
    assert [reason for _, reason in b.remarks] == [
        "panoramas whose heading is empty in poses.csv, heading taken from yaw",
        "panoramas whose z is empty in poses.csv, height unknown",
        "panoramas whose pitch is empty in poses.csv, taken as 0",
    ]
    assert pose(found, "c.jpg").heading is None  # its picture may state one


def test_a_row_with_more_cells_than_the_header_is_set_aside(tmp_path: Path) -> None:
    found = read(tmp_path, "file,x,y,heading\na.jpg,5,5,6,5,90\nb.jpg,5,6,90,\n")
    assert found.poses["a.jpg"] == (
        "poses.csv: a.jpg: it has more cells than the header; quote those with a separator; mend that entry"
    )
    assert pose(found, "b.jpg").heading == 90.0


def test_the_height_of_a_point_is_named(tmp_path: Path) -> None:
    text = (
        '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"file": "p.jpg", "heading": 3},'
        ' "geometry": {"type": "Point", "coordinates": [24.9, 60.1, 12.0]}}]}'
    )
    assert [one.id for one in read(tmp_path, text, ".json").remarks] == ["altitude of the point"]


@pytest.mark.parametrize(
    ("text", "suffix"),
    [
        ("file;x;y;heading\np.jpg;5,0;6,00;90,5\n", ".csv"),
        ("file x y heading\np.jpg 5 6 90.5\n", ".txt"),
        ("# Cameras (1)\n# PhotoID, X, Y, Heading\np.jpg\t5\t6\t90.5\n", ".txt"),
        ("imageName,X,Y,Heading\np.jpg,5,6,90.5\n", ".csv"),
    ],
)
def test_forms_of_tables(text: str, suffix: str, tmp_path: Path) -> None:
    found = pose(read(tmp_path, text, suffix))
    assert (found.x, found.y, found.heading) == (5, 6, 90.5)


PLACE = {"lat": 60.16, "lng": 24.93, "heading": 90.0}
MAPILLARY = {
    "MAPLatitude": 60.16,
    "MAPLongitude": 24.93,
    "MAPCompassHeading": {"TrueHeading": 90.0, "MagneticHeading": 83.0},
}


@pytest.mark.parametrize(
    "content",
    [
        {"result": {"data": [{"name": "p.jpg", **PLACE}], "hasMoreData": False}},
        {"osv": {"photos": [{"name": "p.jpg", **PLACE}]}},
        {"currentPageItems": [{"name": "p.jpg", **PLACE}]},
        [{"filename": "p.jpg", **MAPILLARY}],
        [{"pano_id": "p.jpg", "location": {"lat": 60.16, "lng": 24.93}, "centerHeading": 90.0}],
        [
            {
                "SourceFile": "a/p.jpg",
                "GPSLatitude": "60 deg 9' 36.00\" N",
                "GPSLongitude": "24 deg 55' 48.00\" E",
                "yaw": 90,
            }
        ],
        [{"SourceFile": "a/p.jpg", "GPSLatitude": "60°9'36\"N", "GPSLongitude": "24.93 E", "yaw": 90}],
    ],
)
def test_exports_of_services(content: object, tmp_path: Path) -> None:
    found = pose(read(tmp_path, json.dumps(content), ".json"))
    assert (found.x, found.y, found.heading) == pytest.approx((24.93, 60.16, 90))


def test_southern_and_western_degrees(tmp_path: Path) -> None:
    found = pose(read(tmp_path, 'file,lat,lon,heading\np.jpg,"33°51\'30""S","70°30\'W",1\n'))
    assert (found.x, found.y) == pytest.approx((-70.5, -33.858333))


def test_geojson_in_a_frame_of_its_own(tmp_path: Path) -> None:
    point = {
        "type": "Feature",
        "properties": {"file": "p.jpg", "yaw": 1},
        "geometry": {"coordinates": [385000, 6671000]},
    }
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32635"}}
    found = pose(read(tmp_path, json.dumps({"type": "FeatureCollection", "crs": crs, "features": [point]}), ".geojson"))
    assert (found.crs, found.x, found.y) == ("urn:ogc:def:crs:EPSG::32635", 385000, 6671000)


@pytest.mark.parametrize(
    ("value", "day"),
    [
        ("2024-05-17T23:59:00Z", "2024-05-17"),
        ("2024:05:17 10:00:00", "2024-05-17"),
        ("17.5.2024", "2024-05-17"),
        (20240517, "2024-05-17"),
        ("20240517101010", "2024-05-17"),
        ("2024_05_17_10_10_10_123", "2024-05-17"),
        (1715940000000, "2024-05-17"),
        ("1715940000", "2024-05-17"),
        ("05/17/2024", None),
        ("2024-13-40", None),
        ("spring", None),
        (17, None),
        (True, None),
        (None, None),
    ],
)
def test_days_of_capture(value: object, day: str | None) -> None:
    assert parse_capture_day(value) == day


def test_days_that_are_not_understood_are_noted(tmp_path: Path) -> None:
    found = read(tmp_path, "file,x,y,heading,captured_at\np.jpg,1,2,9.5,1715940000000\nq.jpg,1,2,8.5,05/17/2024\n")
    assert [pose(found, name).captured for name in ("p.jpg", "q.jpg")] == ["2024-05-17", None]
    assert [remark.id for remark in found.remarks] == ["captured_at"]


def test_names_and_numbers_of_other_programs(tmp_path: Path) -> None:
    text = "#Label;X/East;Y/North;Yaw\nC:\\run\\p.jpg;1,5;2,5;135°\n"
    (tmp_path / "poses.csv").write_bytes(text.encode("utf-16"))
    found = pose(read_poses_file(tmp_path / "poses.csv"))
    assert (found.x, found.y, found.heading) == (1.5, 2.5, 135.0)
    found = pose(read(tmp_path, "file;lat;lon;heading\np.jpg;60,17 N;24°56'19,3\"E;9\n"))
    assert (found.x, found.y) == pytest.approx((24.938694, 60.17), abs=1e-6)
    (tmp_path / "poses.csv").write_bytes("file,x,y,heading,Straße\n".encode("cp1252"))
    with pytest.raises(InputError, match="save it again as UTF-8"):
        read_poses_file(tmp_path / "poses.csv")
