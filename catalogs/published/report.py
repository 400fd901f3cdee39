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

from catalogs.features import file_stem
from catalogs.visible import visible

# Stages in their order with what a reader should see; a picture that does not exist is left out.
STAGES = (
    ("hidden", "Photo, hidden part tinted"),
    ("parse", "Parse and lattice"),
    ("result", "Texture"),
    ("level", "Variation level"),
    ("sample", "Sampled variation"),
)


def write_report(
    folder: Path,
    *,
    summary: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    set_aside: Sequence[Mapping[str, Any]],
    records: Mapping[str, Mapping[str, Any]],
    streets: Sequence[Mapping[str, Any]],
    viewpoints: Sequence[Mapping[str, Any]],
    panoramas: Sequence[tuple[str, str]],
    poses: Sequence[Mapping[str, Any]],
    heights: Mapping[str, int],
) -> None:
    """Write index.html into `folder`, beside its images/ (which are looked for, not made)."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, finalize=_shown, undefined=StrictUndefined
    )
    images = sorted((folder / "images").iterdir())
    facades = [_facade(row, records.get(row["id"], {}), images) for row in rows]
    style = (Path(__file__).parent / "report.css").read_text(encoding="utf-8")
    page = environment.get_template("report.html.j2").render(
        style=Markup(style),
        style_digest=b64encode(sha256(style.encode()).digest()).decode(),
        summary=summary,
        facades=facades,
        set_aside=set_aside,
        streets=streets,
        panoramas=panoramas,
        poses=poses,
        heights=heights,
        views=[f"images/{image.name}" for image in images if image.name.startswith("street-")],
        timings=[*_timings("facade", records.values()), *_timings("viewpoint", viewpoints)],
    )
    (folder / "index.html").write_text(page, encoding="utf-8")


def _shown(value: Any) -> Any:
    """What stands in the page for a value, before it is escaped."""
    return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def _facade(row: Mapping[str, Any], record: Mapping[str, Any], images: Sequence[Path]) -> dict[str, Any]:
    pictures = []
    stem = file_stem(row["id"])
    for stage, title in STAGES:
        for image in images:
            if not image.name.startswith(f"{stem}-{stage}"):
                continue
            level = image.stem.rsplit("-", 1)[-1] if stage == "level" else ""
            pictures.append({"path": f"images/{quote(image.name)}", "title": f"{title} {level}".strip()})
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
