"""`streetloom match --cameras`: poses of unposed photos, by structure from motion, GPS and walls."""

from __future__ import annotations

import csv
import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result
from PIL import Image
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from benchmarks.painter.street_truth import render_street_panorama, synthetic_street
from catalogs.block.reader import read_block
from catalogs.readers.pictures.cameras.camera_file import rotation_from_heading
from facade_core.core.types import Lens, Pose
from facade_core.geometry.ground.terrain import Terrain
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.poses.photo_pairs import choose_pairs
from flows.cli.commands import command_line
from tasks.matching import photo_cameras
from tasks.matching.photo_cameras import PhotoCamera, pose_photos
from tasks.matching.structure_from_motion import PhotoGroup
from tests.pipeline.stages import EAST, NORTH, write_block

LONLAT = Transformer.from_crs("EPSG:32635", "EPSG:4326", always_xy=True)
# not importorskip: pycolmap and OpenCV abort in one process
needs_pycolmap = pytest.mark.skipif(
    importlib.util.find_spec("pycolmap") is None, reason="no pycolmap here; `make sfm-setup` installs it"
)
# west, south, width, depth, height of houses on both sides of a street along y = 0
HOUSES = {"a": (0, 9, 24, 10, 12), "b": (24, 9, 20, 10, 15), "c": (0, -19, 20, 10, 11), "d": (22, -19, 22, 10, 13)}
# quarter turns clockwise that show the stored picture upright
ORIENTATIONS = {1: 0, 6: 1, 3: 2, 8: 3}
QUARTER = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def write_photo(path: Path, x: float, y: float, orientation: int = 1) -> None:
    """Write a picture of noise with GPS at a place of the block."""
    lon, lat = LONLAT.transform(EAST + x, NORTH + y)
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif[0x8825] = {1: "N", 2: _dms(lat), 3: "E", 4: _dms(lon)}
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8).repeat(10, 0).repeat(10, 1)
    Image.fromarray(noise).save(path, exif=exif)


def _dms(degrees: float) -> tuple[float, float, float]:
    minutes = (degrees - int(degrees)) * 60
    return float(int(degrees)), float(int(minutes)), (minutes - int(minutes)) * 60


class Truth:
    """Photos along a street: their cameras, and the group that structure from motion would find."""

    def __init__(self, folder: Path, count: int = 24, *, one_way: bool = False) -> None:
        rng = np.random.default_rng(0)
        folder.mkdir()
        x = np.linspace(2, 42, count)
        self.centres = np.stack([EAST + x, NORTH + rng.uniform(-3, 3, count), np.full(count, 1.6)], axis=1)
        headings = np.where(np.arange(count) % 2, 0.0, 180.0) + rng.uniform(-30, 30, count)
        pitches = rng.uniform(-3, 10, count)
        if one_way:
            headings, pitches = rng.uniform(-4, 4, count), rng.uniform(17, 20, count)
        self.rotations = np.array(
            [rotation_from_heading(*angles, rng.normal()) for angles in zip(headings, pitches, strict=True)]
        )
        self.orientations = [(1, 6, 3, 8)[number % 4] for number in range(count)]
        for number, (east, north, _) in enumerate(self.centres.tolist()):
            noise_x, noise_y = rng.normal(0, 2, 2)
            name = folder / f"{number:03}.jpg"
            write_photo(name, east - EAST + noise_x, north - NORTH + noise_y, self.orientations[number])
        points = []
        for west, south, width, depth, height in HOUSES.values():
            front = south if south > 0 else south + depth
            if one_way and south < 0:
                continue
            u, v = rng.uniform(0, 1, (2, 300))
            points.append(np.stack([EAST + west + u * width, np.full(300, NORTH + front), v * height], axis=1))
        self.points = np.concatenate(points)

    def group(self, photos: list[Path]) -> PhotoGroup:
        """Return them in a frame of their own, as stored."""
        turn, scale, shift = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_matrix(), 0.13, np.array([3.0, -5.0, 1.0])
        stored = [np.linalg.matrix_power(QUARTER.T, ORIENTATIONS[o]) for o in self.orientations]
        origin = self.centres.mean(axis=0)
        return PhotoGroup(
            tuple(photos),
            tuple(self.orientations),
            np.array([q @ r @ turn.T for q, r in zip(stored, self.rotations, strict=True)]),
            scale * (self.centres - origin) @ turn.T + shift,
            (Lens((640, 480), (500.0, 500.0), (320.0, 240.0), (-0.05,)),) * len(photos),
            scale * (self.points - origin) @ turn.T + shift,
            np.arange(len(self.points), dtype=np.int32) % len(photos),
        )


