"""Memory over time of several runs, as an SVG: a panel for each, all on one scale of megabytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from benchmarks.city.runs import Look

WIDTH, HEIGHT, LEFT, TOP, GAP = 720, 180, 64, 28, 44
LINES = {"all processes": "#444444", "largest worker": "#c2571a", "coordinator": "#1a6fc2"}


def plot(runs: Mapping[str, Sequence[Look]], path: Path) -> None:
    """Draw the runs, by name, into an SVG file."""
    most = max(look.total for looks in runs.values() for look in looks)
    panels = [
        _panel(name, looks, most, number * (HEIGHT + GAP) + TOP) for number, (name, looks) in enumerate(runs.items())
    ]
    height = len(panels) * (HEIGHT + GAP) + TOP
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{LEFT + WIDTH + 20}" height="{height}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>{_legend()}{"".join(panels)}</svg>\n',
        encoding="utf-8",
    )


def _legend() -> str:
    return "".join(
        f'<text x="{LEFT + 150 * number}" y="16" fill="{colour}">{name}</text>'
        for number, (name, colour) in enumerate(LINES.items())
    )


def _panel(name: str, looks: Sequence[Look], most: float, top: int) -> str:
    """A run: lines of megabytes over its seconds, in a frame with the ends of both scales."""
    start, lasted = looks[0].at, max(looks[-1].at - looks[0].at, 1.0)
    values = {
        "all processes": [look.total for look in looks],
        "largest worker": [max(look.workers, default=0.0) for look in looks],
        "coordinator": [look.coordinator for look in looks],
    }
    lines = []
    for line, megabytes in values.items():
        points = " ".join(
            f"{LEFT + WIDTH * (look.at - start) / lasted:.1f},{top + HEIGHT * (1 - value / most):.1f}"
            for look, value in zip(looks, megabytes, strict=True)
        )
        lines.append(f'<polyline points="{points}" fill="none" stroke="{LINES[line]}"/>')
    bottom = top + HEIGHT
    return (
        f'<rect x="{LEFT}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#bbbbbb"/>{"".join(lines)}'
        f'<text x="{LEFT + 8}" y="{top + 16}" font-weight="bold">{name}</text>'
        f'<text x="{LEFT - 6}" y="{top + 10}" text-anchor="end">{most:.0f} MB</text>'
        f'<text x="{LEFT - 6}" y="{bottom}" text-anchor="end">0</text>'
        f'<text x="{LEFT + WIDTH}" y="{bottom + 16}" text-anchor="end">{lasted:.0f} s</text>'
    )
