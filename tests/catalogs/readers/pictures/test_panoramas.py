"""Panoramas and their poses: from files, EXIF and XMP."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from pyproj import CRS, Proj, Transformer
from scipy.spatial.transform import Rotation

from catalogs.block.reader import read_block
from catalogs.readers.pictures import panoramas
from catalogs.readers.pictures.folders import list_images, photos_by_facade
from catalogs.readers.pictures.panoramas import read_panoramas
from catalogs.readers.pictures.poses import read_poses_file
from facade_core.core.errors import BlockFileError, InputError

RD = CRS.from_epsg(28992)
UTM = CRS.from_epsg(32632)
LON, LAT = 7.753173, 48.581761  # Strasbourg, west of the zone's meridian
EAST, NORTH = Transformer.from_crs(4326, UTM, always_xy=True).transform(LON, LAT)
CONVERGENCE = Proj(UTM).get_factors(LON, LAT).meridian_convergence
XMP = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" {attributes}>{elements}</rdf:Description>
</rdf:RDF></x:xmpmeta>"""


def picture(path: Path, *, size=(64, 32), gps: dict | None = None, xmp: str | None = None) -> Path:
    image = Image.fromarray(np.random.default_rng(3).integers(0, 255, (size[1], size[0], 3), np.uint8))
    exif = Image.Exif()
    if gps is not None:
        exif.get_ifd(0x8825).update(gps)
    image.save(path, exif=exif, **({"xmp": xmp.encode()} if xmp else {}))
    return path


def dms(degrees: float) -> tuple[IFDRational, ...]:
    whole = int(degrees)
    minutes = int((degrees - whole) * 60)
    seconds = (degrees - whole - minutes / 60) * 3600
    return IFDRational(whole, 1), IFDRational(minutes, 1), IFDRational(round(seconds * 1_000_000), 1_000_000)


def gps(lon: float = LON, lat: float = LAT, heading: float | None = 30.0, reference: str = "T") -> dict:
    tags = {1: "N" if lat >= 0 else "S", 2: dms(abs(lat)), 3: "E" if lon >= 0 else "W", 4: dms(abs(lon)), 6: 140.5}
    return tags | ({16: reference, 17: heading} if heading is not None else {})


def poses_file(folder: Path, content: object, name: str = "poses.json") -> Path:
    path = folder / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "panoramas"
    folder.mkdir()
    return folder


def only(folder: Path, poses: Path | None = None, crs: CRS = UTM):
    found = read_panoramas(folder, poses, crs)
    assert found.faults == ()
    (item,) = found.items
    return item.pose


def test_exif_position_and_heading_from_true_north(folder: Path) -> None:
    picture(folder / "a.jpg", gps=gps())
    pose = only(folder)
    assert (pose.x, pose.y) == pytest.approx((EAST, NORTH), abs=0.01)
    assert pose.heading == pytest.approx(30.0 - CONVERGENCE, abs=1e-3)
    assert abs(CONVERGENCE) > 0.5  # or the frame's north would go unnoticed
    assert pose.z is None
    assert (pose.pitch, pose.roll, pose.view) == (0, 0, (0, 0, 1, 1))


def test_southern_and_western_references(folder: Path) -> None:
    frame = CRS.from_epsg(32723)
    picture(folder / "a.jpg", gps=gps(-46.63, -23.55))
    x, y = Transformer.from_crs(4326, frame, always_xy=True).transform(-46.63, -23.55)
    pose = only(folder, crs=frame)
    assert (pose.x, pose.y) == pytest.approx((x, y), abs=0.05)
    convergence = Proj(frame).get_factors(-46.63, -23.55).meridian_convergence
    assert pose.heading == pytest.approx(30.0 - convergence, abs=1e-3)


