"""Files of poses, each kind as its program writes it: every pose comes back, whatever it is."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from catalogs.readers.pictures.poses import LONLAT, read_poses_file
from catalogs.readers.pictures.source_poses import SourcePose

FRAME = "EPSG:3067"
HERE = (24.94, 60.17, 12.0)  # longitude, latitude, altitude
Poses = Mapping[str, SourcePose]

names = st.text("ab19Zäö -_()", min_size=1, max_size=10).map(str.strip).filter(bool)
files = st.lists(names.map(lambda name: f"{name}.jpg"), min_size=1, max_size=4, unique=True)
angles = st.floats(-180.0, 360.0)
tilts = st.floats(-80.0, 80.0)


def flat(crs: str | None) -> st.SearchStrategy[SourcePose]:
    side = st.floats(-1e7, 1e7)
    return st.builds(SourcePose, st.just(crs), side, side, st.none() | st.floats(-50, 900), angles, tilts, tilts)


def geographic(**more: Any) -> st.SearchStrategy[SourcePose]:
    return st.builds(SourcePose, st.just(LONLAT), st.floats(-180, 180), st.floats(-89, 89), **more)


def fields(pose: SourcePose, *, x: str = "x", y: str = "y") -> dict[str, Any]:
    stated = {x: pose.x, y: pose.y, "z": pose.z, "heading": pose.heading, "pitch": pose.pitch, "roll": pose.roll}
    return {key: value for key, value in stated.items() if value is not None}


def table(poses: Poses, separator: str, *, x: str, y: str) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, ["file", x, y, "z", "heading", "pitch", "roll"], delimiter=separator)
    writer.writeheader()
    writer.writerows({"file": name} | fields(pose, x=x, y=y) for name, pose in poses.items())
    return text.getvalue()


def own(poses: Poses, *, x: str, y: str, crs: str | None = None) -> str:
    content: dict[str, Any] = {"poses": {name: fields(pose, x=x, y=y) for name, pose in poses.items()}}
    return json.dumps(content | ({} if crs is None else {"crs": crs}))


def positions(poses: Poses) -> str:
    return json.dumps({"crs": FRAME, "camera_positions": {name: [p.x, p.y, p.z] for name, p in poses.items()}})


def tagged(poses: Poses) -> str:
    """A list of pictures whose place and direction only their GPS tags state."""

    def gps(pose: SourcePose) -> dict[str, Any]:
        return {
            "GPSLongitude": [abs(pose.x), 0, 0],
            "GPSLongitudeRef": "W" if pose.x < 0 else "E",
            "GPSLatitude": [abs(pose.y), 0, 0],
            "GPSLatitudeRef": "S" if pose.y < 0 else "N",
            "GPSImgDirection": pose.heading,
        }

    empty = {"lat": None, "lon": None, "heading_deg": None}
    return json.dumps([{"file": name, "exif_gps": gps(pose)} | empty for name, pose in poses.items()])


def points(poses: Poses) -> str:
    features = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": [pose.x, pose.y]},
            "properties": {"filename": name, "view:azimuth": pose.heading, "pers:pitch": pose.pitch},
        }
        for name, pose in poses.items()
    ]
    return json.dumps({"type": "FeatureCollection", "features": features})


def turned(pose: SourcePose) -> np.ndarray:
    """The rotation (3, 3), camera_from_world, with x right, y down, z ahead in a world of east, north, up."""
    assert pose.heading is not None
    heading, pitch, roll = np.radians([pose.heading, pose.pitch, pose.roll])
    ahead = np.array([np.sin(heading) * np.cos(pitch), np.cos(heading) * np.cos(pitch), np.sin(pitch)])
    level = np.array([np.cos(heading), -np.sin(heading), 0.0])
    right = np.cos(roll) * level - np.sin(roll) * np.cross(level, ahead)
    return np.stack([right, np.cross(ahead, right), ahead])


def records(poses: Poses) -> str:
    """Mapillary's, with the angles as one rotation."""
    return json.dumps(
        {
            "data": [
                {
                    "id": name,
                    "geometry": {"type": "Point", "coordinates": [0, 0]},
                    "computed_geometry": {"type": "Point", "coordinates": [pose.x, pose.y]},
                    "computed_rotation": cv2.Rodrigues(turned(pose))[0].ravel().tolist(),
                }
                for name, pose in poses.items()
            ]
        }
    )


def reconstruction(poses: Poses) -> str:
    """OpenSfM's, in metres east, north and up of HERE."""
    to_local = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84"
        f" +step +proj=topocentric +ellps=WGS84 +lon_0={HERE[0]} +lat_0={HERE[1]} +h_0={HERE[2]}"
    )
    shots = {}
    for name, pose in poses.items():
        rotation = turned(pose)
        place = np.array(to_local.transform(pose.x, pose.y, HERE[2]))
        shots[name] = {
            "camera": "c",
            "rotation": cv2.Rodrigues(rotation)[0].ravel().tolist(),
            "translation": (-rotation @ place).tolist(),
        }
    reference = dict(zip(("longitude", "latitude", "altitude"), HERE, strict=True))
    cameras = {"c": {"projection_type": "equirectangular"}}
    return json.dumps([{"cameras": cameras, "shots": shots, "reference_lla": reference}])


