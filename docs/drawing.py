"""Drawings of the package layers, from the import contracts in pyproject.toml: Mermaid for the page, SVG for the site."""

from __future__ import annotations

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("flows", "tasks", "catalogs", "facade_core")

INK = "stroke:currentColor;fill:currentColor"
STYLE = "<style>svg[role=img] text{stroke:none;text-anchor:middle}svg[role=img] text.name{font-weight:bold}</style>"
MARKER = (
    '<defs><marker id="to" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0L8 4L0 8z"/></marker></defs>'
)
WIDTH, HEIGHT, GAP = 300, 44, 14

Layers = dict[str, list[list[str]]]


def read_layers() -> Layers:
    """Return the layers of each package, top first, as the contracts state them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    layers = {
        container: [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]
        for contract in contracts
        if contract["type"] == "layers"
        for container in contract.get("containers", [])
    }
    return {package: layers[package] for package in PACKAGES if package in layers}


def as_mermaid(layers: Layers) -> str:
    """Return a Mermaid flowchart: a subgraph per package, a box per layer."""
    lines = ["flowchart TD", "  flows"]
    for package, rows in layers.items():
        lines += [f"  subgraph {package}", "    direction TB"]
        lines += [f'    {package}{len(rows) - i}["{" · ".join(row)}"]' for i, row in enumerate(rows)]
        lines += ["    " + " --> ".join(f"{package}{len(rows) - i}" for i in range(len(rows))), "  end"]
    lines += ["  flows --> tasks", "  tasks --> catalogs", "  tasks --> facade_core"]
    return "\n".join([*lines, "  catalogs -- core --> facade_core", ""])


def as_svg(layers: Layers) -> str:
    """Return the same drawing as SVG: a column per package below `flows`."""
    wide = len(layers) * (WIDTH + 40) - 40
    foot = 112 + max(map(len, layers.values())) * (HEIGHT + GAP)
    parts = [_box(0, 0, wide, 40, ["flows"])]
    for column, (package, rows) in enumerate(layers.items()):
        left = column * (WIDTH + 40)
        parts.append(_arrow(left + WIDTH / 2, 40, 72))
        parts.append(f'<rect x="{left}" y="72" width="{WIDTH}" height="{foot - 72}" rx="6" fill-opacity=".06"/>')
        parts.append(f'<text x="{left + WIDTH / 2}" y="96" class="name">{package}</text>')
        for i, row in enumerate(rows):
            top = 106 + i * (HEIGHT + GAP)
            parts.append(_box(left + 12, top, WIDTH - 24, HEIGHT, _wrap(row)))
            if i + 1 < len(rows):
                parts.append(_arrow(left + WIDTH / 2, top + HEIGHT, top + HEIGHT + GAP))
    size = f'viewBox="-2 -2 {wide + 4} {foot + 4}" style="max-width:56rem;font-size:12px;{INK}"'
    return f'<svg {size} role="img" aria-label="Layers of the packages">{STYLE}{MARKER}{"".join(parts)}</svg>\n'


def _box(left: float, top: float, width: float, height: float, lines: list[str]) -> str:
    first = top + height / 2 + 4 - 7 * (len(lines) - 1)
    text = "".join(f'<text x="{left + width / 2}" y="{first + 14 * i}">{line}</text>' for i, line in enumerate(lines))
    return f'<rect x="{left}" y="{top}" width="{width}" height="{height}" rx="4" fill-opacity=".04"/>{text}'


def _wrap(names: list[str]) -> list[str]:
    """Return the names of a layer on one, two or three lines."""
    lines = 1 + len(" · ".join(names)) // 46
    size = -(-len(names) // lines)
    return [" · ".join(names[i : i + size]) for i in range(0, len(names), size)]


def _arrow(x: float, top: float, bottom: float) -> str:
    return f'<path d="M{x} {top}V{bottom - 2}" marker-end="url(#to)"/>'


if __name__ == "__main__":
    print(as_mermaid(read_layers()))
