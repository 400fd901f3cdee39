"""Snapshots of a run's store for the viewer, which follows the newest one."""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any, TypedDict, cast

import icechunk
import numpy as np

from catalogs.published.columns import SHOWN_COLUMNS, ItemColumn
from catalogs.published.facade_values import FacadeSource
from catalogs.published.folders import Folder
from catalogs.published.report import facades_to_review
from catalogs.published.snapshot import find_current_snapshot
from facade_core.atlas.journal import Record
from facade_core.atlas.store import BRANCH, open_repository, open_root
from facade_core.atlas.table_schema import TableValues
from facade_core.core.arrays import Float64Array, FloatArray, IntArray
from facade_core.core.errors import InputError, StoreError
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import PARSE_COLOURS
from facade_core.core.zarr_types import StoreGroup
from facade_core.export.pictures.stage_pictures import StoredFacade
from facade_core.geometry.chart_packing import ChartPlacements
from facade_core.geometry.walls import WALL_ROLES
from facade_core.plan.facades import Facades
from facade_core.plan.plan_tables import placement_from_table, read_facades, read_table
from tasks.engine.outcome import list_units_with_rejections
from tasks.engine.stage import is_done_record
from tasks.publish.item_rows import record_finish_time
from tasks.publish.review import MIN_CHANGE, review_priority
from tasks.stages.facades.record import FacadeRecord
from tasks.stages.journals import Journals, read_typed_journals
from tasks.viewing.outlines import BuildingOutline, outline_buildings


class _StreetLine(TypedDict):
    """Street of the plan; `line` holds its corners, metres."""

    id: str
    name: str
    line: list[list[float]]


@dataclass(frozen=True)
class _PlanTables:
    """Tables of the ingest stage, the same for every snapshot of a run.

    Attributes
    ----------
    line : (facades, 2, 2) ends of foot lines, metres.
    azimuth : (facades,) directions that facades face, clockwise from grid north, degrees.
    buildings : the plan's table of buildings.
    outlines : outlines of the buildings, those around the block too.
    position, forward, street : columns of the viewpoints.
    views : (n, 2) pairs of viewpoint and visible chart.
    """

    facades: Facades
    placement: ChartPlacements
    line: Float64Array
    azimuth: Float64Array
    buildings: TableValues
    outlines: Sequence[BuildingOutline]
    streets: tuple[_StreetLine, ...]
    position: Float64Array
    forward: Float64Array
    street: IntArray
    views: IntArray


