"""Outcomes, seeds, keys and images: the small parts that a run stands on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from catalogs.readers.pictures.folders import list_images
from facade_core.core.errors import ImageError
from tasks.engine.inputs import digest_inputs
from tasks.engine.outcome import UnitOutcomeCounts, failure_record
from tasks.engine.progress import StageProgress, add_listener, begin_stage, report_progress
from tasks.engine.run import Run
from tasks.engine.seeds import unit_seed
from tasks.stages.exemplars.stage import exemplar_inputs
from tasks.stages.shared.images import read_image_and_mask, read_labels
from tests.settings import block_settings

RUN = Run(out="out", block="b", key="key", crs="EPSG:32635", settings=block_settings(seed=7))


def test_outcomes_add_up() -> None:
    records = [{"unit": "a", "status": "done"}, {"unit": "b", "status": "failed", "reason": "r"}]
    total = UnitOutcomeCounts(skipped=2).add(records) + UnitOutcomeCounts(done=1)
    assert (total.done, total.skipped, total.failed, total.processed_count) == (2, 2, (("b", "r"),), 5)


def test_reasons_are_one_line() -> None:
    assert failure_record("u", "k", KeyError("a\nb"))["reason"].startswith("stopped by an error of its own (KeyError:")
    missing = FileNotFoundError(2, "No such file or directory", "x.jpg")
    assert failure_record("u", "k", missing)["reason"].startswith("x.jpg cannot be read or written (No such file")
    assert "\n" not in failure_record("u", "k", ValueError("a\nb"))["reason"]
    assert failure_record("u", "k", ImageError("x.jpg: broken"))["reason"] == "x.jpg: broken"


def test_seeds_differ_by_unit_and_stage_and_repeat() -> None:
    seeds = {unit_seed(RUN, unit, stage) for unit in ("a", "b") for stage in ("x", "y")}
    assert len(seeds) == 4
    assert unit_seed(RUN, "a", "x") == unit_seed(RUN, "a", "x")


def test_progress_tells_listeners_until_they_stop() -> None:
    seen: list[StageProgress] = []
    stop = add_listener(seen.append)
    begin_stage("s", 4, 1)
    report_progress("s", 2, 1)
    report_progress("s", earlier=1)
    stop()
    report_progress("s", 1)
    assert seen == [StageProgress("s", 1, 4, 0, 1), StageProgress("s", 3, 4, 1, 1), StageProgress("s", 4, 4, 1, 2)]


def test_alpha_is_what_hides(tmp_path: Path) -> None:
    rgba = np.full((4, 6, 4), 200, np.uint8)
    rgba[1, 2, 3] = 0
    Image.fromarray(rgba).save(tmp_path / "a.png")
    rgb, hidden = read_image_and_mask(tmp_path / "a.png")
    assert rgb.shape == (4, 6, 3)
    assert hidden.sum() == 1
    assert hidden[1, 2]


@pytest.mark.parametrize("mode", ["L", "CMYK", "P", "I;16"])
def test_any_mode_becomes_rgb(tmp_path: Path, mode: str) -> None:
    suffix = "jpg" if mode == "CMYK" else "png"
    Image.new(mode, (5, 3)).save(tmp_path / f"a.{suffix}")
    rgb, hidden = read_image_and_mask(tmp_path / f"a.{suffix}")
    assert rgb.shape == (3, 5, 3)
    assert rgb.dtype == np.uint8
    assert not hidden.any()


def test_sixteen_bits_are_scaled_not_clipped(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 4), 0x8000, np.uint16)).save(tmp_path / "a.png")
    assert (read_image_and_mask(tmp_path / "a.png")[0] == 128).all()


def test_exif_turns_the_image(tmp_path: Path) -> None:
    image = Image.new("RGB", (8, 4))
    exif = image.getexif()
    exif[0x0112] = 6
    image.save(tmp_path / "a.jpg", exif=exif)
    assert read_image_and_mask(tmp_path / "a.jpg")[0].shape == (8, 4, 3)


def test_a_truncated_image_is_named(tmp_path: Path) -> None:
    path = tmp_path / "broken.jpg"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)).save(path)
    path.write_bytes(path.read_bytes()[:700])
    with pytest.raises(ImageError, match=r"broken\.jpg"):
        read_image_and_mask(path)


def test_labels_lie_beside_an_exemplar(tmp_path: Path) -> None:
    picture = tmp_path / "a.png"
    Image.fromarray(np.zeros((40, 60, 3), np.uint8)).save(picture)
    assert read_labels(picture, (40, 60)) is None
    labels = np.zeros((40, 60), np.uint8)
    labels[20:] = 1
    Image.fromarray(labels).save(tmp_path / "a.labels.png")
    assert list_images(tmp_path, "exemplar")[0] == (picture,), "labels are no picture of their own"
    read = read_labels(picture, (20, 30))
    assert read is not None
    assert (read.shape, read[9].max(), read[10].min()) == ((20, 30), 0, 1)
    before = digest_inputs(exemplar_inputs(RUN, picture))
    Image.fromarray(labels + np.uint8(40)).save(tmp_path / "a.labels.png")
    assert digest_inputs(exemplar_inputs(RUN, picture)) != before
    with pytest.raises(ImageError, match=r"a\.labels\.png is no label map of a\.png"):
        read_labels(picture, (40, 60))