@pytest.mark.parametrize("form", ["attributes", "elements"])
def test_gpano_angles_and_crop(folder: Path, form: str) -> None:
    fields = {
        "ProjectionType": "equirectangular",
        "PoseHeadingDegrees": "120.5",
        "PosePitchDegrees": "-3",
        "PoseRollDegrees": "1.5",
        "FullPanoWidthPixels": "8000",
        "FullPanoHeightPixels": "4000",
        "CroppedAreaImageWidthPixels": "8000",
        "CroppedAreaImageHeightPixels": "2000",
        "CroppedAreaLeftPixels": "0",
        "CroppedAreaTopPixels": "1000",
    }
    attributes = " ".join(f'GPano:{name}="{value}"' for name, value in fields.items())
    elements = "".join(f"<GPano:{name}>{value}</GPano:{name}>" for name, value in fields.items())
    xmp = XMP.format(**({"attributes": "", "elements": ""} | {form: locals()[form]}))
    picture(folder / "a.jpg", size=(128, 32), gps=gps(heading=77.0), xmp=xmp)
    pose = only(folder)
    assert pose.heading == pytest.approx(120.5 - CONVERGENCE, abs=1e-3)
    assert (pose.pitch, pose.roll) == (-3, 1.5)
    assert pose.view == (0, 0.25, 1, 0.5)


def test_the_poses_file_wins_over_the_picture_but_not_its_view(folder: Path, tmp_path: Path) -> None:
    crop = {"FullPanoWidthPixels": 64, "FullPanoHeightPixels": 32, "CroppedAreaTopPixels": 8}
    crop |= {"CroppedAreaImageWidthPixels": 64, "CroppedAreaImageHeightPixels": 16}
    xmp = XMP.format(attributes=" ".join(f'GPano:{k}="{v}"' for k, v in crop.items()), elements="")
    picture(folder / "a.jpg", size=(64, 16), gps=gps(), xmp=xmp)
    poses = poses_file(tmp_path, {"poses": {"a": {"x": 10, "y": 20, "z": 3.5, "heading": -10, "pitch": 2, "roll": -1}}})
    pose = only(folder, poses)
    assert (pose.x, pose.y, pose.z) == (10, 20, 3.5)
    assert (pose.heading, pose.pitch, pose.roll) == (350, 2, -1)  # of the frame's grid north: nothing to turn
    assert pose.view == (0, 0.25, 1, 0.5)


@pytest.mark.parametrize(
    "content",
    [
        {"crs": "EPSG:4326", "poses": {"a.jpg": {"x": LON, "y": LAT, "heading": 30}}},
        {"poses": {"a": {"lon": str(LON), "lat": str(LAT), "heading": "30"}}},
        {"poses": [{"file": "a.jpg", "lon": LON, "lat": LAT, "heading": 30}]},
        f"file,lon,lat,heading\na.jpg,{LON},{LAT},30\n",
        f"\ufeffFile; Lat; Lon; Z; Heading; Pitch\na; {LAT}; {LON}; ; 30; 0\n",
        [{"file": "a.jpg", "lat": str(LAT), "lon": None, "heading_deg": "30", "exif_gps": {
            "GPSLatitudeRef": "N", "GPSLatitude": [LAT, 0, 0], "GPSLongitudeRef": "E", "GPSLongitude": [7, 45.19038, 0]}}],
        {"type": "FeatureCollection", "features": [{"id": "a", "geometry": {"type": "Point", "coordinates": [LON, LAT]},
            "properties": {"view:azimuth": 30}}]},
        {"data": [{"id": "a", "geometry": {"type": "Point", "coordinates": [0, 0]}, "compass_angle": 99,
            "computed_geometry": {"type": "Point", "coordinates": [LON, LAT]}, "computed_compass_angle": 30}]},
    ],
    ids=["crs", "lonlat", "list", "csv", "semicolons", "panoramax", "geojson", "mapillary"],
)  # fmt: skip
def test_forms_of_a_poses_file(folder: Path, tmp_path: Path, content: object) -> None:
    picture(folder / "a.jpg")
    pose = only(folder, poses_file(tmp_path, content))
    assert (pose.x, pose.y) == pytest.approx((EAST, NORTH), abs=0.05)
    assert pose.heading == pytest.approx(30.0 - CONVERGENCE, abs=1e-3)
    assert pose.z is None


