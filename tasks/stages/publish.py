"""Publish a snapshot: model, pictures, report and items, then point `current` at it."""

from __future__ import annotations

import io
import json
import logging
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import icechunk
import numpy as np
from prefect import task
from prefect.cache_policies import NO_CACHE

from catalogs.published.files import amiss, predecessor_of, write_files
from catalogs.published.items import write_items
from catalogs.published.report import write_report
from catalogs.published.snapshot import Snapshot, current_if_any, make_current, snapshot_in
from catalogs.stac.catalog import write_catalog
from catalogs.stac.snapshot import write_stac
from facade_core.atlas.journal import STAGES, atlas_digest, read_journal
from facade_core.atlas.plan_tables import read_plan
from facade_core.atlas.store import BRANCH, commit, expire, open_repository, open_root, open_table
from facade_core.export import Picture, aerial, aim, fill_unseen, street_level, write_glb
from facade_core.plan import Plan
from facade_core.street.translate import Swatches
from tasks.keys.stage_code import stage_code
from tasks.progress import advance, begin_stage
from tasks.published.catalogue_facts import block_facts, models_used, run_facts, street_facts
from tasks.published.facade_report import facade_sheets, item_rows, masked_regions, set_aside_rows
from tasks.published.limit import over_limit
from tasks.run import Run
from tasks.store.commits import standing_tags
from tasks.store.standing import made_by
from tasks.units.roofs import roof_material, sampler

log = logging.getLogger(__name__)

PICTURE_SIZE = (900, 1440)
# A facade from a photo is so much more worth showing than one from an exemplar.
PHOTO_WORTH = 4
# Viewpoints of a street that are tried for its picture.
LOOKED_AT = 24

T = TypeVar("T")


@task(name="publish", task_run_name="publish", cache_policy=NO_CACHE)
def publish_block(run: Run, block_file: Path | None = None) -> dict[str, Any]:
    """Write published/<snapshot>/ from the newest snapshot, unless `current` already points at it, whole.

    Where too many units failed, `current` stays, and so does the snapshot that it names; the summary says so as `withheld`.

    block_file: what the block was read from: the catalogue names its sources. The snapshot published before is linked as the
    earlier version.
    """
    _stand_by_code(run)
    session = open_repository(run.store).readonly_session(BRANCH)
    out = Path(run.out)
    final, last = snapshot_in(out, session.snapshot_id), current_if_any(out)
    begin_stage("publish", 1)
    if last != final or amiss(final.folder):
        predecessor = predecessor_of(final.folder) if last == final else last.id if last else None
        temporary = Snapshot(_hidden(final, "tmp"))
        temporary.folder.mkdir(parents=True)
        _write(run, session, temporary, block_file, predecessor)
        group = open_root(session)
        write_files(temporary.folder, predecessor, standing_tags(group))
        _put_in_place(temporary, final)
        if withheld := over_limit(run, group):
            advance("publish", 1)
            return final.outcome() | {"withheld": f"{withheld}; look at {final.report / 'index.html'}"}
        make_current(final)
        _forget_history(run, last)
    write_catalog(out)  # also where a run ended between the two
    advance("publish", 1)
    return final.outcome()


def _put_in_place(written: Snapshot[Path], final: Snapshot[Path]) -> None:
    """Give what was written its name; what has that name is damaged."""
    damaged = _hidden(final, "damaged.tmp")
    if final.folder.exists():
        os.replace(final.folder, damaged)
    os.replace(written.folder, final.folder)
    shutil.rmtree(damaged, ignore_errors=True)


def _hidden(snapshot: Snapshot[Path], suffix: str) -> Path:
    """A folder beside a snapshot's that no reader looks into, and that is not there yet."""
    folder = snapshot.folder.with_name(f".{snapshot.id}.{suffix}")
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def _stand_by_code(run: Run) -> None:
    """Have the store say which code publishes it: by another the same texels are another snapshot, in a folder of its own."""
    session = open_repository(run.store).writable_session(BRANCH)
    root = open_root(session)
    if root.attrs.get("published_by") != stage_code("publish"):
        root.attrs["published_by"] = stage_code("publish")
        commit(session, "published by other code")


def _forget_history(run: Run, last: Snapshot[Path] | None) -> None:
    """Expire what no unit needs any more: none is under way, and street ends are tagged. Where somebody still reads what was
    published last, it is left to the next run."""
    try:
        with last.alone() if last else nullcontext(True) as nobody:
            if nobody:
                expire(open_repository(run.store))
    except icechunk.IcechunkError as error:  # an earlier snapshot is damaged: what is published does not depend on it
        log.warning("%s: its history is kept, which cannot be read (%s)", run.store, str(error).splitlines()[0])


