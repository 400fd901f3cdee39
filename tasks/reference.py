"""Reference pages that follow from declarations: `python -m tasks.reference` writes them into docs/reference/."""

from __future__ import annotations

from collections.abc import Callable

import catalogs.reference
from tasks.export.registry import FORMATS, CityFormat, ExportFormat


def describe_export_formats() -> str:
    """Return the page of the export formats."""
    lines = [
        "# Export formats",
        "",
        catalogs.reference.WRITTEN_BY,
        "",
        "`streetloom export OUT --format FORMAT` writes one of these; [Exports](../exports.md) describes light, textures and",
        "cities. Each is declared in `tasks/export/registry.py`.",
        "",
        "| `--format` | content | suffix | options | opened by tests in |",
        "|---|---|---|---|---|",
        *(_format_row(entry) for entry in FORMATS.values()),
        "",
        "## Of a city",
        "",
        "| `--format` | content |",
        "|---|---|",
        *(
            f"| `{entry.name}` | {entry.city.content} |"
            for entry in FORMATS.values()
            if isinstance(entry.city, CityFormat)
        ),
        "",
        "The others hold one block: export a block of the city, or use another format.",
        "",
        "| `--format` | for a city use |",
        "|---|---|",
        *(
            f"| `{entry.name}` | {' or '.join(f'`{name}`' for name in entry.city)} |"
            for entry in FORMATS.values()
            if not isinstance(entry.city, CityFormat)
        ),
    ]
    return "\n".join(lines)


def _format_row(entry: ExportFormat) -> str:
    needs = f" (needs `{entry.setup}`)" if entry.setup else ""
    options = [_option(name) for name in entry.options]
    options += [f"{_option(name)} (factored)" for name in entry.factored_options if name not in entry.options]
    return (
        f"| `{entry.name}` | {entry.content}{needs} | `{entry.suffix}` | {', '.join(options)} | "
        f"{', '.join(entry.opened_in)} |"
    )


def _option(name: str) -> str:
    return f"`--{name.replace('_', '-')}`"


# Pages by name.
PAGES: dict[str, Callable[[], str]] = {**catalogs.reference.PAGES, "exports.md": describe_export_formats}


if __name__ == "__main__":
    catalogs.reference.write_pages(pages=PAGES)