@pytest.fixture
def street(tmp_path: Path) -> tuple[Path, Path, Truth]:
    block = write_block(tmp_path / "in", buildings=HOUSES, streets={"1": [(0, 0), (44, 0)]})
    return block, tmp_path / "photos", Truth(tmp_path / "photos")


def match(block: Path, photos: Path, *options: object) -> Result:
    return CliRunner().invoke(command_line, ["match", str(block), str(photos), *map(str, options)])


def found_groups(monkeypatch: pytest.MonkeyPatch, find: Callable[[list[Path]], list[PhotoGroup]]) -> None:
    monkeypatch.setattr(photo_cameras, "require_pycolmap", lambda: None)
    monkeypatch.setattr(photo_cameras, "reconstruct_photos", lambda photos, _: (find(list(photos)), []))


def test_posed_photos_are_read_as_cameras_where_they_were_taken(
    street: tuple[Path, Path, Truth], monkeypatch: pytest.MonkeyPatch
) -> None:
    block, photos, truth = street
    found_groups(monkeypatch, lambda paths: [truth.group(paths)])
    table = block.parent / "cameras.csv"
    ended = match(block, photos, "--cameras", table)
    assert ended.exit_code == 0, ended.output
    assert "24 placed, 0 not" in ended.output
    assert "aligned to walls" in ended.output
    entry = next(line for line in ended.output.splitlines() if "write into the block file" in line)
    keys = yaml.safe_load(block.read_text())
    keys["imagery"] |= yaml.safe_load(entry.partition("block file: ")[2])["imagery"]
    block.write_text(yaml.safe_dump(keys))
    read = {one.id: one.pose for one in read_block(block).panoramas}
    assert len(read) == 24
    poses = [read[f"{number:03}"] for number in range(24)]
    off = [np.hypot(p.x - c[0], p.y - c[1]) for p, c in zip(poses, truth.centres, strict=True)]
    turns = [camera_from_world(p) @ r.T for p, r in zip(poses, truth.rotations, strict=True)]
    assert np.median(off) < 0.5
    assert max(np.degrees(np.arccos(np.clip((np.trace(t) - 1) / 2, -1, 1))) for t in turns) < 1.0
    again = match(block, photos, "--cameras", table)
    assert again.exit_code == 2
    assert "is there; remove it, or name another with --cameras" in again.output


