"""The house as a drawing for the site: the flowchart that hosts of repositories draw, as SVG."""

from __future__ import annotations

import re

INK = "stroke:currentColor;fill:currentColor"
STYLE = (
    "<style>svg[role=img] text{stroke:none;text-anchor:middle}svg[role=img] text[class]{text-anchor:start}"
    "svg[role=img] text.name{font-weight:bold}</style>"
)
MARKER = (
    '<defs><marker id="to" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0L8 4L0 8z"/></marker></defs>'
)


def drawn(flowchart: str) -> str:
    """The house as SVG: tasks beside catalogs, storeys below each other as their arrows run, between the boxes outside them."""
    layers = {
        name: dict(re.findall(r'\b(\w\d)\["([^"]+)"\]', inside))
        for name, inside in re.findall(r"^  subgraph (\w+)\n(.*?)^  end$", flowchart, re.MULTILINE | re.DOTALL)
    }
    above, below = (label.split("<br/>") for label in re.findall(r'^  \w+\["([^"]+)"\]$', flowchart, re.MULTILINE))
    (across,) = re.findall(r'^  \w+ -- "([^"]+)" --> \w+$', flowchart, re.MULTILINE)
    most, wide, high = max(map(len, layers.values())), 360, 44
    foot = 112 + most * (high + 14)
    parts = [_box(0, 0, 2 * wide + 40, 50, above), _box(0, foot + 50, 2 * wide + 40, 50, below)]
    for column, (name, storeys) in enumerate(layers.items()):
        left = column * (wide + 40)
        parts += [_arrow(left + wide / 2, 50, 80), _arrow(left + wide / 2, foot, foot + 50)]
        parts.append(f'<rect x="{left}" y="80" width="{wide}" height="{foot - 80}" rx="6" fill-opacity=".06"/>')
        parts.append(f'<text x="{left + 12}" y="102" class="name">{name}</text>')
        for number, label in enumerate(storeys.values()):
            top = 114 + number * (high + 14)
            parts.append(_box(left + 12, top, wide - 24, high, _lines(label)))
            if number + 1 < len(storeys):
                parts.append(_arrow(left + wide / 2, top + high, top + high + 14))
    parts.append(f'<text x="{1.5 * wide + 50}" y="{foot + 30}" class="beside">{across}</text>')
    parts.append(f'<path d="M{wide} 200H{wide + 34}" marker-end="url(#to)"/>')
    size = f'viewBox="-2 -2 {2 * wide + 44} {foot + 104}" style="max-width:46rem;font-size:13px;{INK}"'
    return f'<svg {size} role="img" aria-label="The house: what imports what">{STYLE}{MARKER}{"".join(parts)}</svg>\n'


def _box(left: float, top: float, width: float, height: float, lines: list[str]) -> str:
    first = top + height / 2 + 5 - 8 * (len(lines) - 1)
    told = "".join(f'<text x="{left + width / 2}" y="{first + 16 * i}">{line}</text>' for i, line in enumerate(lines))
    return f'<rect x="{left}" y="{top}" width="{width}" height="{height}" rx="4" fill-opacity=".04"/>{told}'


def _lines(label: str) -> list[str]:
    """A storey's rooms on one line, or on two where they are many."""
    rooms = label.split(" · ")
    half = (len(rooms) + 1) // 2 if len(label) > 50 else len(rooms)
    return [" · ".join(some) for some in (rooms[:half], rooms[half:]) if some]


def _arrow(x: float, top: float, bottom: float) -> str:
    return f'<path d="M{x} {top}V{bottom - 2}" marker-end="url(#to)"/>'
