"""Code page of the text of a Shapefile: the given one, that of its .cpg or of its table, else found from its bytes."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.settings import VECTORS
from catalogs.readers.vectors.shapefile_tables import sibling_file
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular, read_regular

if TYPE_CHECKING:
    from geopandas import GeoDataFrame

# GDAL decodes with this code page, which keeps every byte.
RAW_ENCODING = "ISO-8859-1"
UTF8 = "utf-8"
# Code page of most Windows programs in Western Europe and America.
FALLBACK_ENCODING = "cp1252"
# Code pages that programs state for text of any kind: text that is valid UTF-8 is not one of these.
_WESTERN_ENCODINGS = frozenset(("cp1252", "iso8859-1", "iso8859-15", "cp850", "cp437", "ascii"))
_LANGUAGE_BYTE = 29  # offset in the table's header
# Language drivers of dBASE and their code pages. 87 is the code page of the machine that wrote it, which is not known.
_LANGUAGE_DRIVERS = {
    code: page
    for page, codes in {
        "cp437": (1, 9, 11, 13, 15, 17, 21, 24, 27), "cp850": (2, 10, 14, 16, 18, 20, 22, 25, 26, 29, 37, 55),
        "cp1252": (3, 88, 89), "mac-roman": (4,), "cp865": (8, 23, 102), "cp932": (19, 123), "cp863": (28, 108),
        "cp852": (31, 34, 35, 64, 100, 135), "cp860": (36,), "cp866": (38, 101), "gbk": (77, 122), "cp949": (78, 121),
        "cp950": (79, 120), "cp874": (80, 124), "cp861": (103,), "cp737": (106, 134), "cp857": (107, 136),
        "mac-cyrillic": (150,), "mac-latin2": (151,), "mac-greek": (152,), "cp1250": (200,), "cp1251": (201,),
        "cp1254": (202,), "cp1253": (203,), "cp1257": (204,),
    }.items()
    for code in codes
}  # fmt: skip
_HEADER_BYTES = 32  # of a table before its fields
_FIELD_BYTES = 32
_MAX_NAME_BYTES = 10
# Text as read, and the width of its field in bytes; None where it is not known.
RawCell = tuple[str, int | None]


@dataclass(frozen=True, slots=True)
class TextDecoder:
    """Code page of a Shapefile's text, and what was assumed for it.

    Attributes
    ----------
    encoding : name of the codec.
    remark : assumption in words, None where the file or the user states the code page.
    errors : how the codec treats bytes that it does not define.
    """

    encoding: str
    remark: str | None = None
    errors: str = "strict"

    def decode(self, text: str, width: int | None = None) -> str:
        """Return a text that was read as RAW_ENCODING; writers cut the last character of a text that fills its width."""
        is_full = width is not None and len(text) >= width
        decoder = codecs.getincrementaldecoder(self.encoding)(self.errors)
        return decoder.decode(text.encode(RAW_ENCODING), final=not is_full)


def find_codec(name: str) -> str | None:
    """Return the codec of a name such as "UTF-8", "1252", "ANSI 1251" or "ISO 88591"; None where none is known."""
    name = name.strip().lower()
    if latin := re.fullmatch(r"(?:iso|latin)?[\s_-]*8859[\s_-]*(\d{1,2})", name):
        name = f"iso8859-{latin[1]}"
    elif page := re.fullmatch(r"(?:ansi|oem|cp|ms|windows|dos|ibm|x-windows)?[\s_-]*(\d{3,5})", name):
        name = UTF8 if page[1] == "65001" else f"cp{page[1]}"
    elif driver := re.fullmatch(r"ldid/(\d{1,3})", name):
        name = _LANGUAGE_DRIVERS.get(int(driver[1]), "")
    try:
        found = codecs.lookup(name)
        ascii_text = "aZ09_ '"
        return found.name if ascii_text.encode(found.name) == ascii_text.encode("ascii") else None
    except (LookupError, ValueError, TypeError):  # unknown, or no codec of text
        return None


def decode_shapefile_table(frame: GeoDataFrame, path: Path, given: str | None) -> tuple[GeoDataFrame, str | None]:
    """Return a table that was read as RAW_ENCODING with decoded cells, and a remark on its code page.

    Parameters
    ----------
    frame : table.
    path : the .shp.
    given : code page by the user, which replaces the stated one.

    Raises
    ------
    InputError
        Where the text is not of the stated code page; names the .cpg and the remedy.
    """
    stored = _field_widths(sibling_file(path, ".dbf"))
    widths = {name: stored[raw] for name, raw in decode_field_names(stored).items()}
    texts = [name for name in frame.columns.drop(frame.geometry.name) if frame[name].dtype.kind == "O"]
    cells = {(cell, widths.get(name)) for name in texts for cell in frame[name] if isinstance(cell, str)}
    decoder = choose_decoder(path, [cell for cell in cells if not cell[0].isascii()], given)
    for name in texts:
        frame[name] = np.array(_decode_cells(frame[name], decoder, widths.get(name)), dtype=object)
    return frame, decoder.remark


def _decode_cells(cells: Iterable[object], decoder: TextDecoder, width: int | None) -> list[object]:
    return [decoder.decode(cell, width) if isinstance(cell, str) else cell for cell in cells]


def decode_field_names(names: Iterable[str]) -> dict[str, str]:
    """Return decoded name -> name as read with RAW_ENCODING; names are UTF-8 where all of them can be."""
    raw = [(name, _MAX_NAME_BYTES) for name in names]
    encoding = UTF8 if _is_decodable(TextDecoder(UTF8), raw) else FALLBACK_ENCODING
    decoder = TextDecoder(encoding, errors="replace")
    return {decoder.decode(name, width): name for name, width in raw}


def choose_decoder(path: Path, cells: Sequence[RawCell], given: str | None) -> TextDecoder:
    """Return the decoder of a Shapefile's text.

    Parameters
    ----------
    path : the .shp.
    cells : texts that are not ASCII, read as RAW_ENCODING.
    given : code page by the user, which replaces the stated one.

    Raises
    ------
    InputError
        Where the text is not of the stated code page; names the .cpg and the remedy.
    """
    if given is not None:
        return _check(
            TextDecoder(find_codec(given) or given), cells, f"{path}: its text is not {given}; give another encoding"
        )
    page_file = sibling_file(path, ".cpg")
    is_utf8 = _is_decodable(TextDecoder(UTF8), cells)
    if page_file.is_file():
        stated = (
            read_regular(page_file, VECTORS.max_code_page_bytes).decode("ascii", "replace").strip("\ufffd\0 \r\n\t")
        )
        return _decoder_of_page_file(path, page_file, stated, cells, is_utf8=is_utf8)
    with open_regular(sibling_file(path, ".dbf")) as file:
        driver = file.read(_LANGUAGE_BYTE + 1)[-1]
    page = _LANGUAGE_DRIVERS.get(driver)
    if not cells or (is_utf8 and (page is None or page in _WESTERN_ENCODINGS)):
        return TextDecoder(UTF8)
    if page is not None:
        remedy = f"put its code page into {page_file.name} beside it, e.g. 1252, or give encoding"
        return _check(TextDecoder(page), cells, f"{path}: its table states {page}, which its text is not; {remedy}")
    remark = f"read as Windows-1252, since no code page is stated: put it into {page_file.name}, or give encoding"
    return TextDecoder(FALLBACK_ENCODING, remark, "replace")


def _decoder_of_page_file(
    path: Path, page_file: Path, stated: str, cells: Sequence[RawCell], *, is_utf8: bool
) -> TextDecoder:
    remedy = f"write its code page into {page_file}, e.g. 1252, or give encoding: windows-1252"
    encoding = find_codec(stated)
    if not cells:
        return TextDecoder(encoding or UTF8)
    if encoding is None and not is_utf8:
        raise InputError(f"{path}: {page_file.name} beside it states {stated[:40]!r}, no known code page; {remedy}")
    if encoding is None or (is_utf8 and encoding in _WESTERN_ENCODINGS):
        return TextDecoder(
            UTF8, f"read as UTF-8, which their text is, although {page_file.name} states {stated[:40]!r}"
        )
    return _check(
        TextDecoder(encoding),
        cells,
        f"{path}: {page_file.name} beside it states {stated}, which its text is not; {remedy}",
    )


def _field_widths(table: Path) -> dict[str, int]:
    """Return the width in bytes of each field of a dBASE table, by its name as RAW_ENCODING."""
    with open_regular(table) as file:
        header = file.read(_HEADER_BYTES)
        fields = file.read(int.from_bytes(header[8:10], "little") - _HEADER_BYTES)
    rows = (fields[start : start + _FIELD_BYTES] for start in range(0, len(fields) - _FIELD_BYTES + 1, _FIELD_BYTES))
    return {row[:11].split(b"\0")[0].decode(RAW_ENCODING).strip(): row[16] for row in rows}


def _check(decoder: TextDecoder, cells: Iterable[RawCell], problem: str) -> TextDecoder:
    if not _is_decodable(decoder, cells):
        raise InputError(problem)
    return decoder


def _is_decodable(decoder: TextDecoder, cells: Iterable[RawCell]) -> bool:
    try:
        for text, width in cells:
            decoder.decode(text, width)
    except (UnicodeError, LookupError):
        return False
    return True
