"""Static report of a published snapshot, as plain HTML without network access.

It has an index and pages for each street with its facades stage by stage.
"""

from __future__ import annotations

import statistics
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, SupportsFloat, TypedDict, TypeVar
from urllib.parse import quote

from markupsafe import Markup

from catalogs.features import natural_sort_key, safe_file_stem
from catalogs.printable_text import escape_invisible
from catalogs.published.columns import ItemRow
from catalogs.published.facade_values import ASSUMED_HEIGHT
from facade_core.core.labels import PARSE_COLOURS

if TYPE_CHECKING:
    from jinja2 import Environment

RowT = TypeVar("RowT", bound=Mapping[str, object])

MAX_FACADES_PER_PAGE = 40
MAX_REVIEW_FACADES = 60
# Changed facades with pictures in the index.
MAX_CHANGES = 24


class UnitTimings(TypedDict, total=False):
    """Part of a unit's record that a report shows.

    Attributes
    ----------
    seconds : duration of each step.
    """

    seconds: dict[str, float]


class FacadeTimings(UnitTimings, total=False):
    """Part of a facade's record that a report shows.

    Attributes
    ----------
    change_map : a line per row of cells; a digit is the changed tenths of a cell, - a hidden one.
    """

    change_map: list[str]


class ReportExemplar(NamedTuple):
    """Exemplar in a report.

    Attributes
    ----------
    record : its record.
    pictures : (name, title) of its pictures.
    used : number of facades made from it.
    """

    record: Mapping[str, object]
    pictures: Sequence[tuple[str, str]]
    used: int


class StreetReportPages(NamedTuple):
    """Facades of a street on pages.

    Attributes
    ----------
    name : name of the street.
    rows : rows of each page.
    paths : path of each page in the report's folder.
    """

    name: str
    rows: tuple[Sequence[ItemRow], ...]
    paths: tuple[str, ...]

    @property
    def all_rows(self) -> list[ItemRow]:
        """Return the rows of all pages."""
        return [row for rows in self.rows for row in rows]


@dataclass(frozen=True)
class ReportContent:
    """Content of a report; pictures are given by their names in the report's images/.

    Attributes
    ----------
    summary : facts about the block.
    rows : rows of the catalogue, with `look_first` added: urgency of a review, the largest first.
    set_aside : rows of the units that were set aside.
    records : facade -> its record.
    streets : records.
    views : pictures along streets.
    sheets : facade -> (name, title) of its pictures.
    textures_only : facades of which only the texture is shown.
    exemplars : prepared exemplars.
    poses : records of posed panoramas.
    heights : source of the height -> number of buildings.
    models : files of the snapshot, relative to its folder.
    min_change : smallest share of change of a listed facade.
    before : facade -> picture at an earlier capture.
    """

    summary: Mapping[str, object]
    rows: Sequence[ItemRow]
    set_aside: Sequence[ItemRow]
    records: Mapping[str, FacadeTimings]
    streets: Sequence[UnitTimings]
    views: Sequence[str]
    sheets: Mapping[str, Sequence[tuple[str, str]]]
    textures_only: frozenset[str]
    exemplars: Sequence[ReportExemplar]
    poses: Sequence[Mapping[str, object]]
    heights: Mapping[str, int]
    models: Sequence[str]
    min_change: float
    before: Mapping[str, str]


def write_report(folder: Path, content: ReportContent) -> None:
    """Write index.html, exemplars.html and streets/ into `folder`, which holds images/ already."""
    environment = _environment()
    pages = paginate_facades_by_street(content.rows)
    for street in pages:
        _write_street(folder, street, content, environment)
    if content.exemplars:
        page = environment.get_template("report_exemplars.html.j2").render(
            summary=content.summary,
            exemplars=[
                {**one.record, "pictures": _picture_links("images", one.pictures), "used": one.used}
                for one in content.exemplars
            ],
        )
        (folder / "exemplars.html").write_text(page, encoding="utf-8")
    _write_index(folder, pages, content, environment)


def _write_street(folder: Path, street: StreetReportPages, content: ReportContent, environment: Environment) -> None:
    for number, (path, rows) in enumerate(zip(street.paths, street.rows, strict=True), 1):
        page = environment.get_template("report_street.html.j2").render(
            summary=content.summary,
            street=street.name,
            number=number,
            pages=[Path(one).name for one in street.paths],
            facades=[
                _facade_entry(row, content.records.get(row["id"], {}), content.sheets.get(row["id"], ()))
                for row in rows
            ],
            textures_only=sum(row["id"] in content.textures_only for row in rows),
        )
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(page, encoding="utf-8")


