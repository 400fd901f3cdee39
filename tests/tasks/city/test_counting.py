"""What a block's map tells of it is what there will be, at every density and size of panoramas."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from benchmarks.city.reading import write_town
from catalogs.block.reader import read_block
from catalogs.readers.pictures.picture_kinds import LABEL_MAP_SUFFIX
from facade_core.geometry.charts import ChartKind
from tasks.city.block_counts import BlockCounts, block_counts_from_map, block_counts_from_plan
from tasks.stages.ingest.planning import make_plan
from tests.pipeline.stages import write_block, write_photo


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
        "viewpoints": len(plan.viewpoints),
        "ground": int((plan.scene.charts.kind == ChartKind.GROUND).sum()),
        "megatexels": texels,
        "megapixels": len(plan.viewpoints) * 128 * 64 / 1e6,
    }


def test_a_panorama_twice_as_wide_has_four_times_the_pixels(tmp_path: Path) -> None:
    small, large = (counted(tmp_path, 3.0, width) for width in (128, 256))
    assert large.megapixels == 4 * small.megapixels == 4 * small.viewpoints * 128 * 64 / 1e6
    assert large.megatexels == small.megatexels


def test_pictures_are_counted_and_labelled_exemplars_are_not_parsed(tmp_path: Path) -> None:
    write_photo(tmp_path, "a-0", 1)
    block = read_block(write_block(tmp_path))
    told = block_counts_from_map(block)
    photo, *exemplars = (Image.open(path).size for path in (block.photos["a-0"], *block.exemplars))
    parsed = sum(width * height for width, height in exemplars) / 1e6
    assert (told.photos, told.photo_megapixels) == (1, pytest.approx(photo[0] * photo[1] / 1e6))
    assert (told.exemplars, told.exemplar_megapixels) == (2, pytest.approx(parsed))
    for path, (width, height) in zip(block.exemplars, exemplars, strict=True):
        Image.new("L", (width, height)).save(path.with_suffix(f"{LABEL_MAP_SUFFIX}"))
    told = block_counts_from_map(read_block(tmp_path / "block.yaml"))
    assert (told.exemplars, told.exemplar_megapixels) == (2, 0)