def test_grid_headings_turn_between_frames(folder: Path, tmp_path: Path) -> None:
    picture(folder / "a.jpg")
    other = CRS.from_epsg(32631)
    x, y = Transformer.from_crs(4326, other, always_xy=True).transform(LON, LAT)
    pose = only(folder, poses_file(tmp_path, {"crs": "EPSG:32631", "poses": {"a": {"x": x, "y": y, "heading": 30}}}))
    assert (pose.x, pose.y) == pytest.approx((EAST, NORTH), abs=0.01)
    turn = Proj(other).get_factors(LON, LAT).meridian_convergence - CONVERGENCE
    assert abs(turn) > 4
    assert pose.heading == pytest.approx(30 + turn, abs=0.01)


def test_an_opensfm_reconstruction(folder: Path, tmp_path: Path) -> None:
    picture(folder / "a.jpg")
    place, heading, pitch, roll = np.array([12.0, -7.0, 2.0]), 200.0, 5.0, -3.0
    turn = Rotation.from_euler("ZXY", [-heading, pitch, roll], degrees=True).as_matrix()  # right, ahead, up -> world
    camera_from_world = np.stack([turn[:, 0], -turn[:, 2], turn[:, 1]])
    shot = {"camera": "c", "rotation": Rotation.from_matrix(camera_from_world).as_rotvec().tolist()}
    shot["translation"] = (-camera_from_world @ place).tolist()
    reconstruction = {
        "cameras": {"c": {"projection_type": "equirectangular"}, "p": {"projection_type": "perspective"}},
        "shots": {"a.jpg": shot, "b.jpg": shot | {"camera": "p"}},
        "reference_lla": {"latitude": LAT, "longitude": LON, "altitude": 150.0},
    }
    poses = poses_file(tmp_path, [reconstruction])
    assert list(read_poses_file(poses).poses) == ["a.jpg"]
    pose = only(folder, poses)
    scale = Proj(UTM).get_factors(LON, LAT).meridional_scale
    angle = np.radians(CONVERGENCE)  # grid north is this far east of true north
    east = scale * (12 * np.cos(angle) + 7 * np.sin(angle))
    north = scale * (12 * np.sin(angle) - 7 * np.cos(angle))
    assert (pose.x - EAST, pose.y - NORTH) == pytest.approx((east, north), abs=0.01)
    assert pose.heading == pytest.approx(200 - CONVERGENCE, abs=1e-3)
    assert (pose.pitch, pose.roll) == pytest.approx((5, -3))


