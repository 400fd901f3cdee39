"""A wall without a picture wears the colour that pictures show of its building's other walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from facade_core.atlas.store import open_repository, open_root
from facade_core.core.labels import FacadeClass
from facade_core.core.provenance import Provenance
from facade_core.facade.wall_material import lit_colour
from tasks.engine.context import load_run_plan
from tests.pipeline import stages
from tests.pipeline.test_changes import WALL as PAINTED_WALL
from tests.pipeline.test_changes import captured

pytestmark = pytest.mark.long

# A house at a corner, a street before two of its walls; and one with a wall on a street besides.
BUILDINGS = {"corner": (4, 5, 12, 10, 8.0), "a": (24, -8, 12, 2.8, 9.0)}
STREETS = {"1": [(0, 0), (45, 0)], "2": [(0, -15), (0, 25)]}
RED = np.array([1.0, 0.65, 0.55])


def write(folder: Path) -> Path:
    return stages.write_block(folder, buildings=BUILDINGS, streets=STREETS)


def walls(run) -> dict[str, tuple[np.ndarray, float]]:
    """The colour of the wall of each facade, and the share of it that is a photo's."""
    group, plan, found = open_root(open_repository(run.store).readonly_session("main")), load_run_plan(run), {}
    placement = plan.scene.placement
    for name, chart in zip(plan.facades.id, plan.facades.chart.tolist(), strict=True):
        y, x = int(placement.y[chart]), int(placement.x[chart])
        part = (
            int(placement.page[chart]),
            slice(y, y + int(placement.height[chart])),
            slice(x, x + int(placement.width[chart])),
        )
        image, labels, evidence = (
            np.asarray(group[array][part]) for array in ("atlas/seed", "facade_maps/labels", "atlas/seed_evidence")
        )
        if (labels == FacadeClass.WALL).any():
            found[name] = lit_colour(image[labels == FacadeClass.WALL]), float((evidence == Provenance.PHOTO).mean())
    return found


def hue(colour: np.ndarray) -> float:
    return float(colour[0] / colour[1:].mean())


def test_a_corner_house_is_of_one_colour_as_its_photo_is(tmp_path: Path) -> None:
    block, out = write(tmp_path / "in"), tmp_path / "out"
    run = stages.texture(block, out).run
    before, digest = walls(run), stages.digests_of(out)[0]
    of_corner = sorted(name for name in before if name.startswith("corner"))
    assert len(of_corner) >= 2
    pictured, *others = of_corner
    painted = paint_exemplar_set(2, seed=9, metres_per_pixel=0.2)[1]
    (tmp_path / "in" / "photos").mkdir()
    photo = tmp_path / "in" / "photos" / f"{pictured}.png"
    Image.fromarray((painted.image * RED).astype(np.uint8)).save(photo)
    started = stages.started(out)
    done = stages.texture(write(tmp_path / "in"), out)
    assert "pictures of the building changed" in str(done.said)
    after = walls(done.run)
    assert after[pictured][1] > 0.3
    for name in others:
        assert after[name][1] == 0
        assert hue(after[name][0]) == pytest.approx(hue(after[pictured][0]), rel=0.1)
        assert hue(before[name][0]) < 0.8 * hue(after[name][0])
    redone = {unit for stage, unit in stages.redone(started, out) if stage == "facades"}
    assert redone == set(of_corner), "no facade of another building"

    photo.write_bytes(photo.read_bytes()[:200])  # refused: as if there were none
    refused = stages.texture(write(tmp_path / "in"), out)
    assert refused.refused
    assert {name: colour.tolist() for name, (colour, _) in walls(refused.run).items()} == {
        name: colour.tolist() for name, (colour, _) in before.items()
    }
    photo.unlink()
    photo.parent.rmdir()
    stages.texture(write(tmp_path / "in"), out)
    assert stages.digests_of(out)[0] == digest


def test_what_a_refused_photo_falls_back_to_counts(tmp_path: Path) -> None:
    """A wall of which the photo is refused is made from a panorama: where that changes, so do the walls beside."""

    def write_shown(tint: tuple[float, ...]) -> Path:
        wall = np.clip(PAINTED_WALL * np.array(tint), 0, 255).astype(np.uint8)
        captured(tmp_path / "in", {"one": (0.0, wall, 1.0, "2024-05-17")})
        (tmp_path / "in" / "photos").mkdir(exist_ok=True)
        (tmp_path / "in" / "photos" / "a-0.png").write_bytes(b"no picture")
        return stages.write_block(
            tmp_path / "in",
            buildings={"a": stages.BUILDINGS["a"]},
            streets={"1": stages.STREETS["1"]},
            imagery={
                "photos": {"path": "photos"},
                "panoramas": {"path": "panoramas", "poses": "poses.json"},
                "exemplars": {"path": "exemplars"},
            },
        )

    out = tmp_path / "out"
    before = walls(stages.texture(write_shown((1.0, 0.9, 0.8)), out).run)
    assert before["a-0"][1] > 0.3, "from the panorama"
    again = stages.texture(write_shown((0.5, 0.3, 0.9)), out)
    after = walls(again.run)
    for name in ("a-0", "a-1", "a-2", "a-3"):
        assert hue(after[name][0]) < 0.8 * hue(before[name][0])
    stages.texture(write_shown((0.5, 0.3, 0.9)), tmp_path / "fresh")
    assert stages.digests_of(out) == stages.digests_of(tmp_path / "fresh")