def test_photos_that_all_look_up_one_way_are_levelled_by_the_walls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their own axes tell the pitch that they have in common from the vertical by little."""
    block = write_block(tmp_path / "in", buildings=HOUSES, streets={"1": [(0, 0), (44, 0)]})
    truth = Truth(tmp_path / "photos", one_way=True)
    found_groups(monkeypatch, lambda paths: [truth.group(paths)])
    ended = match(block, tmp_path / "photos", "--cameras", block.parent / "cameras.csv")
    assert "24 placed, 0 not" in ended.output
    rows = list(csv.DictReader((block.parent / "cameras.csv").open()))
    read = [rotation_from_heading(*(float(row[key]) for key in ("heading", "pitch", "roll"))) for row in rows]
    quarters = [np.linalg.matrix_power(QUARTER.T, ORIENTATIONS[o]) for o in truth.orientations]
    turns = [a @ (q @ b).T for a, q, b in zip(read, quarters, truth.rotations, strict=True)]
    assert np.median([np.degrees(np.arccos(np.clip((np.trace(t) - 1) / 2, -1, 1))) for t in turns]) < 0.7


def test_photos_of_no_group_and_of_a_short_group_have_a_reason(
    street: tuple[Path, Path, Truth], monkeypatch: pytest.MonkeyPatch
) -> None:
    block, photos, truth = street
    whole = truth.group(sorted(photos.iterdir()))

    def part(first: int, last: int) -> PhotoGroup:
        own = (whole.camera >= first) & (whole.camera < last)
        return PhotoGroup(
            whole.paths[first:last],
            whole.orientations[first:last],
            whole.rotations[first:last],
            whole.centres[first:last],
            whole.lenses[first:last],
            whole.points[own],
            whole.camera[own] - first,
        )

    found_groups(monkeypatch, lambda _: [part(0, 18), part(18, 21)])
    ended = match(block, photos, "--cameras", block.parent / "cameras.csv")
    assert ended.exit_code == 0, ended.output
    assert "18 placed, 6 not" in ended.output
    assert "018.jpg: the group of 3 overlapping photos from 018.jpg to 020.jpg spans" in ended.output
    assert "023.jpg: overlaps no other photo enough" in ended.output
    found_groups(monkeypatch, lambda _: [])
    ended = match(block, photos, "--cameras", block.parent / "other.csv")
    assert ended.exit_code == 2
    assert "none of its 24 photos can be placed: overlaps no other photo enough" in ended.output
    assert not (block.parent / "other.csv").exists()


def test_photos_that_fit_no_walls_are_placed_by_gps_alone(
    street: tuple[Path, Path, Truth], monkeypatch: pytest.MonkeyPatch
) -> None:
    block, photos, truth = street
    truth.points[:, 2] += np.linspace(20, 200, len(truth.points))
    found_groups(monkeypatch, lambda paths: [truth.group(paths)])
    ended = match(block, photos, "--cameras", block.parent / "cameras.csv")
    assert ended.exit_code == 0, ended.output
    assert "placed by GPS alone, to 3 degrees, as it fits no walls of the block" in ended.output


def test_what_is_missing_is_said_in_one_line(street: tuple[Path, Path, Truth], monkeypatch: pytest.MonkeyPatch) -> None:
    block, photos, _ = street
    table = block.parent / "cameras.csv"
    ended = match(block, photos, "--cameras", table, "--out", block.parent / "matches.csv")
    assert ended.exit_code == 2
    assert "leave out --out and --take" in ended.output
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *_: None if name == "pycolmap" else find_spec(name))
    ended = match(block, photos, "--cameras", table)
    assert ended.exit_code == 2
    assert "pycolmap, which finds the poses, is not installed; `pip install 'streetloom[sfm]'`" in ended.output
    found_groups(monkeypatch, lambda _: [])
    for path in photos.iterdir():
        Image.open(path).save(path, exif=Image.Exif())
    ended = match(block, photos, "--cameras", table)
    assert ended.exit_code == 2
    assert "none of its 24 photos says where it was taken; give their places with --poses" in ended.output


def test_pairs_are_neighbours_by_name_and_by_place() -> None:
    places = np.full((60, 2), np.nan)
    places[0], places[40], places[50] = (0, 0), (5, 0), (500, 0)
    pairs = choose_pairs(places).tolist()
    assert [0, 1] in pairs
    assert [0, 40] in pairs, "near by place"
    assert [0, 50] not in pairs
    assert [0, 30] not in pairs
    assert len(choose_pairs(np.full((3, 2), np.nan))) == 3
    assert pairs == sorted(pairs)


@needs_pycolmap
def test_photos_of_a_painted_street_are_posed(tmp_path: Path) -> None:
    street = synthetic_street(4, seed=2, occluders=1, texels_per_metre=16.0)
    lens, rng = Lens((480, 360), (380.0, 380.0), (240.0, 180.0)), np.random.default_rng(1)
    poses, files = [], []
    ahead = np.array([-street.axis[1], street.axis[0]])
    for number in range(16):
        x, y = street.world_point((number + 0.5) / 16 * street.length, -4.0).tolist()
        heading = float(np.degrees(np.arctan2(*ahead)) + rng.uniform(-15, 15))
        poses.append(Pose(x, y, 1.6, heading, float(rng.uniform(4, 10)), float(rng.normal(0, 1)), lens=lens))
        files.append(tmp_path / f"{number:02}.png")
        Image.fromarray(render_street_panorama(street, poses[-1], 480, seed=number)).save(files[-1])
    true = np.array([camera_position(pose) for pose in poses])
    places = true[:, :2] + rng.normal(0, 1, (16, 2))
    ground = Terrain(0.0, 0.0, 1.0, np.zeros((1, 1)))
    found = pose_photos(street.scene, ground, files, places)
    assert len(found.cameras) >= 12, found.faults
    assert len(found.cameras) + len(found.faults) == 16
    rows = [number for number, file in enumerate(files) if file.name in found.cameras]
    cameras: list[PhotoCamera] = [found.cameras[files[number].name] for number in rows]
    off = np.array([camera.centre for camera in cameras]) - true[rows]
    assert np.median(np.linalg.norm(off, axis=1)) < 1.0
    again = pose_photos(street.scene, ground, files, places)
    assert all((again.cameras[name].centre == camera.centre).all() for name, camera in found.cameras.items())
