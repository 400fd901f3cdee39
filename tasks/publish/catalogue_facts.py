"""Facts of the STAC catalogue about the block, streets, run and models of a snapshot."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import shapely

from catalogs.stac.facts import BlockFacts, DataSourceFacts, ModelFacts, RunFacts, StreetFacts
from facade_core.atlas.journal import Record
from facade_core.export.bodies.footprints import building_footprints
from facade_core.export.models.textured_mesh import build_textured_mesh
from facade_core.facade.layout.model import SHIPPED_LAYOUT_MODEL as LAYOUTS
from facade_core.facade.layout.model import SHIPPED_LAYOUT_NETWORK
from facade_core.parsing.network import SHIPPED_NETWORK as NETWORK
from facade_core.plan.plan import Plan
from tasks.engine.run import Run
from tasks.engine.stage import stored_files
from tasks.publish.item_rows import ItemRows, record_finish_time
from tasks.publish.stored_block import StoredBlock

Records = Sequence[Record | None]
# Tolerance of footprint outlines in the catalogue, metres.
OUTLINE_TOLERANCE_M = 0.1
_ROOT = Path(__file__).resolve().parent.parent.parent


@dataclass(frozen=True, slots=True)
class CataloguedModel:
    """Learned model with the training data that its card lists.

    Attributes
    ----------
    path : file of the model.
    title : title in the catalogue.
    trained_on : licence by data set.
    id : id in the catalogue; that of the file's name if empty.
    """

    path: Path
    title: str
    trained_on: Mapping[str, str]
    id: str = ""

    @property
    def card(self) -> Path:
        """Return the path of the model card."""
        return self.path.with_suffix(".md")


# Parser, layout model and layout network of facades. A block may replace the parser and the others (`run.models`).
FACADE_MODELS = (
    CataloguedModel(
        NETWORK,
        "facade parser",
        {
            "ECP": "MIT (the copy used)",
            "CMP": "CC BY-SA",
            "Swiss street photos": "CC BY 4.0",
            "painted facades": "Apache-2.0",
            "boxes by NanoDet, taught by COCO": "Apache-2.0",
            "ImageNet": "Apache-2.0",
        },
    ),
    CataloguedModel(
        LAYOUTS,
        "facade layout model",
        {"layouts/cmp.jsonl": "CC BY-SA", "layouts/ingolstadt_lod3_metres.jsonl": "CC BY-SA 4.0"},
    ),
    CataloguedModel(
        SHIPPED_LAYOUT_NETWORK,
        "facade layout network",
        {"layouts/cmp.jsonl": "CC BY-SA", "plans of painted facades": "Apache-2.0"},
    ),
)


def block_facts(
    run: Run, block: StoredBlock, snapshot: str, rows: ItemRows, updated: datetime, sources: Sequence[DataSourceFacts]
) -> BlockFacts:
    """Collect the catalogue facts of a block.

    Parameters
    ----------
    run : run of the block.
    block : block as its store holds it.
    snapshot : id of the snapshot.
    rows : rows of the item table.
    updated : end of the work on the block.
    sources : data sources of the block; empty if unknown.
    """
    plan, group = block.plan, block.group
    outlines = list(
        building_footprints(build_textured_mesh(plan.scene, lambda page: np.empty((0, 0, 3), np.uint8))).values()
    )
    return BlockFacts(
        name=run.block,
        crs=run.crs,
        snapshot=snapshot,
        code_version=block.version,
        config_digest=run.key,
        updated=updated,
        footprint=_block_outline(outlines) if outlines else None,
        counts={
            "buildings": len(outlines),
            "facades_done": rows.finished_facade_count,
            "facades_failed": rows.unfinished_facade_count,
            "streets": len(plan.streets),
            "viewpoints": len(plan.viewpoints),
            **{f"objects_{kind}": count for kind, count in plan.objects.counts().items()},
            **{f"plausible_objects_{kind}": count for kind, count in plan.objects.plausible_counts().items()},
            "windows": sum(row["windows"] or 0 for row in rows.facades),
        },
        settings={
            "texture.texels_per_metre": run.texture.texels_per_metre,
            "texture.viewpoint_spacing": plan.scene.spacing,
            "texture.visibility_range": plan.scene.visibility_range,
            "texture.panorama_width": run.texture.panorama_width,
            "texture.walls": run.texture.walls,
            "storey": run.storey,
            "seed": run.seed,
            "geoid_separation": group.attrs.get("geoid_separation"),
        },
        sources=tuple(sources),
        notes=tuple(map(str, group.attrs.get("notes", ()))),
    )


def street_facts(plan: Plan, streets: Records) -> list[StreetFacts]:
    """Collect the catalogue facts of all streets of a block.

    Parameters
    ----------
    plan : plan of the block.
    streets : journal records by street.
    """
    found = []
    for index, (street, record) in enumerate(zip(plan.streets, streets, strict=True)):
        viewpoints = len(plan.street_viewpoints(index))
        state = "unseen" if not viewpoints else record["status"] if record else "waiting"
        found.append(
            StreetFacts(
                id=street.id,
                name=street.name,
                line=street.line,
                state=state,
                reason=(record.get("reason") if record else None)
                or ("no wall is seen from it" if state == "unseen" else None),
                viewpoints=viewpoints,
                viewpoints_done=len(stored_files(record)),
                key=record.get("key") if record else None,
                seconds=round(_work_seconds(record), 2) if record else None,
                updated=record_finish_time(record),
            )
        )
    return found


def run_facts(journals: Mapping[str, Records], ingested: datetime) -> RunFacts:
    """Summarise the work in the journals of a run.

    Parameters
    ----------
    journals : journal records by stage.
    ingested : time of ingestion.
    """
    records = [record for stage in journals.values() for record in stage if record]
    started = [datetime.fromtimestamp(record["started"], UTC) for record in records if "started" in record]
    units = {}
    for stage, journal in journals.items():
        states = Counter(record["status"] if record else "waiting" for record in journal)
        if journal:
            units[stage] = {state: states[state] for state in ("done", "failed", "stale", "waiting") if states[state]}
    return RunFacts(
        started=min([ingested, *started]),
        ended=max([ingested, *(at for record in records if (at := record_finish_time(record)))]),
        units=units,
        seconds=sum(map(_work_seconds, records)),
    )


def models_used(run: Run, facades: Records) -> list[ModelFacts]:
    """List the learned models that the facades of a block were made with.

    A model of the block replaces the shipped one. Empty where no unit used a model.
    """
    used: list[CataloguedModel] = []
    if any(record and "lattice" in record for record in facades):
        parser, layouts, network = FACADE_MODELS
        own = run.models
        used.append(parser if own.parser is None else _custom_model(own.parser, parser))
        if own.layout is None:
            used += [layouts, network]
        else:
            used.append(_custom_model(own.layout, layouts))
            if own.layout_network is not None:
                used.append(_custom_model(own.layout_network, network))
        used += [
            CataloguedModel(path, f"{name} network of the block", {}, name)
            for name, path in (("segmentation", own.segmentation), ("inpainting", own.inpainting))
            if path is not None
        ]
    found = []
    for model in used:
        with model.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        found.append(
            ModelFacts(
                id=model.id or model.path.stem,
                title=model.title,
                file=model.path.relative_to(_ROOT).as_posix() if model.path.is_relative_to(_ROOT) else model.path.name,
                size=model.path.stat().st_size,
                sha256=digest,
                card=model.card if model.card.is_file() else None,
                trained_on=model.trained_on,
            )
        )
    return found


def _custom_model(path: Path, shipped: CataloguedModel) -> CataloguedModel:
    """Return the model of a block that replaces a shipped one; its .json may list training data."""
    record = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    return CataloguedModel(path, f"{shipped.title} of the block", record.get("trained_on", {}))


def _work_seconds(record: Record | None) -> float:
    return sum(record.get("seconds", {}).values()) if record else 0


def _block_outline(footprints: Sequence[shapely.MultiPolygon]) -> shapely.Polygon | shapely.MultiPolygon:
    """Merge footprints without the cracks between neighbours; exterior rings are anticlockwise, as in GeoJSON."""
    closed = (
        shapely.union_all(footprints)
        .buffer(OUTLINE_TOLERANCE_M, join_style="mitre")
        .buffer(-OUTLINE_TOLERANCE_M, join_style="mitre")
    )
    parts = [shapely.geometry.polygon.orient(part) for part in shapely.get_parts(closed.simplify(OUTLINE_TOLERANCE_M))]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
