"""The viewer as a program meets it: a real server over a real run's folder."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from PIL import Image

from facade_core.atlas.journal import read_journal, write_record
from facade_core.atlas.store import BRANCH, commit, open_repository
from facade_core.core.labels import CLASSES
from tasks.viewing.run_view import RunReader
from tests.pipeline.runs import ROOT
from tests.pipeline.viewed import get, viewing


@pytest.fixture(scope="module")
def address(undisturbed: tuple[Path, dict[str, Any]]) -> Iterator[str]:
    with viewing(undisturbed[0]) as place:
        yield place


def refusal(address: str, host: str | None = None, **parameters: Any) -> tuple[int, bytes]:
    request = urllib.request.Request(f"{address}?{urllib.parse.urlencode(parameters)}")
    if host:
        request.add_header("Host", host)
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request, timeout=300)
    return refused.value.code, refused.value.read()


def test_the_map_holds_every_facade_with_its_columns(address: str, undisturbed: tuple[Path, dict[str, Any]]) -> None:
    import pyarrow.parquet as pq

    block = json.loads(get(f"{address}/api/block"))
    items = {row["id"]: row for row in pq.read_table(undisturbed[1]["outputs"]["items"]).to_pylist()}
    assert {facade["id"] for facade in block["facades"]} == set(items)
    for facade in block["facades"]:
        item = items[facade["id"]]
        for column in block["columns"]:
            name = column["name"]
            if name in facade and isinstance(item[name], datetime):
                assert datetime.fromisoformat(facade[name]) == item[name].replace(microsecond=0)
            elif name in facade:
                assert facade[name] == pytest.approx(item[name], abs=0.06), name
        (x0, y0), (x1, y1) = facade["line"]
        assert np.hypot(x1 - x0, y1 - y0) == pytest.approx(facade["width_m"], abs=0.05)
    assert len(block["viewpoints"]) == undisturbed[1]["viewpoints"] == len(block["seen"])
    seen = {number for numbers in block["seen"] for number in numbers}
    fronts = {number for number, facade in enumerate(block["facades"]) if facade["role"] == "street"}
    assert fronts <= seen < set(range(len(block["facades"]))), "backs are seen from no street"
    doubtful = {facade["id"] for facade in block["facades"] if facade["quality"] not in ("good", "height-assumed")}
    assert set(block["to_look_at"]) == doubtful
    assert [name for _, name in block["parse_colours"]] == list(CLASSES)


def test_every_stage_of_a_facade_is_a_picture(address: str) -> None:
    block = json.loads(get(f"{address}/api/block"))
    photos = [facade["id"] for facade in block["facades"] if facade.get("photo")]
    pictures = {facade["source"] for facade in block["facades"] if facade.get("photo")}
    # the others of a pictured building take its style, and show no exemplar
    rest = [f for f in block["facades"] if not f.get("photo") and f["source"] not in pictures]
    others, backs = ([f["id"] for f in rest if f["role"] == role] for role in ("street", "back"))
    assert photos
    assert others
    assert backs
    for facade in (photos[0], others[0]):
        stages = [stage["stage"] for stage in json.loads(get(f"{address}/api/facade", id=facade))["stages"]]
        assert {"parse", "lattice", "layout", "texture", "level-0", "sample", "street"} <= set(stages)
        assert ({"rectified", "hidden"} <= set(stages)) == (facade in photos)
        assert ("source" in stages) == (facade in others)
        for stage in stages:
            image = np.asarray(Image.open(io.BytesIO(get(f"{address}/picture/facade", id=facade, stage=stage))))
            assert image.ndim == 3
            assert image.std() > 5, stage
        small = Image.open(io.BytesIO(get(f"{address}/picture/facade", id=facade, stage="texture", height=40)))
        assert small.height <= 41 < image.shape[0]
    plain = [stage["stage"] for stage in json.loads(get(f"{address}/api/facade", id=backs[0]))["stages"]]
    assert {"parse", "layout", "texture", "source", "level-0", "sample"} <= set(plain)
    for stage in plain:
        assert get(f"{address}/picture/facade", id=backs[0], stage=stage)


def test_the_street_grows_with_its_viewpoints(pictured: Path) -> None:
    with viewing(pictured / "out") as address:
        block = json.loads(get(f"{address}/api/block"))
        street = [one["id"] for one in block["streets"]].index("s3")
        own = [number for number, viewpoint in enumerate(block["viewpoints"]) if viewpoint["street"] == street]

        def draw(name: str, viewpoint: int) -> np.ndarray:
            picture = get(f"{address}/picture/{name}", viewpoint=viewpoint)
            return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)

        def unreached(viewpoint: int) -> float:
            return float((np.abs(draw("grown", viewpoint) - (226, 222, 214)).max(axis=2) < 8).mean())

        shares = [unreached(viewpoint) for viewpoint in (own[0], own[len(own) // 2], own[-1])]
        assert shares[0] > shares[1] > shares[2]
        assert unreached(own[0]) == pytest.approx(shares[0], abs=0.002)  # backwards too
        panorama = draw("panorama", own[0])
        assert panorama.shape[1] == 2 * panorama.shape[0]
        assert panorama.std() > 20
        assert json.loads(get(f"{address}/api/progress"))["done_viewpoints"] == list(range(len(block["viewpoints"])))


def test_what_is_not_there_and_who_may_not_ask(address: str) -> None:
    assert refusal(f"{address}/api/facade", id="../../store") == (404, json.dumps({"reason": (
        "no facade ../../store in this block; its page lists those there are")}, separators=(",", ":")).encode())  # fmt: skip
    assert refusal(f"{address}/picture/panorama", viewpoint="-1")[0] == 404
    assert refusal(f"{address}/picture/facade", id="x", stage="texture")[0] == 404
    assert refusal(f"{address}/page/../app.py")[0] == 404
    assert refusal(f"{address}/api/block", host="other.example")[0] == 400


def test_a_folder_without_a_run_is_refused_in_one_line(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "flows", "view", str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "no run has written here" in done.stderr


def test_what_is_stale_has_not_failed(undisturbed: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    shutil.copytree(undisturbed[0] / "store", tmp_path / "store")
    session = open_repository(tmp_path / "store").writable_session(BRANCH)
    group = zarr.open_group(session.store)
    record = read_journal(group, "streets")[0]
    assert record is not None
    write_record(group, "streets", 0, record | {"status": "stale", "reason": "visible surfaces changed"})
    commit(session, "a street that is out of date")
    said = RunReader(tmp_path).open_newest().run_progress()
    streets = next(stage for stage in said["stages"] if stage["name"] == "streets")
    assert (streets["done"], streets["failed"], streets["stale"]) == (streets["total"] - 1, 0, 1)
    assert said["failures"] == []
    assert said["stale"] == [{"stage": "streets", "unit": record["unit"], "reason": "visible surfaces changed"}]


def test_one_run_in_a_folder_is_opened(undisturbed: tuple[Path, dict[str, Any]]) -> None:
    with viewing(undisturbed[0].parent) as place:
        assert json.loads(get(f"{place}/api/block"))["block"] == undisturbed[1]["block"]
