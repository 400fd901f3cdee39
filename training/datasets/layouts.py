"""Databases of facade layouts as JSON lines: one facade per line, with its size and labelled rectangles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from catalogs.reader_errors import short_message
from catalogs.readers.json_text import parse_json_object
from catalogs.readers.layouts import LayoutRecord, parse_layout_record
from facade_core.core.errors import InputError
from facade_core.core.regular_files import read_regular


def read_layouts(path: str | Path) -> Iterator[LayoutRecord]:
    """Yield the facades of a file in its order.

    Raises
    ------
    InputError : the file is missing, or a line is no layout.
    """
    path = Path(path)
    try:
        lines = read_regular(path).decode("utf-8-sig").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({short_message(error)}); give a .jsonl file of layouts") from error
    for number, line in enumerate(lines, 1):
        if line.strip():
            try:
                yield parse_layout_record(parse_json_object(line.encode(), f"{path}: line {number}"), number)
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(
                    f"{path}: line {number} is no layout ({short_message(error)}); correct or remove it"
                ) from error


def split_layouts_for_training(
    layouts: Sequence[LayoutRecord], fold: int = 0, every: int = 5
) -> tuple[list[LayoutRecord], list[LayoutRecord]]:
    """Split layouts into (training, held out): every fifth is held out from number `fold` on."""
    held_out = list(layouts[fold::every])
    return [layout for index, layout in enumerate(layouts) if index % every != fold], held_out