def test_what_is_set_aside_is_named_with_its_remedy(folder: Path, tmp_path: Path) -> None:
    picture(folder / "good.jpg", gps=gps())
    picture(folder / "good.png", gps=gps())
    picture(folder / "unposed.jpg")
    picture(folder / "nowhere.jpg", gps={17: 30.0})
    picture(folder / "headless.jpg", gps=gps(heading=None))
    picture(folder / "square.jpg", size=(64, 64), gps=gps())
    picture(
        folder / "cylinder.jpg", gps=gps(), xmp=XMP.format(attributes='GPano:ProjectionType="cylindrical"', elements="")
    )
    picture(folder / "nan.jpg", gps=gps())
    whole = picture(folder / "cut.jpg", gps=gps()).read_bytes()
    (folder / "cut.jpg").write_bytes(whole[: len(whole) * 2 // 3])
    (folder / "text.jpg").write_bytes(b"not a picture")
    found = read_panoramas(folder, poses_file(tmp_path, '{"poses": {"nan": {"x": NaN, "y": 1, "heading": 0}}}'), UTM)
    assert [item.id for item in found.items] == ["good"]
    reasons = {fault.id: fault.reason for fault in found.faults}
    for name, part in {
        "good.png": "have one name; rename or remove",
        "unposed.jpg": "no pose; give its pose in poses.json",
        "nowhere.jpg": "no pose",
        "headless.jpg": "a place but no heading",
        "square.jpg": "twice as wide as high",
        "cylinder.jpg": "cylindrical",
        "nan.jpg": "x is nan, not a finite number",
        "cut.jpg": "cut off; replace or remove it",
        "text.jpg": "cannot be opened",
    }.items():
        assert part in reasons.pop(name)
    assert not reasons
    assert {fault.kind for fault in found.faults} == {"panorama"}
    assert not any("\n" in fault.reason for fault in found.faults)


def test_no_pose_at_all_is_an_error_that_names_the_folder(folder: Path) -> None:
    picture(folder / "a.jpg")
    with pytest.raises(InputError, match=r"panoramas holds no panorama that can be used: a\.jpg: no pose"):
        read_panoramas(folder, None, UTM)


def test_a_poses_file_for_other_pictures_is_said(folder: Path, tmp_path: Path) -> None:
    picture(folder / "a.jpg", gps=gps())
    found = read_panoramas(folder, poses_file(tmp_path, {"poses": {"b": {"x": 1, "y": 2, "heading": 0}}}), UTM)
    assert [item.id for item in found.items] == ["a"]
    (fault,) = found.faults
    assert fault.id == "poses.json"
    assert "none of the pictures it names (e.g. b)" in fault.reason


def test_panoramas_elsewhere_are_skipped_and_counted(folder: Path) -> None:
    picture(folder / "here.jpg", gps=gps(reference="M"))
    picture(folder / "far.jpg", gps=gps(lat=LAT + 0.02))
    found = read_panoramas(folder, None, UTM, (EAST - 50, NORTH - 50, EAST + 50, NORTH + 50))
    assert [item.id for item in found.items] == ["here"]
    assert found.faults == ()
    assert {remark.id: remark.reason for remark in found.remarks} == {
        "far": panoramas._DISTANT_REASON,
        "here": "panoramas whose heading from magnetic north is taken as true",
    }


@pytest.mark.parametrize(("x", "y"), [(NORTH, EAST), (LON, LAT), (EAST + 35e6, NORTH), (EAST, NORTH - 9000)])
def test_the_remedy_for_a_distant_pose_is_named(folder: Path, tmp_path: Path, x: float, y: float) -> None:
    picture(folder / "a.jpg")
    poses = poses_file(tmp_path, {"poses": {"a": {"x": x, "y": y, "heading": 9.5}}})
    found = read_panoramas(folder, poses, UTM, (EAST - 50, NORTH - 50, EAST + 50, NORTH + 50))
    (remark,) = found.remarks
    assert "check the order of x and y (east first)" in remark.reason


@pytest.mark.parametrize(("stated", "is_noted"), [("0.0", True), ("12.0", False)])
def test_a_default_heading_that_exif_contradicts_is_noted(folder: Path, stated: str, is_noted: bool) -> None:
    xmp = XMP.format(attributes=f'GPano:PoseHeadingDegrees="{stated}"', elements="")
    picture(folder / "a.jpg", gps=gps(heading=77.0), xmp=xmp)
    found = read_panoramas(folder, None, UTM)
    assert [remark.id for remark in found.remarks] == (["a"] if is_noted else [])


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "holds no poses"),
        ("hello", "holds no poses"),
        ("x,y\n1,2\n", "does not name its picture"),
        ("[1, 2]", "not a poses file"),
        ('{"poses": 3}', "not a poses file"),
        ("{", "not a poses file"),
        ('{"crs": "EPSG:99999999", "poses": {"a": {"x": 1, "y": 2, "heading": 3}}}', "is not a known CRS"),
    ],
)
def test_a_file_without_poses_is_refused(tmp_path: Path, content: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem) as refused:
        read_poses_file(poses_file(tmp_path, content))
    assert "poses.json" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_damaged_xmp_and_exif_count_as_none(folder: Path, tmp_path: Path) -> None:
    picture(folder / "a.jpg", xmp="<x:xmpmeta><broken")
    picture(folder / "b.jpg", xmp='<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/hostname">]><x>&e;</x>')
    picture(folder / "c.jpg", gps=gps() | {2: (IFDRational(1, 0),) * 3})
    poses = {name: {"x": 1, "y": 2, "heading": 0} for name in "ab"}
    found = read_panoramas(folder, poses_file(tmp_path, {"poses": poses}), UTM)
    assert [item.id for item in found.items] == ["a", "b"]
    assert [fault.id for fault in found.faults] == ["c.jpg"]


