"""Networks of a user in a block: what they decide, what they make pending, and how unusable ones are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade
from catalogs.block.reader import read_block
from facade_core.core.errors import InputError
from facade_core.core.provenance import Provenance
from facade_core.core.types import TrainedModelFiles
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import read_newest_journal
from tasks.stages.exemplars.stage import EXEMPLARS
from tests.pipeline.stages import charts_of, redone, started, texture, write_block

pytest.importorskip("onnx", reason="onnx is absent: make setup")

from tests.facade_core.external_networks import save_inpainting_network, save_semantic_network

pytestmark = pytest.mark.long

NETWORKS = {"segmentation": "semantic.onnx", "inpainting": "lama.onnx"}
CAR, BUILDING = 13, 2
# Texels of the wall's raster across and down: 12 by 7 m at the density of its photo.
SIZE = (288, 168)
# A red post before a wall of 12 by 7 m, as shares: left, top, right, bottom.
POST = (0.62, 0.3, 0.67, 1.0)


def write(folder: Path, **keys: Any) -> Path:
    """Write a house with a photo of its front, and one without."""
    houses = {"a": (4, 5, 12, 2.8, 7.0), "b": (24, -8, 12, 2.8, 9.0)}
    texture_settings = {"texels_per_metre": 12}
    return write_block(folder, buildings=houses, streets={"1": [(0, 0), (45, 0)]}, texture=texture_settings, **keys)


def write_post(folder: Path) -> None:
    image = paint_facade(
        (7.0, 12.0), floors=2, columns=4, style="haussmann", metres_per_pixel=0.04, seed=3
    ).image.copy()
    height, width = image.shape[:2]
    left, top, right, bottom = POST
    image[round(top * height) : round(bottom * height), round(left * width) : round(right * width)] = (255, 0, 0)
    (folder / "photos").mkdir(parents=True)
    Image.fromarray(image).save(folder / "photos" / "a-0.png")


def record(out: Path, facade: str) -> dict[str, Any]:
    return next(dict(r) for r in read_newest_journal(out / "store", "facades") if r and r["unit"] == facade)


def test_networks_of_the_block_find_the_post_and_fill_it(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    write_post(folder)
    texture(write(folder), out, stop_before="surfaces")
    before = started(out)
    save_semantic_network(folder / "semantic.onnx", 19, (CAR, BUILDING, BUILDING))
    save_inpainting_network(folder / "lama.onnx", size=(512, 512), highest=255.0)
    block = write(folder, models=NETWORKS)
    assert read_block(block).models == TrainedModelFiles(
        segmentation=folder / "semantic.onnx", inpainting=folder / "lama.onnx"
    )
    made = texture(block, out)
    assert "block's models changed" in (made.said or "")
    units = redone(before, out)
    assert {unit for stage, unit in units if stage == "exemplars"} == {"0", "1"}
    assert ("facades", "a-0") in units
    boxes = np.array(record(out, "a-0")["masked"]) / (*SIZE, *SIZE)
    assert np.abs(boxes - POST).max(axis=1).min() < 0.05
    colour, provenance = next(
        arrays for arrays in charts_of(made.run).values() if (arrays[1] == Provenance.PHOTO).any()
    )
    hole = provenance == Provenance.INPAINTED
    assert hole.any()
    assert not ((colour[..., 0] > 150) & (colour[..., 1] < 90) & hole).any(), "no red is left"


def test_a_changed_network_changes_the_keys_of_what_it_touches(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    block = write(folder, models=NETWORKS)
    save_semantic_network(folder / "semantic.onnx", 19, (CAR, BUILDING, BUILDING))

    def digests(**network: Any) -> dict[str, str]:
        save_inpainting_network(folder / "lama.onnx", **network)
        read = read_block(block)
        return EXEMPLARS.list_units(create_run(read, tmp_path / "out"), read, None, None)[0].digests  # type: ignore[arg-type]

    one, same, other = digests(), digests(), digests(highest=255.0)
    assert one == same
    assert {name for name in one if one[name] != other[name]} == {"models"}


def test_unusable_networks_are_refused_before_any_work(tmp_path: Path) -> None:
    block = write(tmp_path / "in", models=NETWORKS | {"inpainting": None})
    with pytest.raises(InputError, match=r"models\.segmentation: .*semantic\.onnx does not exist"):
        read_block(block)
    save_semantic_network(tmp_path / "in" / "semantic.onnx", 21, (0, 1, 2))
    with pytest.raises(InputError, match=r"models\.segmentation: .*semantic\.onnx: has 21 classes; give a network of"):
        create_run(read_block(block), tmp_path / "out")
    block = write(tmp_path / "in", models={"inpainting": "semantic.onnx"})
    with pytest.raises(InputError, match=r"models\.inpainting: .*semantic\.onnx: its inputs are pixel_values"):
        create_run(read_block(block), tmp_path / "out")
