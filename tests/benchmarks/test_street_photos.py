"""The contact sheet of photos: its cases, and what it draws of a photo that is read and of one that is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.painter.facade import paint_facade
from benchmarks.street_photos import HALVES, ROW_PX, TEXT_PX, VERDICTS, PhotoCase, count_verdicts, draw_case, read_cases


def test_all_halves_have_a_verdict_for_every_photo_and_share_none() -> None:
    halves = {name: read_cases(name) for name in HALVES}
    paths = [case.path for cases in halves.values() for case in cases]
    assert len(paths) == len(set(paths))
    for case in (case for cases in halves.values() for case in cases):
        assert {case.before, case.after} <= set(VERDICTS), case.path
    for name, cases in halves.items():
        rectified = [case.rectified for case in cases]
        assert (rectified.count(False), rectified.count(True)) == (
            16 if name == "tuned_3" else 12,
            0 if "_" in name else 12,
        )


def test_verdicts_are_counted_by_kind() -> None:
    cases = [PhotoCase("a", False, "refused", "good"), PhotoCase("b", True, "good", "good")]
    after, before = (count_verdicts(cases, verdict) for verdict in ("after", "before"))
    assert (after["taken"]["good"], after["taken"]["refused"], after["rectified"]["good"]) == (1, 0, 1)
    assert (before["taken"]["good"], before["taken"]["refused"], before["rectified"]["good"]) == (0, 1, 1)
    assert tuple(after["taken"]) == VERDICTS


def test_photos_are_drawn_with_their_outline_and_refused_ones_with_their_reason(tmp_path: Path) -> None:
    facade = paint_facade((12.0, 10.0), floors=4, columns=3, style="haussmann", metres_per_pixel=0.03, seed=2)
    Image.fromarray(facade.image).save(tmp_path / "good.png")
    Image.new("RGB", (300, 200), (90, 90, 90)).save(tmp_path / "grey.png")
    drawn, refused = (
        draw_case(tmp_path, PhotoCase(name, rectified, "good", "good"))
        for name, rectified in (("good.png", True), ("grey.png", False))
    )
    assert drawn.shape == refused.shape
    assert drawn.shape[0] == ROW_PX + TEXT_PX
    assert (drawn.reshape(-1, 3) == (255, 40, 200)).all(axis=1).any(), "the outline"
    third = drawn.shape[1] // 3
    assert (drawn[TEXT_PX:, third:] < 255).any()
    assert (refused[TEXT_PX:, third:] == 255).all()
    assert np.abs(refused[14:TEXT_PX].astype(int) - 255).max() > 100, "the reason"
