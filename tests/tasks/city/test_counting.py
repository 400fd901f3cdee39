"""What a block's map tells of it is what there will be, at every density and size of panoramas."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.city.reading import write_town
from catalogs.block.reader import read_block
from tasks.city.block_counts import BlockCounts, block_counts_from_map, block_counts_from_plan
from tasks.stages.ingest.planning import make_plan


def counted(folder: Path, texels: float, panorama: int = 128) -> BlockCounts:
    write_town(folder, 2, 1, texels=texels, panorama=panorama)
    return block_counts_from_map(read_block(folder / "block.yaml"))


@pytest.mark.parametrize("texels", [3.0, 16.0, 32.0])
def test_texels_are_told_as_they_will_be(tmp_path: Path, texels: float) -> None:
    told = counted(tmp_path, texels)
    plan = make_plan(read_block(tmp_path / "block.yaml"))
    placement = plan.scene.placement
    texels = float((placement.width.astype(float) * placement.height)[plan.in_core].sum()) / 1e6
    assert told.megatexels == pytest.approx(texels, rel=0.35)
    assert told.facades == pytest.approx(len(plan.facades), rel=0.1)
    assert block_counts_from_plan(read_block(tmp_path / "block.yaml")) == {
        "facades": len(plan.facades),
        "megatexels": texels,
    }


def test_a_panorama_twice_as_wide_has_four_times_the_pixels(tmp_path: Path) -> None:
    small, large = (counted(tmp_path, 3.0, width) for width in (128, 256))
    assert large.megapixels == 4 * small.megapixels == 4 * small.viewpoints * 128 * 64 / 1e6
    assert large.megatexels == small.megatexels
