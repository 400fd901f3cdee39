"""What hides surfaces on a panorama is looked for once, and kept in bits; charts are each taken from panoramas of their own."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace as Value
from typing import Any

import numpy as np
import pytest
import zarr

import tasks.stages.shared.panorama_cameras as module
from benchmarks.painter.street_truth import synthetic_street
from facade_core.atlas.arrays import create_arrays
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.core.types import Pose
from facade_core.imagery.cameras.camera_view import FusedCameraView, PanoramaCamera
from facade_core.imagery.detect.detection import FacesPlatesAndText
from tasks.stages.shared.surface_panorama import SurfacePanorama

IMAGE = np.zeros((2, 4, 3), np.uint8)


def test_a_panorama_is_looked_at_once_and_again_when_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = []

    def in_the_way(image: np.ndarray, pose: Pose) -> np.ndarray:
        looked.append(pose)
        return image[..., 0] > 128

    monkeypatch.setattr(module, "_MASKS", type(module._MASKS)())
    image = np.random.default_rng(0).integers(0, 255, (37, 75, 3), np.uint8)
    path = tmp_path / "a, b.jpg"
    path.write_bytes(b"a picture")
    one = SurfacePanorama(path, Pose(0, 0, 2.5, 0), (1.0, 1.0, 1.0), ())
    for _ in range(2):
        occluded, private = module._occluder_masks(one, image, in_the_way)
        np.testing.assert_array_equal(occluded, image[..., 0] > 128)
        assert private is None
    assert len(looked) == 1
    path.write_bytes(b"another picture")
    module._occluder_masks(one, image, in_the_way)
    assert len(looked) == 2
    mask_bytes = -(-37 * 75 // 8)
    monkeypatch.setattr(module, "MAX_MASK_BYTES", 5 * mask_bytes + 1)
    for heading in range(1, 7):
        module._occluder_masks(one._replace(pose=Pose(0, 0, 2.5, heading)), image, in_the_way)
    assert len(module._MASKS) == 5, "as many as fit"


def to_the_right(image: np.ndarray, pose: Pose) -> np.ndarray:
    return image[..., 0] + np.arange(80) > 70


def test_faces_and_plates_are_occluders_that_are_known_as_private(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    faces = FacesPlatesAndText(faces=np.array([[10.0, 5.0, 20.0, 17.0]]))
    monkeypatch.setattr(module, "detect_on_panorama", lambda *_: faces)
    monkeypatch.setattr(module, "_MASKS", type(module._MASKS)())
    path = tmp_path / "a.jpg"
    path.write_bytes(b"a picture")
    one = SurfacePanorama(path, Pose(0, 0, 2.5, 0), (1.0, 1.0, 1.0), ())
    image = np.zeros((40, 80, 3), np.uint8)
    for _ in range(2):
        occluded, private = module._occluder_masks(one, image, to_the_right)
        assert private is not None
        np.testing.assert_array_equal(private, faces.private_mask((40, 80)))
        np.testing.assert_array_equal(occluded, private | to_the_right(image, one.pose))


def four() -> list[SurfacePanorama]:
    return [SurfacePanorama(Path(f"{x}.jpg"), Pose(x, 0.0, 2.5, 0.0), (1.0, 1.0, 1.0), ()) for x in range(4)]


def test_no_more_is_open_than_one_chart_is_taken_from() -> None:
    one, two, three, broken = four()
    taken = {7: (two, three), 5: (one, two, broken), 9: (broken,), 8: (one, two), 6: (three, broken)}
    opened, alive, shown = [], 0, []

    class Held(PanoramaCamera):
        def __del__(self) -> None:
            nonlocal alive
            alive -= 1

    def opens(asked: SurfacePanorama) -> PanoramaCamera | None:
        nonlocal alive
        opened.append((asked, alive))
        if asked == broken:
            return None
        alive += 1
        return Held(IMAGE, asked.pose, IMAGE[..., 0] > 0, np.ones(3), None)

    def show(chart: int, cameras: Sequence[PanoramaCamera]) -> FusedCameraView | None:
        shown.append((chart, [camera.pose.x for camera in cameras]))
        return None

    found, used = module.collect_chart_views(taken, opens, show)
    assert found == {}
    assert used == {8: [one, two], 5: [one, two], 7: [two, three], 6: [three], 9: []}
    assert shown == [(8, [0, 1]), (5, [0, 1]), (7, [1, 2]), (6, [2])]
    assert opened == [(one, 0), (two, 1), (broken, 2), (three, 1)], "each once, and the first is closed before the last"


def test_cameras_of_charts_are_numbered_as_the_record_names_them() -> None:
    scene = synthetic_street(2, seed=3, occluders=0, texels_per_metre=8.0).scene
    group: Any = zarr.create_group({})
    create_arrays(group, scene.spec, {"exemplars": 0}, crs="EPSG:32635")
    plan: Any = Value(scene=scene, ids=np.arange(len(scene.charts), dtype=np.uint64))
    one, two, three, unused = four()
    used = {0: [unused, two], 1: [one, two, three]}
    found = {}
    for chart, own in ((0, [1]), (1, [0, 2])):
        size = scene.placement.shape(chart)
        camera = np.resize(np.array(own, np.int8), size)
        found[chart] = FusedCameraView(np.zeros((*size, 3), np.uint8), camera >= 0, camera, np.ones(size, np.float32))
    atlas: Any = Value(group=group, plan=plan)
    fields: Any = module.write_panorama_surfaces(atlas, None, module.PanoramaSurfaces(found, used, [], {}))
    digests, told = fields["digests"], fields["cameras"]
    assert fields["is_complete"] is True
    assert sorted(digests) == [f"{0:016x}", f"{1:016x}"]
    assert [name for name, *_ in told] == ["0.jpg", "1.jpg", "2.jpg"]
    assert sum(share for _, share, _ in told) == pytest.approx(1, abs=1e-3)
    for chart, numbers in ((0, {2}), (1, {1, 3})):
        rasters = TexelLayout.of_charts(scene.placement, [chart])
        assert set(read_rasters(group["facade_maps/camera"], scene.placement, rasters).tolist()) == numbers
