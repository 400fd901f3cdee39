"""Content of the report of a block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from catalogs.published.columns import ItemRow
from catalogs.published.report import ReportContent, ReportExemplar, write_report
from catalogs.published.snapshot import SnapshotFolder
from facade_core.facade.exemplar_quality import USUAL_SHADED_SHARE
from facade_core.geometry.walls import WALL_ROLES, WallRole
from tasks.engine.run import Run
from tasks.publish.images import ReportImages
from tasks.publish.item_rows import ItemRows, pose_height_change
from tasks.publish.review import MIN_CHANGE, review_priority
from tasks.publish.stored_block import StoredBlock
from tasks.stages.facades.record import names_source

# Pose columns of a panorama that shares no view with another.
_UNSHARED_POSE = {"shared": 0, "apart_before_m": None, "apart_m": None, "kept_alone": ""}


def write_block_report(
    snapshot: SnapshotFolder[Path],
    run: Run,
    block: StoredBlock,
    rows: ItemRows,
    summary: Mapping[str, object],
    images: ReportImages,
) -> None:
    """Write the report of a block into the snapshot that already holds its images and models.

    Parameters
    ----------
    snapshot : snapshot that is written.
    run : run of the block.
    block : block as its store holds it.
    rows : rows of the item table.
    summary : summary of the block.
    images : images in the folder.
    """
    journals = {stage: [record for record in journal if record] for stage, journal in block.records_by_stage.items()}
    styled = [row["source"] for row in rows.facades if row["synthesised"]]
    notes = block.group.attrs.get("notes", [])
    facades = block.plan.facades
    reviewed: list[ItemRow] = [
        {**row, "look_first": review_priority(facades, index, record, row["quality"])}
        for index, (row, record) in enumerate(zip(rows.facades, block.records, strict=True))
        if row["role"] == WALL_ROLES[WallRole.STREET] or row["status"] == "failed"
    ]
    models = [path for path in (snapshot.model, snapshot.overview, snapshot.tiles) if path.is_file()]
    write_report(
        snapshot.report,
        ReportContent(
            summary={**summary, "crs": run.crs, "code_version": block.version, "notes": notes},
            rows=reviewed,
            set_aside=rows.set_aside,
            records={record["unit"]: record for record in block.records if record},
            streets=journals["streets"],
            poses=[
                {**_UNSHARED_POSE, **record, "raised_m": pose_height_change(record, stated)}
                for record, stated in zip(block.refined_poses, block.plan.poses, strict=True)
                if record and record["status"] == "done" and not record.get("is_unused")
            ],
            heights=Counter(block.buildings["height_source"]),
            views=images.views,
            sheets=images.sheets,
            textures_only=images.textures_only,
            exemplars=[
                ReportExemplar(
                    {
                        **record,
                        "shaded": record["shaded"] if record["shaded"] > USUAL_SHADED_SHARE else 0,
                    },
                    pictures=images.exemplars.get(record["unit"], ()),
                    used=sum(names_source(source, record["unit"]) for source in styled),
                )
                for record in block.journals["exemplars"]
                if record and record["status"] == "done"
            ],
            models=[path.relative_to(snapshot.folder).as_posix() for path in models],
            min_change=MIN_CHANGE,
            before=images.before,
        ),
    )
