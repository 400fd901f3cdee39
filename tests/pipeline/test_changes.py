"""A block whose streets were captured twice: what changed is told, and a newer picture does again what it shows."""

from __future__ import annotations

import json
from base64 import b64encode
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.painter.facade import paint_facade as paint
from catalogs.published.snapshot import current_snapshot
from catalogs.query.execution import query
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.atlas.stored_files import read_stored_file
from facade_core.core.errors import InputError
from tasks.engine.store.commits import read_newest_journal
from tasks.engine.store.integrity import find_lost_units
from tasks.publish.task import publish_block
from tasks.viewing import read_previous_capture_picture
from tasks.viewing.run_view import RunReader
from tests.pipeline.stages import BUILDINGS, EAST, NORTH, STREETS, redone, started, texture, write_block

pytestmark = pytest.mark.long

WIDTH, HEIGHT_M, FAR = 1024, 2.5, 600.0
WALL, OTHER = (
    paint((12.0, 7.0), floors=2, columns=columns, style=style, metres_per_pixel=0.04, seed=seed).image
    for columns, style, seed in ((4, "jugend", 2), (3, "functionalist", 7))
)
CHANGED = WALL.copy()
CHANGED[: len(WALL) // 2] = OTHER[: len(WALL) // 2]


def panorama(path: Path, wall: np.ndarray, light: float) -> None:
    """What a camera sees 5 m before the middle of a wall 12 m wide and 7 m high, to the north of it."""
    longitude = ((np.arange(WIDTH) + 0.5) / WIDTH - 0.5) * 2 * np.pi
    latitude = (0.5 - (np.arange(WIDTH // 2) + 0.5) / (WIDTH // 2)) * np.pi
    ahead, right = np.cos(longitude)[None], np.sin(longitude)[None]
    with np.errstate(divide="ignore", over="ignore"):
        away = 5.0 / np.where(ahead > 1e-6, ahead, np.nan)
    x, z = away * right + 6.0, np.tan(latitude)[:, None] * away + HEIGHT_M
    on = (x >= 0) & (x < 12) & (z >= 0) & (z < 7)
    image = np.where(latitude[:, None, None] > 0, (200, 215, 235), (110, 108, 105)) * np.ones((1, WIDTH, 1))
    rows, columns = wall.shape[:2]
    x = np.broadcast_to(x, on.shape)
    image[on] = wall[((7 - z[on]) / 7 * rows).astype(int), (x[on] / 12 * columns).astype(int)]
    Image.fromarray(np.clip(image * light, 0, 255).astype(np.uint8)).save(path, quality=90)


def captured(folder: Path, shots: dict[str, tuple[float, np.ndarray, float, str]]) -> None:
    """Panoramas by name: metres north, the wall, the light and the day."""
    (folder / "panoramas").mkdir(parents=True, exist_ok=True)
    poses = {}
    for name, (north, wall, light, day) in shots.items():
        panorama(folder / "panoramas" / f"{name}.jpg", wall, light)
        place = {"x": EAST + 10, "y": NORTH + north, "z": HEIGHT_M, "heading": 0, "captured": day}
        poses[f"{name}.jpg"] = place
    (folder / "poses.json").write_text(json.dumps({"crs": "EPSG:32635", "poses": poses}))


def test_what_changed_between_two_captures_is_in_the_catalogue(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    shots = {
        "a-old": (0.0, WALL, 1.0, "2021-03-01"),
        "c-old": (FAR, WALL, 0.9, "2021-03-01"),
        "a-new": (0.0, CHANGED, 0.8, "2024-05-17"),
        "c-new": (FAR, WALL, 0.7, "2024-05-17"),
    }
    captured(folder, shots)
    block_file = write_block(
        folder,
        buildings={name: BUILDINGS[name] for name in ("a", "c")},
        streets={name: STREETS[name] for name in ("1", "3")},
        imagery={"panoramas": {"path": "panoramas", "poses": "poses.json"}, "exemplars": {"path": "exemplars"}},
        texture={"texels_per_metre": 6},
    )
    run = texture(block_file, out).run
    publish_block.fn(run, block_file)
    told = query(out, where="compared is not null").set_index("building")
    assert sorted(told.index) == ["a", "c"]
    assert told.capture_date.to_dict() == {"a": "2024-05-17", "c": "2024-05-17"}
    assert set(told.capture_date_before) == {"2021-03-01"}
    assert (told.compared > 0.8).all()
    assert 0.35 < told.changed["a"] < 0.65
    assert told.changed["c"] < 0.05
    assert set(query(out, where="changed > 0.3").building) == {"a"}
    assert told.source["a"].startswith("a-new.jpg")
    # where, and how it was, in the report too
    records = {r["unit"]: r for r in read_newest_journal(out / "store", "facades") if r}
    cells = records[told.id["a"]]["change_map"]
    upper, lower = ("".join(part).replace("-", "") for part in (cells[:6], cells[-4:]))
    assert np.mean([cell > "4" for cell in upper]) > 0.6
    assert set(lower) == {"0"}
    assert "before_file" not in records[told.id["c"]]
    session, changed = open_repository(out / "store").writable_session(BRANCH), records[told.id["a"]]
    data = read_stored_file(open_root(session), changed["before_file"], changed["before_digest"])
    assert b64encode(data).decode() not in json.dumps(changed), "a record says only where it is"
    view = RunReader(out).open_newest()
    assert read_previous_capture_picture(view, view.find_facade_index(told.id["a"])) == data
    with pytest.raises(InputError, match="no picture of how it was before"):
        read_previous_capture_picture(view, view.find_facade_index(told.id["c"]))
    del open_root(session)[changed["before_file"]]
    assert find_lost_units(session) == {"facades": [view.find_facade_index(told.id["a"])]}
    report = current_snapshot(out).report
    text = (report / "index.html").read_text()
    assert "1 of 2 facades that two captures show changed" in text
    (before,) = (report / "images").glob("*-before.webp")
    assert f'src="images/{before.name}"' in text
    assert before.read_bytes() == data
    with Image.open(before) as image:
        assert image.width == 72

    before = started(out)
    captured(folder, shots | {"c-newest": (FAR, CHANGED, 0.9, "2026-02-03")})
    texture(block_file, out)
    done = {unit for stage, unit in redone(before, out) if stage == "facades"}
    assert told.id["c"] in done
    assert all(unit.startswith("c-") for unit in done), (
        "of what it shows alone, and in whose colour its other walls are"
    )
    publish_block.fn(run, block_file)
    again = query(out, where="compared is not null").set_index("building")
    assert again.capture_date.to_dict() == {"a": "2024-05-17", "c": "2026-02-03"}
    assert again.capture_date_before.to_dict() == {"a": "2021-03-01", "c": "2024-05-17"}
    assert set(query(out, where="changed > 0.3").building) == {"a", "c"}
