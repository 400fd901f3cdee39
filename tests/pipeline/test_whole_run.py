"""The whole run, as a user types it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
import xarray as xr
import zarr
from PIL import Image

from catalogs.block.reader import read_block
from catalogs.query.execution import query
from facade_core.atlas.journal import VOLATILE_FIELDS, atlas_digest
from facade_core.atlas.rasters import TexelLayout, read_rasters
from facade_core.atlas.store import open_repository
from facade_core.core.errors import StoreError
from facade_core.core.provenance import Provenance
from facade_core.plan.plan_tables import read_plan
from facade_core.street.continuation import CONTINUATION
from tasks.engine.run_key import create_run
from tasks.engine.store.commits import read_newest_journal
from tasks.publish.task import publish_block
from tasks.stages.order import STAGE_NAMES
from tests.pipeline import stages
from tests.pipeline.runs import ALONE, ROOT, TYPED, command, environment, run
from tests.pipeline.stages import texture, write_photo

STAGE_GROUPS = ("atlas", "charts", "mesh", "facades", "viewpoints", "streets", "buildings", "facade_maps")

Run = tuple[Path, dict[str, Any]]


def test_everything_is_done_and_published(undisturbed: Run) -> None:
    out, summary = undisturbed
    assert summary["facades_failed"] == 0
    assert summary["facades_done"] >= 5
    assert summary["viewpoints"] >= 10
    assert summary["units_skipped"] == 0
    for path in (*summary["outputs"]["glb"], summary["outputs"]["report"], summary["outputs"]["items"]):
        assert Path(path).stat().st_size > 1000
    assert (out / "current").read_text().strip() in summary["outputs"]["report"]


def test_a_preview_of_a_street_was_drawn_before_the_surfaces(undisturbed: Run) -> None:
    out, _ = undisturbed
    picture = np.asarray(Image.open(out / "preview.jpg"))
    assert picture.shape == (540, 960, 3)
    assert picture.std() > 20
    first = min(record["started"] for record in read_newest_journal(out / "store", "surfaces") if record)
    assert (out / "preview.jpg").stat().st_mtime < first


def test_all_sources_reach_the_atlas_and_no_texel_is_left(undisturbed: Run) -> None:
    out, summary = undisturbed
    session = open_repository(out / "store").readonly_session("main")
    group, placement = zarr.open_group(session.store, mode="r"), read_plan(session).scene.placement
    charts = TexelLayout.of_charts(placement, range(len(placement.page)))
    colour, provenance = (read_rasters(group[f"atlas/{name}"], placement, charts) for name in ("colour", "provenance"))
    assert set(np.unique(provenance)) == {
        Provenance.MATERIAL,
        Provenance.SYNTHESISED,
        Provenance.INPAINTED,
        Provenance.PHOTO,
    }
    assert colour[provenance == Provenance.MATERIAL].std() > 10
    assert not group["atlas/street_views"][:].any(), "no picture shows the ground"
    assert atlas_digest(group) == summary["atlas_digest"]


def test_photo_texels_are_the_photos(undisturbed: Run) -> None:
    out, _ = undisturbed
    group = zarr.open_group(open_repository(out / "store").readonly_session("main").store, mode="r")
    photo = group["atlas/seed_evidence"][:] == Provenance.PHOTO
    np.testing.assert_array_equal(group["atlas/colour"][:][photo], group["facade_maps/evidence"][:][photo])


def test_xarray_opens_every_group_with_dimensions_and_crs(undisturbed: Run) -> None:
    out, _ = undisturbed
    store = open_repository(out / "store").readonly_session("main").store
    for name in STAGE_GROUPS:
        dataset = xr.open_zarr(store, group=name, consolidated=False)
        assert not any(str(dim).startswith("dim_") for dim in dataset.sizes), name
        assert dataset.attrs["crs"] == "EPSG:32635", name


def test_workers_wrote_and_are_named_in_the_journal(undisturbed: Run) -> None:
    out, _ = undisturbed
    for stage in ("facades", "streets", "surfaces"):
        records = read_newest_journal(out / "store", stage)
        assert all(r and r["status"] == "done" and r["seconds"] for r in records)
        assert {r["worker"] for r in records if r} <= {"0", "1"}


def test_the_model_opens_with_its_textures(undisturbed: Run) -> None:
    _, summary = undisturbed
    model = trimesh.load(summary["outputs"]["glb"][0])
    textured = [part for part in model.geometry.values() if part.visual.material.name != "surroundings"]
    assert 0 < len(textured) < len(model.geometry)
    for part in textured:
        image = np.asarray(part.visual.material.baseColorTexture.convert("RGB"))
        assert image.std() > 3  # a tile with ground alone is as even as that
        assert part.visual.uv.min() >= 0
        assert part.visual.uv.max() <= 1
    low, high = (
        np.min([part.bounds[0] for part in textured], axis=0),
        np.max([part.bounds[1] for part in textured], axis=0),
    )
    assert low[1] == pytest.approx(0, abs=0.01)  # y is up
    assert 8 < high[1] < 40


def test_items_answer_queries(undisturbed: Run) -> None:
    out, summary = undisturbed
    assert len(query(out)) == summary["facades_done"]
    hidden = query(out, where="occluded > 0 and photo > 0.5")
    assert 0 < len(hidden) < summary["facades_done"]
    done = subprocess.run(
        [sys.executable, "-m", "flows", "query", str(out), "--where", "floors >= 1", "--format", "geojson"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert len(json.loads(done.stdout)["features"]) == summary["facades_done"]


def test_the_report_shows_every_street_front_and_no_outside_address(undisturbed: Run) -> None:
    _, summary = undisturbed
    report = Path(summary["outputs"]["report"])
    pages = {path: path.read_text() for path in report.parent.rglob("*.html")}
    facades = query(Path(summary["out"]))
    assert "street" in set(facades["role"])
    for name, role in zip(facades["id"], facades["role"], strict=True):
        assert sum(f'id="{name}"' in page for page in pages.values()) == (role == "street")
    for path, page in pages.items():
        for part in page.split('src="')[1:]:
            assert (path.parent / part.split('"')[0]).is_file()
        assert "http:" not in page
        assert "https:" not in page


@pytest.mark.long
def test_again_does_no_unit_twice(block: Path, undisturbed: Run) -> None:
    out, first = undisturbed
    again = run(block, out, program=TYPED)
    assert again["units_done"] == 0
    assert again["units_skipped"] == first["units_done"]
    assert again["atlas_digest"] == first["atlas_digest"]
    assert again["outputs"] == first["outputs"]


@pytest.mark.long
def test_one_worker_without_a_network_makes_the_same_atlas(block: Path, undisturbed: Run, tmp_path: Path) -> None:
    """Nothing is fetched: the run sees no network but loopback, where the machine lets a test make such a place."""
    can = subprocess.run([*ALONE, "true"], capture_output=True, check=False).returncode == 0
    alone = run(block, tmp_path / "out", workers=1, within=ALONE if can else (), program=TYPED)
    assert alone["atlas_digest"] == undisturbed[1]["atlas_digest"]
    for stage in STAGE_NAMES:  # of a record, too, only the fields listed as volatile may differ
        one, two = (
            [
                {k: v for k, v in (r or {}).items() if k not in VOLATILE_FIELDS}
                for r in read_newest_journal(out / "store", stage)
            ]
            for out in (undisturbed[0], tmp_path / "out")
        )
        assert one == two
    assert {r["worker"] for r in read_newest_journal(tmp_path / "out" / "store", "facades") if r} == {"serial"}


@pytest.mark.long
def test_walls_left_to_their_material(tmp_path: Path) -> None:
    """With `walls: translate` no exemplar is needed, and every wall that has no photo shows its material."""
    write_photo(tmp_path / "in", "a-0", 1)
    block = stages.write_block(tmp_path / "in", texture={"walls": "translate"})
    made = texture(block, tmp_path / "out")
    summary = publish_block.fn(made.run, block)
    assert summary["facades_failed"] == 0
    group = zarr.open_group(open_repository(tmp_path / "out" / "store").readonly_session("main").store, mode="r")
    sources = set(np.unique(group["atlas/provenance"][:]))
    assert sources >= {Provenance.MATERIAL, Provenance.PHOTO}
    assert Provenance.TRANSLATED not in sources
    assert set(query(tmp_path / "out", where="photo is null")["source"]) == {"translator"}


@pytest.mark.long
def test_ground_between_pictures_is_continued(pictured_copy: Path) -> None:
    """What streets decided is in the store, the catalogue and the report."""
    block, out = pictured_copy / "in" / "block.yaml", pictured_copy / "out"
    publish_block.fn(create_run(read_block(block), out), block)
    session = open_repository(out / "store").readonly_session("main")
    group, plan = zarr.open_group(session.store, mode="r"), read_plan(session)
    provenance, views = (group[f"atlas/{name}"][:] for name in ("provenance", "street_views"))
    assert (provenance == Provenance.PHOTO).any()
    np.testing.assert_array_equal(views > 0, provenance == Provenance.TRANSLATED)
    for street, record in enumerate(read_newest_journal(out / "store", "streets")):
        assert record
        files = record["files"]
        item = next((out / "published").glob(f"*/stac/streets/{record['unit']}.json"))
        said = json.loads(item.read_text())["properties"]
        assert said["streetloom:viewpoints"] == len(plan.street_viewpoints(street))
        assert said["streetloom:viewpoints_done"] == len(files) > 1
        for path in files:
            assert group[path].shape[:2] == (CONTINUATION.panorama_width // 2, CONTINUATION.panorama_width)


@pytest.mark.long
def test_a_broken_photo_and_one_of_no_facade_are_set_aside(tmp_path: Path) -> None:
    for name in ("a-0", "b-0"):
        write_photo(tmp_path / "in", name, 1)
    block = stages.write_block(tmp_path / "in")
    photo, other = sorted((tmp_path / "in" / "photos").iterdir())
    other.rename(other.with_name("w999-0.png"))  # no facade has this id
    photo.write_bytes(photo.read_bytes()[: photo.stat().st_size // 2])
    summary = run(block, tmp_path / "out", workers=1)
    assert not summary["failures"]
    assert {one["unit"] for one in summary["refused"]} == {photo.stem, "w999-0.png"}
    assert "w999-0" in Path(summary["outputs"]["report"]).read_text()
    assert summary["facades_failed"] == 0
    told = query(tmp_path / "out", where="reason is not null")
    assert list(zip(told["kind"], told["id"], told["status"], strict=True)) == [
        ("facade", photo.stem, "done"),  # from an exemplar
        ("photo", "w999-0.png", "refused"),
    ]
    assert photo.name in told["reason"][0]
    assert Path(summary["outputs"]["glb"][0]).is_file()


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_ended_ends_and_leaves_nothing_running(
    smallest: Path, tmp_path: Path, number: signal.Signals
) -> None:
    """Its Prefect server and its workers go with it, and a second run in the same folder is refused before that."""
    process = subprocess.Popen(
        command(smallest, tmp_path / "out", 2),
        cwd=ROOT,
        env=environment(tmp_path),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    deadline = time.monotonic() + 300
    while not _has_begun(tmp_path / "out" / "store") and time.monotonic() < deadline:
        time.sleep(0.2)
    family = {child.pid for child in psutil.Process(process.pid).children(recursive=True)}
    assert len(family) >= 4  # guard, server and two workers
    if number == signal.SIGKILL:
        process.send_signal(signal.SIGSTOP)  # or it may be over before the second has begun
        second = subprocess.run(
            command(smallest, tmp_path / "out", 1), cwd=ROOT, env=environment(tmp_path), capture_output=True, text=True
        )
        assert second.returncode == 2
        assert "another run is at work" in second.stderr
        process.kill()
    else:
        os.killpg(process.pid, number)  # as a terminal's Ctrl-C does
    _, said = process.communicate(timeout=300)
    if number != signal.SIGKILL:
        assert process.returncode == 128 + number
        assert b"run the same command to go on" in said
    if number == signal.SIGINT:  # a supervisor's SIGTERM also meets Prefect's own handler, which may be heard
        assert b"Traceback" not in said
    deadline = time.monotonic() + 300
    while (left := [pid for pid in family if _runs(pid)]) and time.monotonic() < deadline:
        time.sleep(0.2)
    assert not left


def _has_begun(store: Path) -> bool:
    """Whether a unit is done, so that workers are at work."""
    try:
        return any(read_newest_journal(store, "exemplars"))
    except (StoreError, KeyError, FileNotFoundError):
        return False


def _runs(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
