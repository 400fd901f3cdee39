"""Reference pages of `docs/reference`, written from declarations: `python -m tasks.reference` writes them anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from catalogs.block.declared_keys import DeclaredKey, declared_keys
from catalogs.block.keys import BlockFileSettings
from catalogs.city.keys import CityOnlyKeys
from catalogs.published.columns import COLUMNS

_FOLDER = Path(__file__).resolve().parent.parent / "docs" / "reference"
WRITTEN_BY = "<!-- `python -m tasks.reference` writes this page from the declarations in the code. -->"
_EXAMPLE = """```yaml
name: kamppi
area: [24.940, 60.165, 24.947, 60.169]
buildings: {path: helsinki.osm.pbf}
streets: {path: helsinki.osm.pbf, names: [Mikonkatu, Erottajankatu]}
imagery:
  exemplars: {path: facades/}
texture: {texels_per_metre: 20}
seed: 7
```"""


def format_block_file_page() -> str:
    """Return the page of all keys of block files and city files."""
    block = declared_keys(BlockFileSettings)
    city = [one for name, one in declared_keys(CityOnlyKeys).items() if name not in block]
    return "\n\n".join(
        (
            "# Keys of a block file",
            WRITTEN_BY,
            "A block file is YAML 1.2: `no` and `1:30` are text, and a whole number that begins with 0 is refused. Anchors, "
            "aliases and tags are refused too. It has 20 levels and 256 kB at most. Paths are relative to the block file, and "
            "`${NAME}` in a path is replaced with the environment variable. An unknown key is an error: the message names the "
            "nearest known one.",
            _EXAMPLE,
            "The last column says what a run does again once the value changes. Files, and keys that "
            "say how they are read, count by the content that was read: another name or spelling changes nothing.",
            _format_table(block.values()),
            "## Keys of a city file",
            "`streetloom city CITY.yaml` takes the keys of a block file (`streets` is required, `part` and `imagery.style` are "
            "no keys of it) and these, or a name and a folder of block files: `{name: mine, blocks: {path: blocks/}}`.",
            _format_table(city),
        )
    )


def format_columns_page() -> str:
    """Return the page of all columns of items.parquet."""
    rows = [(f"`{one.name}`", one.type, one.unit, one.label, one.meaning) for one in COLUMNS]
    head = "| column | type | unit | label | meaning |\n|---|---|---|---|---|\n"
    return "\n\n".join(
        (
            "# Columns of items.parquet",
            WRITTEN_BY,
            "`items.parquet` is a GeoParquet 1.1 file, ordered by `id`. It has one row per facade, failed facades included, "
            "then one row per unit that was set aside. An empty value is unknown. The label is the column's name in the "
            "viewer, which shows columns with a label only. The metadata of the file's fields have units and meanings too.",
            head + "\n".join(map(_format_cells, rows)),
        )
    )


PAGES: Mapping[str, Callable[[], str]] = {
    "block-file.md": format_block_file_page,
    "columns.md": format_columns_page,
}


def write_pages(folder: Path = _FOLDER, pages: Mapping[str, Callable[[], str]] = PAGES) -> None:
    """Write reference pages into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, format_page in pages.items():
        (folder / name).write_text(f"{format_page()}\n", encoding="utf-8")


def _format_table(keys: Iterable[DeclaredKey]) -> str:
    heading = "| key | type | default | unit | meaning | a change makes pending |\n|---|---|---|---|---|---|\n"
    return heading + "\n".join(map(_format_row, keys))


def _format_row(one: DeclaredKey) -> str:
    pending = "" if one.is_section else one.key.effect or "units whose input it changes"
    cells = (f"`{one.name}`", one.value_type, _format_default(one), one.key.unit, one.key.meaning, pending)
    return _format_cells(cells)


def _format_cells(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |".replace("|  |", "| |").replace("|  |", "| |")


def _format_default(one: DeclaredKey) -> str:
    if one.is_required:
        return "required"
    if one.is_section or one.default is None:
        return one.key.default or ("" if one.default is not None else "none")
    return str(one.default).lower() if isinstance(one.default, bool) else str(one.default)