def _write(run: Run, session: Any, snapshot: Snapshot[Path], block_file: Path | None, predecessor: str | None) -> None:
    folder = snapshot.folder
    group = open_root(session)
    plan = read_plan(session, run.texels_per_metre)
    scene = plan.scene
    swatches = Swatches(scene, plan.streets, seed=run.seed, roof_material=roof_material(run))
    above = sampler(run)

    viewpoints, records = read_journal(group, "viewpoints"), read_journal(group, "facades")
    pictures = _aim(plan, records)
    pages: dict[int, bytes] = {}

    buildings = open_table(session, "buildings").load()
    (folder / "pages").mkdir()

    def texels(chart: int, rows: slice, columns: slice) -> tuple[np.ndarray, np.ndarray]:
        """Of any chart, as they are in the store."""
        x, y = int(scene.placement.x[chart]), int(scene.placement.y[chart])
        part = (
            int(scene.placement.page[chart]),
            slice(y + rows.start, y + rows.stop),
            slice(x + columns.start, x + columns.stop),
        )
        return group["atlas/colour"][part], group["atlas/provenance"][part]

    def page_jpeg(page: int) -> tuple[int, np.ndarray, bytes]:
        colour, provenance = group["atlas/colour"][page], group["atlas/provenance"][page]
        filled = fill_unseen(
            scene, swatches, page, colour, provenance, levelling=run.levelling, read=texels, aerial=above
        )
        # exports cut their pictures from these pages: as little as can be is lost to being encoded twice
        snapshot.page(page).write_bytes(_jpeg(filled, 95, subsampling=0))
        return page, filled, _jpeg(filled, 90)

    with ThreadPoolExecutor(2) as threads:
        # a few pages at a time: memory stays bounded however many there are
        for start in range(0, scene.spec.pages, 4):
            for page, filled, jpeg in threads.map(page_jpeg, range(start, min(start + 4, scene.spec.pages))):
                pages[page] = jpeg
                for picture in pictures.values():
                    picture.paint(page, filled)
    write_glb(folder / "block.glb", scene, pages, dict(enumerate(map(str, buildings.id.values))))

    images = folder / "report" / "images"
    images.mkdir(parents=True)
    for name, picture in pictures.items():
        (images / f"{name}.jpg").write_bytes(_jpeg(_halve(picture.rgb), 90))
    shown = [v for v in _spread([i for i, r in enumerate(viewpoints) if r], 6)]
    for viewpoint in shown:
        (images / f"panorama-{viewpoint}.jpg").write_bytes(_jpeg(group["panoramas/rgb"][viewpoint], 88))
    facade_sheets(group, plan, records, images)

    ingested, version = datetime.fromtimestamp(group.attrs["ingested"], UTC), made_by(group)
    rows = item_rows(run, plan, buildings, records, version, ingested)
    kinds = {"poses": "panorama", "exemplars": "exemplar", "textures": "building"}
    broken = [
        *map(tuple, group.attrs["set_aside"]),
        *(
            (kind, record["unit"], record["reason"])
            for stage, kind in kinds.items()
            for record in read_journal(group, stage)
            if record and record["status"] == "failed"
        ),
    ]
    broken += [
        ("street", record["unit"], f"stale: {record['reason']}" if record["status"] == "stale" else record["reason"])
        for record in read_journal(group, "streets")
        if record and record["status"] in ("stale", "failed")
    ]
    aside = set_aside_rows(run, broken, version, ingested)
    write_items(folder / "items.parquet", rows + aside, run.crs)
    done = sum(r["status"] == "done" for r in rows)
    summary = {
        "block": run.block,
        "facades_done": done,
        "facades_failed": len(rows) - done,
        "viewpoints": len(viewpoints),
        "atlas_digest": atlas_digest(group),
    }
    (folder / "masked.json").write_text(json.dumps(masked_regions(records), indent=1))
    (folder / "summary.json").write_text(json.dumps(summary, indent=1))
    write_report(
        folder / "report",
        summary=summary | {"crs": run.crs, "code_version": version, "notes": group.attrs.get("notes", [])},
        rows=rows,
        set_aside=aside,
        records={r["unit"]: r for r in records if r},
        streets=[r for r in read_journal(group, "streets") if r],
        viewpoints=[r for r in viewpoints if r],
        panoramas=[(record["unit"], f"images/panorama-{v}.jpg") for v in shown if (record := viewpoints[v])],
        poses=[r for r in read_journal(group, "poses") if r and r["status"] == "done"],
        heights=Counter(map(str, buildings.height_source.values)),
    )
    journals = {stage: read_journal(group, stage) for stage in STAGES}
    work = run_facts(journals, ingested)
    write_stac(
        folder,
        rows=rows + aside,
        block=block_facts(run, plan, group, session.snapshot_id, rows, work.ended, block_file),
        streets=street_facts(plan, journals["streets"], journals["viewpoints"]),
        run=work,
        models=models_used(run, records, viewpoints),
        predecessor=predecessor,
    )


def _aim(plan: Plan, records: Sequence[dict[str, Any] | None]) -> dict[str, Picture]:
    """The block from above, and along up to three streets, from where most of the facades is seen, photos before others."""
    worth = np.zeros(len(plan.scene.charts))
    for chart, record in zip(plan.facades.chart, records, strict=True):
        worth[chart] = 1 + PHOTO_WORTH * (record or {}).get("provenance", [0])[-1]
    pictures = {"above": aim(plan.scene, aerial(plan.scene, PICTURE_SIZE, worth))}
    streets = sorted({v.street for v in plan.viewpoints})
    for number, street in enumerate(_spread(streets, 3)):
        own = [v for v in plan.viewpoints if v.street == street]
        camera = street_level(plan.scene, _spread(own, LOOKED_AT), PICTURE_SIZE, worth)
        pictures[f"street-{number}"] = aim(plan.scene, camera)
    return pictures


def _spread(values: list[T], count: int) -> list[T]:
    """At most `count` of the values, evenly spread."""
    if len(values) <= count:
        return values
    return [values[round(i * (len(values) - 1) / (count - 1))] for i in range(count)]


def _halve(rgb: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.resize(rgb, (rgb.shape[1] // 2, rgb.shape[0] // 2), interpolation=cv2.INTER_AREA)


def _jpeg(rgb: np.ndarray, quality: int, **options: int) -> bytes:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "JPEG", quality=quality, **options)
    return buffer.getvalue()