@dataclass(frozen=True, eq=False)
class RunView:
    """Snapshot of a run's store, with its plan tables and journals."""

    out: Folder
    session: icechunk.Session
    group: StoreGroup
    tables: _PlanTables

    @property
    def snapshot(self) -> str:
        """Return the id of the snapshot."""
        return str(self.session.snapshot_id)

    @property
    def newest_publication(self) -> str | None:
        """Return the newest published snapshot, which may be older than this one during a run."""
        found = find_current_snapshot(self.out)
        return found.id if found else None

    @cached_property
    def journals(self) -> Journals:
        """Read the records of every stage."""
        return read_typed_journals(self.group)

    @property
    def records(self) -> list[FacadeRecord | None]:
        """Return the records of the facades."""
        return self.journals["facades"]

    @cached_property
    def buildings_with_corrections(self) -> frozenset[str]:
        """Return the ids of buildings with corrections."""
        return frozenset(cast(list[str], self.group.attrs.get("corrected", [])))

    @cached_property
    def facade_index_by_id(self) -> dict[str, int]:
        """Return the index of each facade by id."""
        return {name: i for i, name in enumerate(self.tables.facades.id)}

    def find_facade_index(self, facade: str) -> int:
        """Return the index of a facade.

        Raises
        ------
        InputError : the block has no such facade.
        """
        if facade not in self.facade_index_by_id:
            raise InputError(f"no facade {facade} in this block; its page lists those there are")
        return self.facade_index_by_id[facade]

    @cached_property
    def exemplars(self) -> dict[str, str]:
        """Return the folders of the prepared exemplars by name."""
        done = (record for record in self.journals["exemplars"] if record and record["status"] == "done")
        return {record["unit"]: record["folder"] for record in done}

    @cached_property
    def id_by_former_id(self) -> dict[str, str]:
        """Return present ids by the id at the time of a correction."""
        return cast(dict[str, str], self.group.attrs.get("known_by_place", {}))

    def open_facade(self, index: int) -> StoredFacade:
        """Return the stored data of a facade."""
        chart = int(self.tables.facades.chart[index])
        return StoredFacade(self.group, self.tables.placement, chart, self.records[index], self.exemplars)

    def block_map(self) -> JsonObject:
        """Return the block as a map: facades with catalogue columns, buildings, streets, viewpoints and review hints.

        Lines are in metres from `origin`, y up.
        """
        tables = self.tables
        every = [tables.line.reshape(-1, 2), *(np.array(street["line"]) for street in tables.streets)]
        corner = np.concatenate(every).min(axis=0).round() if len(every[0]) else np.zeros(2)
        facades = [self._facade_row(i, corner) for i in range(len(tables.facades.id))]
        extent = (np.concatenate(every) - corner).max(axis=0) if len(every[0]) else np.ones(2)
        return {
            "block": self.group.attrs["block"],
            "crs": self.group.attrs["crs"],
            "notes": self.group.attrs.get("notes", []),
            "snapshot": self.snapshot,
            "changed_from": MIN_CHANGE,
            "origin": corner.tolist(),
            "size": extent.round(2).tolist(),
            "columns": [_describe_column(column) for column in SHOWN_COLUMNS],
            "facades": facades,
            "to_look_at": [row["id"] for row in facades_to_review(facades)],
            "parse_colours": [[colour, name] for name, colour in PARSE_COLOURS.items()],
            "buildings": [
                {
                    "id": tables.buildings["id"][outline.building],
                    "own": outline.is_own,
                    "rings": [np.round(np.array(ring) - corner, 1).tolist() for ring in outline.rings],
                }
                for outline in tables.outlines
            ],
            "streets": [
                {"id": s["id"], "name": s["name"] or s["id"], "line": _round_to_list(np.array(s["line"]) - corner)}
                for s in tables.streets
            ],
            "viewpoints": [
                {"street": int(street), "at": _round_to_list(position[:2] - corner), "forward": _round_to_list(forward)}
                for street, position, forward in zip(tables.street, tables.position, tables.forward, strict=True)
            ],
            "seen": self._visible_facades(),
        }

    @cached_property
    def block_map_json(self) -> bytes:
        """Return `block_map` as JSON; computed once for a snapshot."""
        return json.dumps(self.block_map(), ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()

    def _facade_row(self, index: int, corner: Float64Array) -> JsonObject:
        tables, facades = self.tables, self.tables.facades
        record = self.records[index]
        street = tables.streets[int(facades.street[index])]
        building_id = tables.buildings["id"][int(facades.building[index])]
        source = FacadeSource(
            block=cast(str, self.group.attrs["block"]),
            facades=facades,
            index=index,
            role=WALL_ROLES[int(facades.role[index])],
            buildings=tables.buildings,
            street=street["name"] or street["id"],
            street_id=street["id"],
            line=tables.line[index],
            azimuth_deg=float(tables.azimuth[index]),
            record=record or {"status": "waiting"},
            is_building_corrected=building_id in self.buildings_with_corrections,
            updated=record_finish_time(record),
            poses={},
            code_version="",
            config_digest="",
        )
        row: dict[str, object] = {column.name: column.fill(source) for column in SHOWN_COLUMNS if column.fill}
        row |= {"id": facades.id[index], "street_id": street["id"], "line": _round_to_list(tables.line[index] - corner)}
        if record:
            row["reason"] = record.get("reason")
            row["look_first"] = review_priority(facades, index, record, cast(str | None, row["quality"]))
        return {name: _to_python(value) for name, value in row.items() if value is not None}

    def _visible_facades(self) -> list[list[int]]:
        """List the indices of visible facades for each viewpoint."""
        facade = np.full(len(self.tables.placement.page), -1)
        facade[self.tables.facades.chart] = np.arange(len(self.tables.facades.id))
        seen: list[list[int]] = [[] for _ in self.tables.street]
        for viewpoint, chart in self.tables.views.tolist():
            if facade[chart] >= 0:
                seen[viewpoint].append(int(facade[chart]))
        return seen

    def run_progress(self) -> JsonObject:
        """Return unit counts, failures and stale units by stage, finished viewpoints and publication state."""
        stages = []
        failures = [
            {"stage": str(kind), "unit": str(unit), "reason": str(reason)}
            for kind, unit, reason in self.group.attrs["set_aside"]
        ]
        outdated: list[dict[str, str]] = []
        for stage, records in cast(Mapping[str, Sequence[Record | None]], self.journals).items():
            present = [record for record in records if record]
            stale = [record for record in present if record["status"] == "stale"]
            failed = [record for record in present if record["status"] == "failed"]
            if records:
                done = len(present) - len(failed) - len(stale)
                counts = {"done": done, "failed": len(failed), "stale": len(stale), "total": len(records)}
                stages.append({"name": stage, **counts})
            outdated += [{"stage": stage, "unit": r["unit"], "reason": r.get("reason", "")} for r in stale]
            failures += [{"stage": stage, "unit": r["unit"], "reason": r.get("reason", "")} for r in failed]
            failures += [
                {"stage": stage, "unit": unit, "reason": reason} for unit, reason in list_units_with_rejections(present)
            ]
        return {
            "snapshot": self.snapshot,
            "published": self.newest_publication,
            "ended": self.newest_publication == self.snapshot,
            "stages": stages,
            "failures": failures,
            "stale": outdated,
            "done_viewpoints": [
                number
                for number, street in enumerate(self.tables.street.tolist())
                if is_done_record(self.journals["streets"][street])
            ],
        }


class RunReader:
    """Reader of the newest snapshot of a run's folder; thread-safe."""

    def __init__(self, out: Folder) -> None:
        self.out = out
        self._lock = threading.Lock()
        self._repository: icechunk.Repository | None = None
        self._view: RunView | None = None
        self._key: tuple[str, float] | None = None

    def open_newest(self) -> RunView:
        """Open the newest snapshot.

        Raises
        ------
        StoreError : the folder has no ingested block yet.
        """
        with self._lock:
            if self._repository is None:
                self._repository = open_repository(self.out / "store")
            session = self._repository.readonly_session(BRANCH)
            if self._view is None or self._view.snapshot != session.snapshot_id:
                group = open_root(session)
                if "ingested" not in group.attrs:
                    raise StoreError(f"{self.out}: the block is not read yet")
                key = group.attrs["key"], group.attrs["ingested"]
                same = self._view is not None and key == self._key
                tables = self._view.tables if same and self._view else _read_tables(session)
                self._view, self._key = RunView(self.out, session, group, tables), key
            return self._view


def _read_tables(session: icechunk.Session) -> _PlanTables:
    charts, cameras, streets, buildings = (
        read_table(session, name) for name in ("charts", "viewpoints", "streets", "buildings")
    )
    facades = read_facades(session)
    placement = placement_from_table(charts)
    start = charts["origin"][facades.chart, :2]
    along = charts["axis_u"][facades.chart]
    normal = np.cross(charts["axis_v"][facades.chart], along)  # v points down, so v x u points outward
    return _PlanTables(
        facades,
        placement,
        np.stack([start, start + along[:, :2] * charts["size"][facades.chart, :1]], axis=1),
        np.degrees(np.arctan2(normal[:, 0], normal[:, 1])) % 360,
        buildings,
        outline_buildings(charts, read_table(session, "mesh")),
        tuple(
            {"id": id_, "name": name, "line": streets["point"][streets["point_street"] == i].tolist()}
            for i, (id_, name) in enumerate(zip(streets["id"], streets["name"], strict=True))
        ),
        cameras["position"],
        cameras["forward"],
        cameras["street"],
        np.column_stack([cameras["view_viewpoint"], cameras["view_chart"]]),
    )


def _round_to_list(values: FloatArray) -> list[Any]:
    rounded: list[Any] = np.round(values, 2).tolist()
    return rounded


def _describe_column(column: ItemColumn) -> JsonObject:
    """Return what the page shows of a column; `common` ones come before others."""
    described: JsonObject = {name: getattr(column, name) for name in ("name", "type", "unit", "label", "meaning")}
    return described | {"common": column.is_common, "words": dict(column.words)}


def _to_python(value: object) -> object:
    if isinstance(value, datetime):
        return value.isoformat(timespec="seconds")
    return value.item() if isinstance(value, np.generic) else value