around_here = st.builds(
    SourcePose,
    st.just(LONLAT),
    st.floats(HERE[0] - 0.01, HERE[0] + 0.01),
    st.floats(HERE[1] - 0.01, HERE[1] + 0.01),
    heading=angles,
    pitch=tilts,
    roll=st.floats(-170.0, 170.0),
)
KINDS: Sequence[tuple[str, st.SearchStrategy[SourcePose], Callable[[Poses], str]]] = [
    ("commas", flat(None), lambda poses: table(poses, ",", x="x", y="y")),
    ("semicolons", geographic(heading=angles, pitch=tilts), lambda poses: table(poses, ";", x="lon", y="lat")),
    ("tabs", flat(None), lambda poses: table(poses, "\t", x="Easting", y="Northing")),
    ("own", flat(FRAME), lambda poses: own(poses, x="x", y="y", crs=FRAME)),
    ("own lonlat", geographic(z=st.none() | st.floats(0, 99)), lambda poses: own(poses, x="lng", y="latitude")),
    (
        "camera positions",
        st.builds(SourcePose, st.just(FRAME), st.floats(0, 1e6), st.floats(0, 1e7), st.floats(0, 99), st.just(0.0)),
        positions,
    ),
    ("gps tags", geographic(heading=st.floats(0, 360)), tagged),
    ("geojson", geographic(heading=angles, pitch=tilts), points),
    ("mapillary", around_here, records),
    ("opensfm", around_here, reconstruction),
]


@pytest.mark.parametrize(("kind", "poses", "written"), KINDS, ids=[kind for kind, *_ in KINDS])
@settings(max_examples=25)
@given(data=st.data())
def test_poses_come_back(
    tmp_path_factory: pytest.TempPathFactory,
    kind: str,
    poses: st.SearchStrategy[SourcePose],
    written: Callable[[Poses], str],
    data: st.DataObject,
) -> None:
    stated = {name: data.draw(poses) for name in data.draw(files)}
    path = tmp_path_factory.mktemp("poses") / "poses"
    path.write_text(written(stated), encoding="utf-8")
    found = read_poses_file(path).poses
    assert found.keys() == stated.keys()
    if kind not in ("mapillary", "opensfm"):  # numbers as they stand in the file
        assert found == stated
        return
    for name, pose in stated.items():
        other = found[name]
        assert isinstance(other, SourcePose), other
        assert pose.heading is not None
        assert other.heading is not None
        assert (other.x, other.y) == pytest.approx((pose.x, pose.y), abs=1e-8)
        assert (other.heading - pose.heading + 180) % 360 == pytest.approx(180, abs=1e-5)
        assert (other.pitch, other.roll) == pytest.approx((pose.pitch, pose.roll), abs=1e-5)


YAW = SourcePose(LONLAT, 24.93, 60.16, None, 88.0, 1.0, 2.0)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("filename,latitude,longitude,altitude,yaw,pitch,roll\np.jpg,60.16,24.93,20,88,1,2\n", YAW),
        ("# 1 camera, exported\n#Label,X/Longitude,Y/Latitude,Z/Altitude,Yaw,Pitch,Roll\np.jpg,24.93,60.16,20,88,1,2\n", YAW),
        (
            "sep=;\nFile Name;Lat;Long;Alt (m);Heading[deg];Pitch[deg];Roll[deg]\np.jpg;60.16;24.93;20;88;1;2\n",
            YAW,
        ),
        (
            "SourceFile,GPSLatitude,GPSLongitude,GPSAltitude,PoseHeadingDegrees,PosePitchDegrees,PoseRollDegrees\n"
            "./dcim/p.jpg,60.16,24.93,20,88,1,2\n",
            YAW,
        ),
        ('{"poses": {"p.jpg": {"Latitude": 60.16, "Longitude": 24.93, "yaw": 88, "pitch": 1, "roll": 2, "alt": 20}}}', YAW),
        ("image,easting,northing,z,bearing_rad\np.jpg,5,6,7,1.5707963267948966\n", SourcePose(None, 5, 6, 7, 90.0)),
        ("file,x,y,yaw,heading\np.jpg,5,6,7,8\n", SourcePose(None, 5, 6, None, 8.0)),
    ],
)  # fmt: skip
def test_names_of_other_programs(content: str, expected: SourcePose, tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text(content)
    [(name, pose)] = read_poses_file(tmp_path / "poses.csv").poses.items()
    assert name.endswith("p.jpg")
    assert pose == expected


def test_a_heading_that_is_no_number_is_named(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("image;lat;lon;yaw_rad\np.jpg;60.16;24.93;east\n")
    assert read_poses_file(tmp_path / "poses.csv").poses == {
        "p.jpg": "poses.csv: p.jpg: heading is 'east', not a finite number; mend that entry"
    }


def test_yaw_of_the_field_inputs(data: Path) -> None:
    folder = data / "field_inputs" / "poses-yaw-only"
    if not folder.is_dir():
        pytest.skip("no field inputs in the data folder")
    poses = read_poses_file(folder / "poses.csv").poses
    assert [pose.heading for pose in poses.values() if isinstance(pose, SourcePose)] == [88.2, 73.2, 108.2]
