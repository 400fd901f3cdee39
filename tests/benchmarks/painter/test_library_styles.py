"""The shipped style library: painted again it is the same, small, and described."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.library_styles import LIBRARY_FACADES
from benchmarks.painter.paint_demo import PERIMETER_BLOCK, SEED, SEED_STEP, paint_library_facade
from catalogs.examples.painted_pictures import PAINTED_FOLDERS, shipped_style
from facade_core.core.facade_styles import FACADE_STYLES

LIBRARY = PAINTED_FOLDERS[0]


@pytest.mark.parametrize("style", LIBRARY_FACADES)
def test_a_facade_of_each_style_is_painted_as_it_is_shipped(style: str) -> None:
    facade = min(LIBRARY_FACADES[style], key=lambda one: one.floors * one.columns * one.column_m)
    place = LIBRARY_FACADES[style].index(facade)
    painted = paint_library_facade(facade, seed=SEED + SEED_STEP * place)
    np.testing.assert_array_equal(np.asarray(Image.open(LIBRARY / f"{style}-{place:02d}.labels.png")), painted.labels)
    shipped = np.asarray(Image.open(LIBRARY / f"{style}-{place:02d}.webp"))
    assert np.abs(shipped.astype(float) - painted.image).mean() < 6, "of 255, as compressed"


def test_each_style_has_its_pictures_and_its_card() -> None:
    pictures = sorted(path.stem for path in LIBRARY.glob("*.webp"))
    counts = {style: len(facades) for style, facades in LIBRARY_FACADES.items()} | {
        "perimeter-block": len(PERIMETER_BLOCK)
    }
    assert pictures == sorted(f"{style}-{place:02d}" for style, count in counts.items() for place in range(count))
    assert set(counts) == set(FACADE_STYLES)
    card = Path("docs/styles.md").read_text(encoding="utf-8")
    for style, count in counts.items():
        assert f"| `{style}` | {count} |" in card
    assert sum(path.stat().st_size for path in LIBRARY.iterdir()) < 3e6


def test_a_shipped_style_is_known_by_name_and_content(tmp_path: Path) -> None:
    shutil.copy(LIBRARY / "villa-00.webp", tmp_path / "villa-00.webp")
    assert shipped_style(tmp_path / "villa-00.webp") == "villa"
    shutil.copy(LIBRARY / "villa-00.webp", tmp_path / "villa-77.webp")
    assert shipped_style(tmp_path / "villa-77.webp") is None
    Image.new("RGB", (40, 60)).save(tmp_path / "villa-00.webp")
    assert shipped_style(tmp_path / "villa-00.webp") is None