def test_unreadable_pictures_are_faults_unless_all_are(tmp_path: Path) -> None:
    picture(tmp_path / "f1.png")
    picture(tmp_path / "f2.webp")
    (tmp_path / "f3.png").write_bytes((tmp_path / "f1.png").read_bytes()[:-60])
    paths, faults = list_images(tmp_path, "exemplar")
    assert [path.name for path in paths] == ["f1.png", "f2.webp"]
    assert [(fault.id, fault.kind) for fault in faults] == [("f3.png", "exemplar")]
    assert sorted(photos_by_facade(tmp_path)[0]) == ["f1", "f2", "f3"], "its facade fails, when it comes to it"
    (tmp_path / "f1.png").unlink()
    (tmp_path / "f2.webp").unlink()
    with pytest.raises(InputError, match=r"f3\.png is cut off"):
        list_images(tmp_path, "exemplar")


def test_a_thumbnail_does_not_make_a_cut_picture_whole(tmp_path: Path) -> None:
    thumbnail = picture(tmp_path / "t.jpg").read_bytes()
    (tmp_path / "t.jpg").unlink()
    whole = picture(tmp_path / "a.jpg", size=(640, 320)).read_bytes()
    segment = b"\xff\xe2" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    (tmp_path / "a.jpg").write_bytes(whole[:2] + segment + whole[2:])
    (tmp_path / "b.jpg").write_bytes(whole[:2] + segment + whole[2 : len(whole) // 2])
    paths, faults = list_images(tmp_path, "exemplar")
    assert [path.name for path in paths] == ["a.jpg"]
    assert [fault.id for fault in faults] == ["b.jpg"]


def test_amsterdam_and_strasbourg(data: Path) -> None:
    amsterdam = data / "city" / "amsterdam"
    found = read_panoramas(amsterdam / "panoramas", amsterdam / "poses_and_walls.json", RD)
    assert len(found.items) == 4
    assert [fault.id[-10:] for fault in found.faults] == ["000063.jpg", "000149.jpg"]
    dam = next(item.pose for item in found.items if item.id.endswith("001622"))
    assert (dam.x, dam.y, dam.z, dam.heading) == pytest.approx((121348.591, 487338.811, 2.0, 0.0), abs=1e-3)

    found = read_panoramas(data / "panoramas", data / "panoramas" / "index.json", UTM)
    assert len(found.items) == 13
    assert [fault.id.split("_")[0] for fault in found.faults] == ["toulouse"] * 4
    pose = next(item.pose for item in found.items if item.id == "strasbourg_stra_1_1")
    assert (pose.x, pose.y) == pytest.approx((EAST, NORTH), abs=0.01)
    assert pose.heading == pytest.approx(233.73 - CONVERGENCE, abs=1e-3)


def test_a_link_to_what_is_not_there_is_set_aside_and_not_overlooked(tmp_path: Path) -> None:
    picture(tmp_path / "a-0.png")
    (tmp_path / "b-0.png").symlink_to(tmp_path / "nowhere" / "b-0.png")
    os.mkfifo(tmp_path / "c-0.png")
    for faults in (photos_by_facade(tmp_path)[1], list_images(tmp_path, "photo")[1]):
        assert [(fault.id, fault.kind) for fault in faults] == [("b-0.png", "photo"), ("c-0.png", "photo")]
        assert all("leads to no file; mend" in fault.reason for fault in faults)
    assert sorted(photos_by_facade(tmp_path)[0]) == ["a-0"]


def test_of_the_same_picture_twice_the_first_is_taken(folder: Path) -> None:
    picture(folder / "a.jpg")
    (folder / "b.jpg").write_bytes((folder / "a.jpg").read_bytes())
    there = {"x": EAST, "y": NORTH, "heading": 0}
    poses = poses_file(folder.parent, {"poses": {"a": there, "b": there | {"x": EAST + 9}}})
    found = read_panoramas(folder, poses, UTM)
    assert [one.id for one in found.items] == ["a"]
    assert [(one.id, one.reason) for one in found.faults] == [
        ("b.jpg", "is the same picture as a.jpg; remove one, or mend its file")
    ]


@pytest.mark.parametrize(
    ("east", "day", "told"),
    [(20, "2021-05-01", True), (20, "2024-01-01", False), (50, "2021-05-01", False), (20, "once", False)],
)
def test_pictures_of_one_place_far_apart_in_time_are_told(folder: Path, east: float, day: str, told: bool) -> None:
    entries = {"new": (0.0, "2024-05-01"), "old": (east, day)}
    for size, name in enumerate(entries):
        picture(folder / f"{name}.jpg", size=(64 * (size + 1), 32 * (size + 1)))
    poses = {name: {"x": EAST + x, "y": NORTH, "heading": 0, "captured": day} for name, (x, day) in entries.items()}
    found = read_panoramas(folder, poses_file(folder.parent, {"poses": poses}), UTM)
    assert len(found.items) == 2
    noted = ["old of 2021-05-01 near new of 2024-05-01"] if told else ["captured"] if day == "once" else []
    assert [one.id for one in found.remarks] == noted


def test_a_block_leaves_out_panoramas_from_before_a_day(folder: Path) -> None:
    days = {"new": "2024-05-01", "old": "2021-05-01", "undated": None}
    for size, name in enumerate(days, 1):
        picture(folder / f"{name}.jpg", size=(64 * size, 32 * size))
    place = {"x": EAST, "y": NORTH, "heading": 0}
    poses_file(
        folder, {"crs": UTM.to_string(), "poses": {name: place | {"captured": day} for name, day in days.items()}}
    )
    ring = [[EAST + x, NORTH + y] for x, y in ((5, 0), (15, 0), (15, 8), (5, 8), (5, 0))]
    house = {"type": "Feature", "properties": {"height": 9}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    buildings = folder.parent / "houses.geojson"
    buildings.write_text(json.dumps({"type": "FeatureCollection", "features": [house]}))
    kept = {}
    for since in ("", ", since: 2021-05-01", ", since: 2022-01-01"):
        block_file = folder.parent / "block.yaml"
        block_file.write_text(
            f"name: a\ncrs: {UTM}\nbuildings: {{path: houses.geojson, crs: '{UTM}'}}\ntexture: {{walls: translate}}\n"
            f"imagery: {{panoramas: {{path: panoramas, poses: panoramas/poses.json{since}}}}}\n"
        )
        block = read_block(block_file)
        kept[since] = [one.id for one in block.panoramas]
    assert list(kept.values()) == [["new", "old", "undated"], ["new", "old", "undated"], ["new", "undated"]]
    assert "panoramas from before 2022-01-01 left out: 1 (old)" in block.notes
    block_file.write_text(block_file.read_text().replace("2022-01-01", "2022-13-01"))
    with pytest.raises(BlockFileError, match=r"line 5: imagery\.panoramas\.since: is no day of the calendar"):
        read_block(block_file)


def test_a_pose_without_a_heading_is_named(tmp_path: Path) -> None:
    Image.new("RGB", (64, 32)).save(tmp_path / "p.jpg")
    (tmp_path / "poses.csv").write_text("file,lon,lat\np.jpg,24.9,60.1\n")
    with pytest.raises(InputError, match=r"poses\.csv states its place but no heading; add its heading"):
        read_panoramas(tmp_path, tmp_path / "poses.csv", CRS("EPSG:3067"))


def test_swapped_places_and_letter_case(folder: Path, tmp_path: Path) -> None:
    picture(folder / "a.jpg")
    bounds = (EAST, NORTH, EAST, NORTH)
    swapped = poses_file(tmp_path, {"poses": {"A.JPG": {"lon": LAT, "lat": LON, "heading": 0}}})
    found = read_panoramas(folder, swapped, UTM, bounds)
    assert ["check the order" in remark.reason for remark in found.remarks] == [True]
    right = poses_file(tmp_path, {"poses": {"A.JPG": {"lon": LON, "lat": LAT, "heading": 0}}})
    assert [one.id for one in read_panoramas(folder, right, UTM, bounds).items] == ["a"]
