"""Poses that no camera has, and files of them that are none: the panorama is set aside, or the file is refused in one line."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from pyproj import CRS

from catalogs.block.reader import read_block
from catalogs.readers.pictures.panoramas import read_panoramas
from facade_core.core.errors import InputError
from tests.faults.test_bad_inputs_pictures import changed

UTM = CRS.from_epsg(32635)
BIG = 10**400
GOOD = {"x": 385_100.0, "y": 6_671_700.0, "heading": 10}


def entry(**values: Any) -> str:
    return json.dumps({"poses": {"good": GOOD, "a": GOOD | values}})


def tags(**values: Any) -> str:
    gps = {"GPSLongitude": [24, 9, 3], "GPSLatitude": [60, 10, 5]} | values
    return json.dumps(
        [{"file": "good.jpg", "lon": 24.9, "lat": 60.1, "heading": 1}, {"file": "a.jpg", "exif_gps": gps, "heading": 1}]
    )


def shot(**values: Any) -> str:
    good = {"camera": "c", "rotation": [0, 0, 0], "translation": [0, 0, 0]}
    reference = {"longitude": 24.9, "latitude": 60.1, "altitude": 0}
    cameras = {"c": {"projection_type": "equirectangular"}}
    shots = {"good.jpg": good, "a.jpg": good | values}
    return json.dumps([{"reference_lla": reference, "cameras": cameras, "shots": shots}])


NO_NUMBER = r"poses\.\w+: a(\.jpg)?: .* not a finite number; mend that entry"
# A poses file of which one entry is broken -> what is said of that picture.
SET_ASIDE: dict[str, tuple[str, str]] = {
    "x-bigint": (entry(x=BIG), NO_NUMBER),
    "z-bigint": (entry(z=BIG), NO_NUMBER),
    "heading-bigint": (entry(heading=-BIG), NO_NUMBER),
    "x-nan": (entry(x=float("nan")), NO_NUMBER),
    "y-infinite": (entry(y=float("inf")), NO_NUMBER),
    "x-true": (entry(x=True), NO_NUMBER),
    "x-list": (entry(x=[1]), NO_NUMBER),
    "x-keys": (entry(x={"a": 1}), NO_NUMBER),
    "x-text": (entry(x="far away"), NO_NUMBER),
    "x-digits": (entry(x="9" * 5000), NO_NUMBER),
    "pitch-text": (entry(pitch="up"), NO_NUMBER),
    "x-1e300": (entry(x=1e300), r"x is 1e\+300, and at most 1e\+08 either way can be; mend its pose"),
    "z-1e300": (entry(z=-1e300), r"z is -1e\+300, and at most 10000 either way"),
    "heading-1e9": (entry(heading=1e9), r"heading is 1e\+09, and at most 3600"),
    "roll-1e9": (entry(roll=1e9), r"roll is 1e\+09, and at most 360"),
    "x-null": (entry(x=None), r"neither x and y nor lon and lat are given"),
    "heading-null": (entry(heading=None), r"states its place but no heading; add its heading there"),
    "entry-null": (json.dumps({"poses": {"good": GOOD, "a": None}}), r"poses\.json: a: it is no object in braces"),
    "entry-list": (json.dumps({"poses": {"good": GOOD, "a": [1, 2]}}), r"poses\.json: a: it is no object in braces"),
    "entry-text": (json.dumps({"poses": {"good": GOOD, "a": "b"}}), r"poses\.json: a: it is no object in braces"),
    "entry-missing": (json.dumps({"poses": {"good": GOOD}}), r"no pose; give its pose in poses.json"),
    "entry-twice": (
        json.dumps({"poses": [{"file": "good"} | GOOD, {"file": "a"} | GOOD, {"file": "a"} | GOOD]}),
        r"poses\.json gives a twice; remove one",
    ),
    "lon-1e9": (entry(lon=1e9, lat=60.0), r"x is 1e\+09, and at most|no place on earth"),
    "lat-91": (entry(lon=24.9, lat=91.0), r"no place on earth is at longitude 24.9, latitude 91"),
    "gps-bigint": (tags(GPSLongitude=[BIG]), r"a\.jpg: a number is too large; mend"),
    "gps-null": (tags(GPSLatitude=None), r"a\.jpg: its content is not arranged as in this format; mend"),
    "gps-text": (tags(GPSLatitude="north"), r"a\.jpg: "),
    "shot-bigint": (shot(translation=[BIG, 0, 0]), NO_NUMBER),
    "shot-1e300": (shot(translation=[1e300, 0, 0]), r"is no rotation or translation; three numbers are"),
    "shot-two": (shot(rotation=[0, 0]), r"is no rotation or translation; three numbers are"),
    "shot-nan": (shot(rotation=[float("nan"), 0, 0]), NO_NUMBER),
    "shot-null": (shot(rotation=None), r"a\.jpg: its content is not arranged as in this format; mend"),
    "shot-of-no-camera": (shot(camera="d"), r"a\.jpg: 'd' is missing; mend"),
    "csv-text": ("file,x,y,heading\ngood,385100,6671700,1\na,385100,here,1\n", NO_NUMBER),
    "csv-short": ("file,x,y,heading\ngood,385100,6671700,1\na,385100\n", r"neither x and y nor lon and lat are given"),
}
REFUSED: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", r"holds no poses; give a CSV"),
    "empty-list": ("[]", r"holds no poses|is not a poses file"),
    "number": ("[1, 2]", r"is not a poses file \("),
    "poses-null": ('{"poses": null}', r"is not a poses file \("),
    "poses-number": ('{"poses": 3}', r"is not a poses file \("),
    "positions-list": ('{"camera_positions": [1]}', r"is not a poses file \("),
    "positions-number": ('{"camera_positions": {"a": 1}}', r"is not a poses file \("),
    "nested": ("[" * 100_000, r"is not a poses file \(maximum recursion|is not a poses file"),
    "nested-keys": ('{"a":' * 50_000, r"is not a poses file"),
    "cut": (entry()[:-9], r"is not a poses file \("),
    "digits": (
        '{"poses": {"a": {"x": ' + "9" * 5000 + "}}}",
        r"is not a poses file \(a number has thousands of digits\)",
    ),
    "twins": ('{"poses": {"a": {"x": 1}, "a": {"x": 2}}}', r"'a' is given twice; remove one"),
    "binary": (bytes(range(256)), r"is not UTF-8 text"),
    "utf-16-cut": (entry().encode("utf-16")[:-1], r"is not UTF-8 text"),
    "zeros": (bytes(99), r"is not a poses file|holds no poses"),
    "huge": (b" " * 41_000_000, r"has more than 40 MB; keep the poses alone"),
    "csv-field": ("file,x\n" + "a" * 200_000 + ",1\n", r"is not a poses file \(field larger"),
    "crs-local": ('{"crs": "LOCAL_CS[\\"x\\",UNIT[\\"metre\\",1]]", "poses": {}}', r"crs .*no places on a map"),
    "crs-lunar": ('{"crs": "IAU_2015:30110", "poses": {}}', r"crs .*(not a frame of the Earth|not a known CRS)"),
    "crs-list": ('{"crs": ["EPSG:4326"], "poses": {}}', r"crs is \['EPSG:4326'\], which is no name of a frame"),
    "crs-keys": ('{"crs": {"type": "x"}, "poses": {}}', r"which is no name of a frame"),
    "crs-true": ('{"crs": true, "poses": {}}', r"which is no name of a frame"),
    "crs-south": ('{"crs": "EPSG:5513", "poses": {}}', r"axes other than east and north"),
    "crs-half": ('{"crs": "\\ud800", "poses": {}}', r"is not a known CRS"),
    "reference-1e9": (shot().replace("60.1", "1e9"), r"its reference_lla .* is no place on earth"),
    "reference-null": (shot().replace("60.1", "null"), r"its reference_lla states no longitude or no latitude"),
    "cameras-list": (shot().replace('{"c": {"projection_type": "equirectangular"}}', "[]"), r""),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "panoramas").mkdir()
    for name in ("good", "a"):
        Image.new("RGB", (64, 32)).save(tmp_path / "panoramas" / f"{name}.jpg")
    return tmp_path


def poses(folder: Path, content: str | bytes) -> Path:
    path = folder / ("poses.json" if content[:1] in ("{", "[", b"{", b"[") else "poses.csv")
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("case", SET_ASIDE)
def test_a_pose_that_no_camera_has_sets_its_panorama_aside(case: str, folder: Path) -> None:
    content, expected = SET_ASIDE[case]
    found = read_panoramas(folder / "panoramas", poses(folder, content), UTM)
    assert [item.id for item in found.items] == ["good"]
    (fault,) = found.faults
    assert fault.id == "a.jpg"
    assert fault.reason.isprintable()
    assert len(fault.reason) < 400
    with pytest.raises(ValueError, match=expected):
        raise ValueError(fault.reason)


@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_holds_no_poses_is_refused_in_one_line(case: str, folder: Path) -> None:
    content, expected = REFUSED[case]
    with pytest.raises(InputError, match=expected) as raised:
        read_panoramas(folder / "panoramas", poses(folder, content), UTM)
    assert str(raised.value).isprintable()


@pytest.mark.parametrize("part", ["1e308", "1e-300", "-5", "nan", "99999999999999999999", "x"])
def test_gpano_that_lies_is_told_or_left(part: str, folder: Path) -> None:
    names = [
        "FullPanoWidthPixels",
        "FullPanoHeightPixels",
        "CroppedAreaImageWidthPixels",
        "CroppedAreaImageHeightPixels",
    ]
    for name in names:
        fields = " ".join(f'GPano:{one}="{part if one == name else 64}"' for one in names)
        xmp = (
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
            f'<rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" {fields}/></rdf:RDF></x:xmpmeta>'
        )
        Image.new("RGB", (64, 32)).save(folder / "panoramas" / "a.jpg", xmp=xmp.encode())
        found = read_panoramas(folder / "panoramas", poses(folder, entry()), UTM)
        assert "good" in [item.id for item in found.items]
        assert len(found.items) + len(found.faults) == 2


@pytest.mark.parametrize("seconds", [IFDRational(1, 0), IFDRational(0, 0), IFDRational(2**31, 1)])
def test_exif_places_that_are_none_set_the_panorama_aside(seconds: IFDRational, folder: Path) -> None:
    exif = Image.Exif()
    gps = exif.get_ifd(0x8825)
    gps |= {1: "N", 2: (60.0, 10.0, seconds), 3: "E", 4: (24.0, 9.0, seconds), 17: IFDRational(1, 0)}
    Image.new("RGB", (64, 32)).save(folder / "panoramas" / "a.jpg", exif=exif)
    found = read_panoramas(folder / "panoramas", poses(folder, json.dumps({"poses": {"good": GOOD}})), UTM)
    assert [item.id for item in found.items] == ["good"]
    assert [fault.id for fault in found.faults] == ["a.jpg"]


@pytest.mark.parametrize(
    "content", [entry(z=1, roll=2), tags(), shot(), "file,x,y,heading\ngood,385100,6671700,1\na,1,2,3\n"]
)
def test_changed_bytes_of_a_poses_file_are_read_or_refused(content: str, folder: Path) -> None:
    chance = random.Random(content)
    for _ in range(60):
        try:
            found = read_panoramas(folder / "panoramas", poses(folder, changed(content.encode(), chance)), UTM)
            said = "".join(fault.reason for fault in found.faults)
        except InputError as error:
            said = str(error)
        assert said.isprintable()


def test_cases_of_before(data: Path) -> None:
    cases = sorted((data / "bad_inputs").glob("key-pose-*"))
    if not cases:
        pytest.skip("no bad inputs in the data folder")
    for case in cases:
        with pytest.raises(InputError, match=r"imagery\.panoramas: ") as raised:
            read_block(case / "block.yaml")
        assert str(raised.value).isprintable()