def _write_index(
    folder: Path, pages: Sequence[StreetReportPages], content: ReportContent, environment: Environment
) -> None:
    rows = content.rows
    links = {
        row["id"]: f"{quote(path)}#{quote(row['id'])}"
        for street in pages
        for path, shown in zip(street.paths, street.rows, strict=True)
        for row in shown
    }
    doubtful = facades_to_review(rows)
    changed = sorted(
        (row for row in rows if (row["changed"] or 0) >= content.min_change),
        key=lambda row: (-(row["changed"] or 0), row["id"]),
    )
    page = environment.get_template("report.html.j2").render(
        summary=content.summary,
        index=[_index_entry(street) for street in pages],
        doubtful=len(doubtful),
        assumed=sum(row["quality"] == ASSUMED_HEIGHT for row in rows),
        total=len(rows),
        most_doubtful=[{"row": row, "link": links[row["id"]]} for row in doubtful[:MAX_REVIEW_FACADES]],
        changed=[
            _change_entry(row, content.records.get(row["id"], {}), content.sheets, content.before, links)
            for row in changed[:MAX_CHANGES]
        ],
        changes=len(changed),
        compared=sum(row["changed"] is not None for row in rows),
        exemplars=len(content.exemplars),
        set_aside=[*content.set_aside, *(row for row in rows if row["status"] == "failed")],
        streets=content.streets,
        above=(folder / "images" / "above.jpg").is_file(),
        poses=content.poses,
        heights=content.heights,
        models=content.models,
        views=[f"images/{name}" for name in content.views],
        timings=[*_timings("facade", content.records.values()), *_timings("street", content.streets)],
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def facades_to_review(rows: Iterable[RowT]) -> list[RowT]:
    """Return facades with a doubt other than an assumed height, most urgent first (`look_first`)."""
    return sorted((row for row in rows if row.get("quality") not in (None, "good", ASSUMED_HEIGHT)), key=_review_order)


def _review_order(row: Mapping[str, object]) -> tuple[float, str]:
    urgency = row.get("look_first", 0.0)
    return -float(urgency) if isinstance(urgency, SupportsFloat) else 0.0, str(row["id"])


def paginate_facades_by_street(rows: Sequence[ItemRow]) -> list[StreetReportPages]:
    """Group facades by the street that sees them, in natural order, MAX_FACADES_PER_PAGE to a page."""
    by_street: dict[str, list[ItemRow]] = {}
    for row in rows:
        by_street.setdefault(row["street"] or "", []).append(row)
    found = []
    for name in sorted(by_street, key=natural_sort_key):
        own = by_street[name]
        parts = tuple(own[start : start + MAX_FACADES_PER_PAGE] for start in range(0, len(own), MAX_FACADES_PER_PAGE))
        stem = safe_file_stem(name)
        found.append(
            StreetReportPages(name, parts, tuple(f"streets/{stem}/{n}.html" for n in range(1, len(parts) + 1)))
        )
    return found


def _environment() -> Environment:
    """Return the templates with the style that all pages share."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    here = Path(__file__).parent
    environment = Environment(
        loader=FileSystemLoader(here), autoescape=True, finalize=_escape_invisible, undefined=StrictUndefined
    )
    style = (here / "report.css").read_text(encoding="utf-8")
    environment.globals["style"] = Markup(style)
    environment.globals["parse_colours"] = list(PARSE_COLOURS.items())
    environment.globals["style_digest"] = b64encode(sha256(style.encode()).digest()).decode()
    return environment


def _escape_invisible(value: object) -> object:
    """Return a value as it is shown, before HTML escaping."""
    return escape_invisible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _index_entry(street: StreetReportPages) -> dict[str, object]:
    """Return a street's entry in the index."""
    every = street.all_rows
    return {
        "name": street.name,
        "links": [quote(path) for path in street.paths],
        "facades": len(every),
        "photos": sum(bool(row["photo"]) for row in every),
        "failed": sum(row["status"] == "failed" for row in every),
    }


def _facade_entry(row: ItemRow, record: FacadeTimings, sheets: Sequence[tuple[str, str]]) -> dict[str, object]:
    return {"row": row, "pictures": _picture_links("../../images", sheets), "seconds": record.get("seconds", {})}


def _change_entry(
    row: ItemRow,
    record: FacadeTimings,
    sheets: Mapping[str, Sequence[tuple[str, str]]],
    before: Mapping[str, str],
    links: Mapping[str, str],
) -> dict[str, object]:
    """Return a changed facade: row, pictures before and after, and cells (x, y, tenths).

    Tenths are None where the facade is hidden.
    """
    own = sheets.get(row["id"], ())
    now = sorted((name for name, _ in own), key=lambda name: not name.endswith(("-rectified.webp", "-hidden.webp")))
    cells = record.get("change_map", [])
    return {
        "row": row,
        "link": links[row["id"]],
        "before": f"images/{quote(before[row['id']])}" if row["id"] in before else None,
        "now": f"images/{quote(now[0])}" if now else None,
        "size": (len(cells[0]), len(cells)) if cells else None,
        "cells": [
            (x, y, None if cell == "-" else int(cell)) for y, line in enumerate(cells) for x, cell in enumerate(line)
        ],
    }


def _picture_links(folder: str, pictures: Sequence[tuple[str, str]]) -> list[dict[str, str]]:
    return [{"path": f"{folder}/{quote(name)}", "title": title} for name, title in pictures]


def _timings(kind: str, records: Iterable[UnitTimings]) -> Iterator[dict[str, object]]:
    """Yield median and total seconds of every stage over the records of one kind of unit."""
    by_stage: dict[str, list[float]] = {}
    for record in records:
        for stage, seconds in record.get("seconds", {}).items():
            by_stage.setdefault(stage, []).append(seconds)
    for stage, values in by_stage.items():
        yield {
            "kind": kind,
            "stage": stage,
            "count": len(values),
            "median": statistics.median(values),
            "total": sum(values),
        }
