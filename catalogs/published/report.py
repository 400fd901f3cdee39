"""The static report of a published snapshot: the block, its streets and every facade stage by stage. Plain HTML, no network."""

from __future__ import annotations

import statistics
from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from catalogs.visible import visible


def write_report(
    folder: Path,
    *,
    summary: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    set_aside: Sequence[Mapping[str, Any]],
    records: Mapping[str, Mapping[str, Any]],
    streets: Sequence[Mapping[str, Any]],
    viewpoints: Sequence[Mapping[str, Any]],
    views: Sequence[str],
    panoramas: Sequence[tuple[str, str]],
    sheets: Mapping[str, Sequence[tuple[str, str]]],
    poses: Sequence[Mapping[str, Any]],
    heights: Mapping[str, int],
) -> None:
    """Write index.html into `folder`, beside its images/, which are there already.

    Those are given by their names: views along streets, panoramas (name, title), and by facade its sheets (name, title).
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, finalize=_shown, undefined=StrictUndefined
    )
    facades = [_facade(row, records.get(row["id"], {}), sheets.get(row["id"], ())) for row in rows]
    style = (Path(__file__).parent / "report.css").read_text(encoding="utf-8")
    page = environment.get_template("report.html.j2").render(
        style=Markup(style),
        style_digest=b64encode(sha256(style.encode()).digest()).decode(),
        summary=summary,
        facades=facades,
        set_aside=set_aside,
        streets=streets,
        panoramas=[(title, f"images/{name}") for name, title in panoramas],
        poses=poses,
        heights=heights,
        views=[f"images/{name}" for name in views],
        timings=[*_timings("facade", records.values()), *_timings("viewpoint", viewpoints)],
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _shown(value: Any) -> Any:
    """What stands in the page for a value, before it is escaped."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _facade(row: Mapping[str, Any], record: Mapping[str, Any], sheets: Sequence[tuple[str, str]]) -> dict[str, Any]:
    pictures = [{"path": f"images/{quote(name)}", "title": title} for name, title in sheets]
    return {"row": row, "pictures": pictures, "seconds": record.get("seconds", {})}


def _timings(kind: str, records: Any) -> list[dict[str, Any]]:
    """Median and total seconds of every stage over the records of one kind of unit."""
    by_stage: dict[str, list[float]] = {}
    for record in records:
        for stage, seconds in record.get("seconds", {}).items():
            by_stage.setdefault(stage, []).append(seconds)
    return [
        {"kind": kind, "stage": stage, "count": len(values), "median": statistics.median(values), "total": sum(values)}
        for stage, values in by_stage.items()
    ]
