"""Perspective pictures with poses: every format gives the same cameras, local frames are placed, broken ones are told."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from catalogs.readers.pictures.cameras.camera_file import rotation_from_heading, rotation_from_omega_phi_kappa
from catalogs.readers.pictures.cameras.cameras import read_cameras
from catalogs.readers.pictures.cameras.colmap import read_colmap
from catalogs.readers.pictures.cameras.metashape import read_metashape
from catalogs.readers.pictures.panoramas import PosedPanoramas
from facade_core.core.errors import InputError
from facade_core.core.lens_projection import project_camera_rays
from facade_core.core.types import Lens, Pose
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from tests.catalogs.readers.pictures.camera_files import (
    BOUNDS,
    LENS,
    LOCAL,
    ORIGIN,
    SAME,
    SIZE,
    UTM,
    in_frame,
    lonlat,
    ring,
    write_colmap,
    write_metashape,
    write_opensfm,
    write_pictures,
)

POSES = ring()


def read(pictures: Path, poses: Path, **more) -> PosedPanoramas:
    return read_cameras(pictures, poses, UTM, BOUNDS, **more)


def check(
    found: PosedPanoramas, poses: Mapping[str, Pose] = POSES, metres: float = 0.01, degrees: float = 0.01
) -> None:
    assert [one.path.name for one in found.items] == sorted(poses)
    for one in found.items:
        true = poses[one.path.name]
        np.testing.assert_allclose(camera_position(one.pose), camera_position(true), atol=metres)
        turn = Rotation.from_matrix(camera_from_world(one.pose) @ camera_from_world(true).T).magnitude()
        assert np.degrees(turn) < degrees
        assert one.pose.lens is not None
        assert true.lens is not None
        rays = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 1], (50, 3))
        np.testing.assert_allclose(
            project_camera_rays(one.pose.lens, rays), project_camera_rays(true.lens, rays), atol=1e-9
        )


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    return write_pictures(tmp_path / "pictures", list(POSES))


def table(path: Path, poses: Mapping[str, Pose], angles: str = "heading,pitch,roll", **columns: str) -> Path:
    """A table of cameras in the frame of the block, with other columns by name."""
    lines = [f"file,x,y,z,{angles},{','.join(columns)}"]
    for name, pose in poses.items():
        if angles.startswith("omega"):
            values = omega_phi_kappa(pose)
            if "rad" in angles:
                values = np.radians(values)
        else:
            values = np.array([pose.heading, pose.pitch, pose.roll])
        lines.append(
            f"{name},{pose.x},{pose.y},{pose.z},{','.join(map(repr, values.tolist()))},{','.join(columns.values())}"
        )
    path.write_text("\n".join(lines))
    return path


def omega_phi_kappa(pose: Pose) -> np.ndarray:
    """Rotations of the axes right, up and back about x, then y, then z, which turn with them."""
    axes = np.diag([1.0, -1.0, -1.0]) @ camera_from_world(pose)
    return Rotation.from_matrix(axes.T).as_euler("XYZ", degrees=True)


CALIBRATION = {"focal_px": "140", "width": "160", "height": "120"}
TABLE_LENS = Lens(SIZE, (140.0, 140.0), (80.0, 60.0))


@pytest.mark.parametrize("binary", [False, True])
def test_colmap_in_the_frame_of_the_block(tmp_path: Path, pictures: Path, *, binary: bool) -> None:
    found = read(pictures, write_colmap(tmp_path / "model", POSES, SAME, binary=binary))
    check(found)
    assert any("taken to be in the frame of the block" in one.reason for one in found.remarks)


@pytest.mark.parametrize("binary", [False, True])
def test_colmap_is_placed_by_gps_and_the_residual_is_told(tmp_path: Path, *, binary: bool) -> None:
    pictures = write_pictures(tmp_path / "pictures", list(POSES), gps=lonlat(POSES))
    found = read(pictures, write_colmap(tmp_path / "model", POSES, LOCAL, binary=binary))
    # upright by pictures that are a little tilted
    check(found, metres=3.0, degrees=4.0)
    (note,) = [one.reason for one in found.remarks if "placed by the GPS" in one.reason]
    assert "of 6 pictures: median residual 0." in note


def test_gps_of_three_metres_places_forty_cameras_within_one(tmp_path: Path) -> None:
    poses = {name: replace(pose, pitch=2.0, roll=0.5) for name, pose in ring(40).items()}
    pictures = write_pictures(tmp_path / "pictures", list(poses), gps=lonlat(poses, 3.0))
    found = read(pictures, write_colmap(tmp_path / "model", poses, LOCAL))
    away = [np.hypot(one.pose.x - poses[one.path.name].x, one.pose.y - poses[one.path.name].y) for one in found.items]
    assert np.median(away) < 1.5


def test_three_control_points_place_a_model(tmp_path: Path, pictures: Path) -> None:
    model = write_colmap(tmp_path / "model", POSES, LOCAL)
    turn, scale, shift = LOCAL
    lines = ["name,model_x,model_y,model_z,x,y,z"]
    for name, place in (("church", [10, 20, 3]), ("kerb", [-20, 5, 0])):
        local = scale * turn.apply(place) + shift
        lines.append(",".join(map(repr, [name, *local.tolist(), *(ORIGIN + place).tolist()])).replace("'", ""))
    lines.append(f"4.jpg,,,,{POSES['4.jpg'].x},{POSES['4.jpg'].y},{POSES['4.jpg'].z}")
    control = tmp_path / "control.csv"
    control.write_text("\n".join(lines))
    found = read(pictures, model, control=control)
    check(found)
    assert any("placed by 3 control points: largest residual 0.00 m" in one.reason for one in found.remarks)
    control.write_text("\n".join(lines[:3]))
    with pytest.raises(InputError, match=r"control.csv holds 2 control points that can be used; 3 are the least"):
        read(pictures, model, control=control)
    control.write_text("\n".join([*lines[:3], lines[3].replace(str(POSES["4.jpg"].x), str(POSES["4.jpg"].x + 30))]))
    with pytest.raises(InputError, match=r"contradict each other by \d+\.\d m"):
        read(pictures, model, control=control)


def test_a_local_frame_without_gps_is_refused_with_the_remedy(tmp_path: Path, pictures: Path) -> None:
    with pytest.raises(
        InputError, match=r"images.txt has a frame of its own, and no picture has GPS; give three control po"
    ):
        read(pictures, write_colmap(tmp_path / "model", POSES, LOCAL))
    near = write_pictures(tmp_path / "near", list(POSES), gps=dict.fromkeys(POSES, next(iter(lonlat(POSES).values()))))
    with pytest.raises(InputError, match=r"the GPS of its pictures spans 0 m, where 15 m are needed"):
        read(near, tmp_path / "model" / "images.txt")


@pytest.mark.parametrize("reference", [True, False])
def test_opensfm(tmp_path: Path, *, reference: bool) -> None:
    pictures = write_pictures(tmp_path / "pictures", list(POSES), gps={} if reference else lonlat(POSES))
    found = read(pictures, write_opensfm(tmp_path / "reconstruction.json", POSES, reference=reference))
    check(found, metres=0.02 if reference else 3.0, degrees=0.01 if reference else 4.0)


def test_metashape(tmp_path: Path, pictures: Path) -> None:
    found = read(pictures, write_metashape(tmp_path / "cameras.xml", POSES))
    check(found)
    assert [one.id for one in found.remarks if "did not align" in one.reason] == ["lost"]


@pytest.mark.parametrize("label", ["s1", "0"])
def test_metashape_places_the_cameras_of_a_rig(tmp_path: Path, pictures: Path, label: str) -> None:
    """Slaves have the transform of their master times rotation and location of their sensor."""
    path = write_metashape(tmp_path / "cameras.xml", {"0.jpg": POSES["0.jpg"]})
    text = path.read_text()
    sensor = text[text.index("<sensor ") : text.index("</sensors>")]
    turned = Rotation.from_euler("y", 90, degrees=True).as_matrix().ravel()
    beside = f"<rotation>{' '.join(map(repr, turned.tolist()))}</rotation><location>0.4 0 0</location></sensor>"
    second = sensor.replace('id="0"', 'id="1" master_id="0" label="right"').replace("</sensor>", beside)
    first = sensor.replace('id="0"', 'id="0" label="left"')
    slave = f'<camera id="1" sensor_id="1" master_id="0" label="{label}"/></cameras>'
    path.write_text(text.replace(sensor, first + second).replace("</cameras>", slave))
    cameras = read_metashape(path.name, path.read_bytes()).cameras
    names = ["left/0", "right/0"] if label == "0" else ["0", "s1"]
    assert list(cameras) == names
    one, other = (cameras[name] for name in names)
    assert not isinstance(one, str)
    assert not isinstance(other, str)
    offset = one.rotation @ (other.centre - one.centre)
    assert offset == pytest.approx([2.5 * 0.4, 0, 0], abs=1e-6)  # the chunk's scale is 2.5
    assert one.rotation @ other.rotation.T == pytest.approx(turned.reshape(3, 3), abs=1e-9)


def test_labels_of_several_cameras_are_named(tmp_path: Path) -> None:
    """Pictures of two stations in one sensor, or of two sensors of one label."""
    path = write_metashape(tmp_path / "cameras.xml", {"0.jpg": POSES["0.jpg"], "1.jpg": POSES["1.jpg"]})
    path.write_text(path.read_text().replace('label="1"', 'label="0"'))
    [(_, reason)] = read_metashape(path.name, path.read_bytes()).cameras.items()
    assert "is of several cameras of one label; give them, or their sensors, different labels" in str(reason)


@pytest.mark.parametrize("is_stated", [True, False])
def test_sensors_without_a_location_are_noted(tmp_path: Path, *, is_stated: bool) -> None:
    path = write_metashape(tmp_path / "cameras.xml", {"0.jpg": POSES["0.jpg"]})
    slave = '<camera id="1" sensor_id="0" master_id="0" label="s"/></cameras>'
    place = "<location>0 0 0</location></sensor>" if is_stated else "</sensor>"
    path.write_text(path.read_text().replace("</cameras>", slave).replace("</sensor>", place))
    found = read_metashape(path.name, path.read_bytes())
    assert list(found.cameras) == ["0", "s"]
    assert [one.id for one in found.remarks if "states no location" in one.reason] == ([] if is_stated else ["s"])


def test_components_of_metashape_2(tmp_path: Path, pictures: Path) -> None:
    path = write_metashape(tmp_path / "cameras.xml", POSES, in_component=True)
    check(read(pictures, path))
    names = [Path(name).stem for name in POSES]
    text = path.read_text().replace(f'label="{names[0]}"', f'label="{names[0]}" enabled="false"')
    path.write_text(text.replace(f'component_id="0" label="{names[1]}"', f'component_id="1" label="{names[1]}"'))
    found = read(pictures, path)
    assert [one.id for one in found.items] == sorted(names[2:])
    assert [one.id for one in found.remarks if "disabled" in one.reason] == [names[0]]
    assert any("its component has no transform" in fault.reason for fault in found.faults)


@pytest.mark.parametrize("angles", ["heading,pitch,roll", "omega,phi,kappa", "omega_rad,phi_rad,kappa_rad"])
def test_a_table(tmp_path: Path, pictures: Path, angles: str) -> None:
    poses = {name: replace(pose, lens=TABLE_LENS) for name, pose in POSES.items()}
    check(read(pictures, table(tmp_path / "poses.csv", poses, angles, **CALIBRATION)), poses)


def test_a_table_of_longitudes_turns_with_the_grid(tmp_path: Path, pictures: Path) -> None:
    from pyproj import Proj

    lines = ["file,lon,lat,z,yaw,pitch,roll,focal_mm,sensor_width_mm"]
    for name, (lon, lat, _) in lonlat(POSES).items():
        pose = POSES[name]
        true = pose.heading + Proj(UTM).get_factors(lon, lat).meridian_convergence
        lines.append(f"{name},{lon},{lat},{pose.z},{true},{pose.pitch},{pose.roll},21,24")
    (tmp_path / "poses.csv").write_text("\n".join(lines))
    check(read(pictures, tmp_path / "poses.csv"), {n: replace(p, lens=TABLE_LENS) for n, p in POSES.items()})


def test_angles_of_both_conventions_are_those_of_the_camera() -> None:
    for heading, pitch, roll in ((0, 0, 0), (123, -30, 8), (300, -90, 0)):
        pose = Pose(0, 0, 0, heading, pitch, roll)
        np.testing.assert_allclose(rotation_from_heading(heading, pitch, roll), camera_from_world(pose), atol=1e-12)
    # all zero: north is up in a picture that looks straight down
    np.testing.assert_allclose(
        rotation_from_omega_phi_kappa(0, 0, 0), camera_from_world(Pose(0, 0, 0, 0, -90)), atol=1e-12
    )


MODELS = {
    "SIMPLE_PINHOLE": ([140, 81, 59], Lens(SIZE, (140, 140), (81, 59))),
    "PINHOLE": ([140, 141, 81, 59], Lens(SIZE, (140, 141), (81, 59))),
    "SIMPLE_RADIAL": ([140, 81, 59, -0.1], Lens(SIZE, (140, 140), (81, 59), (-0.1,))),
    "RADIAL": ([140, 81, 59, -0.1, 0.02], Lens(SIZE, (140, 140), (81, 59), (-0.1, 0.02))),
    "OPENCV": ([140, 141, 81, 59, -0.1, 0.01, 0.001, -0.002], LENS),
    "OPENCV_FISHEYE": (
        [140, 141, 81, 59, 0.1, 0.02, 0.03, 0.04],
        Lens(SIZE, (140, 141), (81, 59), (0.1, 0.02, 0.03, 0.04), fisheye=True),
    ),
    "FULL_OPENCV": (
        [140, 141, 81, 59, 0.1, 0.02, 0.001, -0.002, 0.03, 0.04, 0.05, 0.06],
        Lens(SIZE, (140, 141), (81, 59), (0.1, 0.02, 0.03), (0.04, 0.05, 0.06), (0.001, -0.002)),
    ),
}  # fmt: skip


@pytest.mark.parametrize("binary", [False, True])
def test_models_of_colmap_one_a_picture(tmp_path: Path, *, binary: bool) -> None:
    """Several sensors in one file: each picture has its own."""
    poses = {
        name: replace(pose, lens=lens) for (name, pose), (_, lens) in zip(ring(7).items(), MODELS.values(), strict=True)
    }
    models = [(name, parameters) for name, (parameters, _) in MODELS.items()]
    found = read_colmap(write_colmap(tmp_path / "model", poses, SAME, binary=binary, models=models))
    for name, pose in poses.items():
        camera = found.cameras[name]
        assert not isinstance(camera, str)
        rays = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 1], (50, 3))
        np.testing.assert_allclose(project_camera_rays(camera.lens(SIZE), rays), project_camera_rays(pose.lens, rays))


def test_a_model_that_is_not_read_is_told(tmp_path: Path, pictures: Path) -> None:
    model = write_colmap(
        tmp_path / "model", POSES, SAME, models=[("FOV", [140, 141, 81, 59, 0.9]), ("PINHOLE", [140, 141, 81, 59])]
    )
    found = read(pictures, model)
    assert len(found.items) == 3
    assert "camera model FOV is not read; run colmap image_undistorter" in found.faults[0].reason


def test_pictures_without_poses_and_the_reverse(tmp_path: Path, pictures: Path) -> None:
    poses = {name: pose for name, pose in POSES.items() if name != "2.jpg"} | {"gone.jpg": POSES["2.jpg"]}
    found = read(pictures, table(tmp_path / "poses.csv", poses, **CALIBRATION))
    assert [(one.id, one.reason) for one in found.faults] == [
        ("2.jpg", "has no camera in poses.csv; add its pose there, or remove it")
    ]
    assert [one.id for one in found.remarks if "without a picture in pictures" in one.reason] == ["gone.jpg"]
    with pytest.raises(InputError, match=r"holds no picture with a camera in poses.csv: has no camera in poses.csv"):
        read(pictures, table(tmp_path / "poses.csv", {"other.jpg": POSES["2.jpg"]}, **CALIBRATION))


RIG = (("left", "0.jpg"), ("left", "1.jpg"), ("right", "0.jpg"), ("right", "1.jpg"))


def test_equal_names_of_two_folders_are_told(tmp_path: Path, pictures: Path) -> None:
    poses = {"left/1.jpg": POSES["1.jpg"], "right/1.jpg": POSES["2.jpg"], "left/3.jpg": POSES["3.jpg"]}
    found = read(pictures, write_colmap(tmp_path / "model", poses, SAME))
    assert [one.path.name for one in found.items] == ["3.jpg"]
    assert "left/1.jpg and right/1.jpg in images.txt may both be it" in found.faults[1].reason


def test_quaternions_of_another_order_are_refused(tmp_path: Path) -> None:
    poses = ring(20)
    with_gps = write_pictures(tmp_path / "gps", list(poses), gps=lonlat(poses))
    model = write_colmap(tmp_path / "bare", poses, LOCAL, order="xyzw")
    with pytest.raises(
        InputError, match=r"(look at the sky|tilted every way|upside down).*check the order of quaternions"
    ):
        read(with_gps, model)


def test_axes_of_another_hand_are_refused(tmp_path: Path, pictures: Path) -> None:
    with pytest.raises(InputError, match=r"its rotation mirrors the picture \(left-handed axes\)"):
        read(pictures, write_metashape(tmp_path / "cameras.xml", POSES, mirror=True))
    # a whole model mirrored: its cameras are the mirror image of their GPS
    poses = {name: replace(pose, pitch=0.0, roll=0.0) for name, pose in ring(12).items()}
    mirrored = {
        name: replace(pose, x=2 * ORIGIN[0] - pose.x, heading=-pose.heading % 360) for name, pose in poses.items()
    }
    with_gps = write_pictures(tmp_path / "gps", list(poses), gps=lonlat(poses))
    with pytest.raises(InputError, match=r"its cameras are the mirror image of their GPS"):
        read(with_gps, write_colmap(tmp_path / "model", mirrored, LOCAL))


def test_axes_of_opengl_are_refused(tmp_path: Path, pictures: Path) -> None:
    poses = {name: replace(pose, roll=pose.roll + 180) for name, pose in POSES.items()}
    with pytest.raises(InputError, match=r"most pictures are upside down; rotations are from the world to camera axes"):
        read(pictures, write_colmap(tmp_path / "model", poses, SAME))


def test_degrees_and_radians_are_told_apart(tmp_path: Path, pictures: Path) -> None:
    poses = {name: replace(pose, lens=TABLE_LENS) for name, pose in POSES.items()}
    with pytest.raises(InputError, match=r"are no degrees; where they are radians, call the fields heading_rad"):
        read(pictures, table(tmp_path / "poses.csv", poses, "heading_rad,pitch_rad,roll_rad", **CALIBRATION))
    shots = json.loads(write_opensfm(tmp_path / "r.json", POSES).read_text())
    for shot in shots[0]["shots"].values():
        shot["rotation"] = np.degrees(shot["rotation"]).tolist()
    (tmp_path / "r.json").write_text(json.dumps(shots))
    with pytest.raises(InputError, match=r"radians is more than a turn \(OpenSfM has radians, not degrees\)"):
        read(pictures, tmp_path / "r.json")


def test_cameras_kilometres_away_are_refused(tmp_path: Path, pictures: Path) -> None:
    poses = {name: replace(pose, x=pose.x + 7_000) for name, pose in POSES.items()}
    with pytest.raises(InputError, match=r"its cameras are 6\.\d km or more from the buildings; name their frame"):
        read(pictures, table(tmp_path / "poses.csv", poses, **CALIBRATION))


def test_a_frame_that_is_named_counts(tmp_path: Path, pictures: Path) -> None:
    from pyproj import Transformer

    other = Transformer.from_crs(UTM, 32633, always_xy=True)
    moved = {}
    for name, pose in POSES.items():
        x, y = other.transform(pose.x, pose.y)
        x1, y1 = other.transform(pose.x, pose.y + 10)
        moved[name] = replace(
            pose, x=x, y=y, heading=pose.heading + np.degrees(np.arctan2(x1 - x, y1 - y)), lens=TABLE_LENS
        )
    path = table(tmp_path / "poses.csv", moved, **CALIBRATION)
    check(read(pictures, path, crs="EPSG:32633"), {n: replace(p, lens=TABLE_LENS) for n, p in POSES.items()})


def test_pictures_of_another_shape_are_set_aside(tmp_path: Path, pictures: Path) -> None:
    Image.new("RGB", (120, 160)).save(pictures / "1.jpg")
    Image.new("RGB", (80, 60)).save(pictures / "2.jpg")
    found = read(pictures, write_colmap(tmp_path / "model", POSES, SAME))
    (fault,) = found.faults
    assert fault.reason == "is 120 x 160 pixels, and its camera is for 160 x 120; give the picture that was posed"
    assert "2.jpg" in [one.path.name for one in found.items]  # at half the size


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_pictures_that_exif_turns_have_cameras_that_turn_with_them(tmp_path: Path, orientation: int) -> None:
    from catalogs.readers.pictures.decoding import read_picture

    rng = np.random.default_rng(0)
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    stored = rng.integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(stored).save(pictures / "1.png", exif=exif)
    posed = replace(POSES["1.jpg"], roll={3: 180.0, 6: 90.0, 8: -90.0}[orientation])
    model = write_colmap(tmp_path / "model", {"1.png": posed}, SAME)
    (one,) = read(pictures, model).items
    upright = read_picture(pictures / "1.png").rgb
    # a pixel of the stored picture and the same of the upright one show one world direction
    rays = rng.uniform([-0.3, -0.2, 1], [0.3, 0.2, 1], (40, 3)) @ camera_from_world(posed)
    at_stored = project_camera_rays(LENS, rays @ camera_from_world(posed).T) * SIZE
    assert one.pose.lens is not None
    at_upright = project_camera_rays(one.pose.lens, rays @ camera_from_world(one.pose).T) * upright.shape[1::-1]
    (x, y), (u, v) = np.floor(at_stored).astype(int).T, np.floor(at_upright).astype(int).T
    assert (stored[y, x] == upright[v, u]).all()


BROKEN = {
    "images.txt": ("no camera at all", "not COLMAP's"),
    "poses.csv": ("file,x,y\na.jpg,1,2", "neither omega, phi and kappa nor heading and pitch"),
    "focal.csv": ("file,x,y,z,heading,pitch\n1.jpg,407000,5381500,3,1,2", "no focal length is given: focal_px"),
    "mm.csv": ("file,x,y,z,heading,pitch,focal\n1.jpg,407000,5381500,3,1,2,24", "call millimetres focal_mm"),
    "cameras.xml": ("<document><chunk/></document>", "is no export of Metashape"),
    "bomb.xml": ('<!DOCTYPE d [<!ENTITY a "b">]><document>&a;</document>', "is no XML that can be read"),
    "r.json": ('[{"cameras": {}, "shots": {}}]', "holds no shots"),
    "list.json": ("[1, 2]", "is no file of cameras"),
    "text.json": ('{"poses": ', "is truncated: the JSON breaks off at line 1"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_files_that_are_none_are_refused_in_one_line(tmp_path: Path, pictures: Path, name: str) -> None:
    content, reason = BROKEN[name]
    (tmp_path / name).write_text(content.replace("a.jpg", "1.jpg"))
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 160 120 140 141 81 59\n")
    with pytest.raises(InputError) as error:
        read(pictures, tmp_path / name)
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("cut", [4, 30, 100, 200])
def test_binary_models_that_are_cut_off_are_refused(tmp_path: Path, pictures: Path, cut: int) -> None:
    folder = write_colmap(tmp_path / "model", POSES, SAME, binary=True)
    content = (folder / "images.bin").read_bytes()
    (folder / "images.bin").write_bytes(content[:cut])
    with pytest.raises(InputError, match=r"images.bin is not COLMAP's"):
        read(pictures, folder)


def test_lenses_pass_through_the_file_of_a_part_of_a_city(tmp_path: Path, pictures: Path) -> None:
    from catalogs.block.extract import read_city_part_file, write_city_part_file

    found = read(pictures, write_colmap(tmp_path / "model", POSES, SAME)).items
    bare = tuple(replace(one, pose=replace(one.pose, lens=None)) for one in found)
    write_city_part_file(tmp_path / "part.npz", {"panoramas": (*found, *bare)})
    assert read_city_part_file(tmp_path / "part.npz")["panoramas"] == (*found, *bare)


def test_local_frames_come_from_the_same_cameras() -> None:
    """The writer of the tests turns cameras and centres alike."""
    pose = POSES["3.jpg"]
    rotation, centre = in_frame(pose, LOCAL)
    turn, scale, shift = LOCAL
    point = camera_position(pose) + np.array([5.0, -3.0, 1.0])
    local = scale * turn.apply(point - ORIGIN) + shift
    np.testing.assert_allclose(
        rotation @ (local - centre), scale * camera_from_world(pose) @ (point - camera_position(pose))
    )


def test_a_rig_has_a_camera_for_each_picture_of_a_name(tmp_path: Path) -> None:
    poses = {f"{side}/{name}": POSES[f"{number}.jpg"] for number, (side, name) in enumerate(RIG)}
    folder = tmp_path / "images"
    for side, name in RIG:
        (folder / side).mkdir(parents=True, exist_ok=True)
        write_pictures(folder / side, [name])
    (folder / "@eaDir").mkdir()
    write_pictures(folder / "@eaDir", ["0.jpg"])
    found = read(folder, write_colmap(tmp_path / "model", poses, SAME))
    assert not found.faults
    places = {one.id: (one.pose.x, one.pose.y) for one in found.items}
    assert places == {
        f"{side}-{Path(name).stem}": pytest.approx((POSES[f"{number}.jpg"].x, POSES[f"{number}.jpg"].y))
        for number, (side, name) in enumerate(RIG)
    }


def test_the_folder_above_a_model_is_named_with_the_model(tmp_path: Path, pictures: Path) -> None:
    (tmp_path / "sparse").mkdir()
    write_colmap(tmp_path / "sparse/0", POSES, SAME)
    with pytest.raises(InputError, match=r"sparse/cameras.bin is missing; did you mean .*sparse/0\?"):
        read(pictures, tmp_path / "sparse")


def test_a_table_of_a_rig_names_folders(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    rows = ["file,x,y,z,heading,pitch,focal_px"]
    for number, (side, name) in enumerate(RIG):
        (folder / side).mkdir(parents=True, exist_ok=True)
        write_pictures(folder / side, [name])
        pose = POSES[f"{number}.jpg"]
        rows.append(f"{side}/{name},{pose.x},{pose.y},{pose.z},{pose.heading},3,140")
    (tmp_path / "cameras.csv").write_text("\n".join(rows))
    found = read(folder, tmp_path / "cameras.csv")
    assert not found.faults
    assert [one.pose.x for one in found.items] == pytest.approx([POSES[f"{n}.jpg"].x for n in range(4)])


def test_a_folder_of_a_rig_has_its_own_cameras(tmp_path: Path) -> None:
    poses = {f"{side}/{name}": POSES[f"{number}.jpg"] for number, (side, name) in enumerate(RIG)}
    folder = tmp_path / "images/right"
    folder.mkdir(parents=True)
    write_pictures(folder, ["0.jpg", "1.jpg"])
    found = read(folder, write_colmap(tmp_path / "model", poses, SAME))
    assert [one.pose.x for one in found.items] == pytest.approx([POSES["2.jpg"].x, POSES["3.jpg"].x])


def test_two_pictures_of_one_camera_are_named(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    for side, name in RIG:
        (folder / side).mkdir(parents=True, exist_ok=True)
        write_pictures(folder / side, [name])
    found = read(
        folder, write_colmap(tmp_path / "model", {"0.jpg": POSES["0.jpg"], "left/1.jpg": POSES["1.jpg"]}, SAME)
    )
    assert [one.id for one in found.items] == ["left-1"]
    assert len(found.faults) == 3
