"""Stream of CityGML elements, which needs the memory of one building for a city of any size.

Names are matched without namespaces, so that one reader covers GML 3.1.1 and 3.2 and every version of CityGML.
"""

from __future__ import annotations

import gzip
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, cast

from catalogs.reader_errors import wrap_reader_errors
from catalogs.readers.settings import LIMITS, MODELS
from facade_core.core.errors import InputError
from facade_core.core.regular_files import open_regular

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_ID_ATTRIBUTES = ("{http://www.opengis.net/gml}id", "{http://www.opengis.net/gml/3.2}id")
_MEMBER_NAMES = ("Building", "cityObjectMember", "featureMember", "appearanceMember", "surfaceDataMember")


def iterate_elements(path: Path, names: Collection[str]) -> Iterator[Element]:
    """Yield elements of the local names as they end.

    Buildings and members are cleared afterwards. The parser runs in recovery mode, since prefixes without a namespace
    are common in irrelevant attributes.

    Parameters
    ----------
    path : file, also gzipped.
    names : local names.

    Raises
    ------
    InputError
        Where the file is not well-formed, declares a DTD, or exceeds the limits.
    """
    from lxml import etree

    with wrap_reader_errors(path, "cannot be read", "export it again"), _open_maybe_gzipped(path) as file:
        stream = _BoundedFile(file, path)
        events = etree.iterparse(
            stream,
            events=("end",),
            tag=[f"{{*}}{name}" for name in {*names, *_MEMBER_NAMES}],
            resolve_entities=False,
            no_network=True,
            huge_tree=True,
            recover=True,
        )
        for _, element in events:
            if local_name(element) in names:
                yield element
            if local_name(element) in _MEMBER_NAMES:
                stream.start_member()
                element.clear()
                parent = element.getparent()
                while parent is not None and parent[0] is not element:
                    del parent[0]
    if events.root is not None and events.root.getroottree().docinfo.internalDTD is not None:
        raise InputError(f"{path} declares a DTD, which CityGML has no use for; delete its <!DOCTYPE ...>")
    for flaw in events.error_log.filter_from_fatals():
        raise InputError(f"{path} is no well-formed XML (line {flaw.line}: {flaw.message.strip()}); export it again")


class _BoundedFile:
    """File wrapper that limits the size in memory and after decompression."""

    def __init__(self, file: IO[bytes], path: Path) -> None:
        self._file, self._path = file, path
        self._total = self._bytes = self._tags = 0
        self._most = max(MODELS.min_unpack_limit_bytes, LIMITS.max_unpack_ratio * path.stat().st_size)

    def start_member(self) -> None:
        """Reset the counters of bytes and tags in memory."""
        self._bytes = self._tags = 0

    def read(self, size: int) -> bytes:
        """Read at most `size` bytes."""
        part = self._file.read(size)
        self._total += len(part)
        self._bytes += len(part)
        self._tags += part.count(b"<")
        if self._total > self._most:
            raise InputError(f"{self._path} unpacks to over {LIMITS.max_unpack_ratio} times its size; export it again")
        if self._bytes > MODELS.max_member_bytes or self._tags > MODELS.max_member_tags:
            raise InputError(
                f"{self._path} holds a member of over {MODELS.max_member_bytes // 2**20} MB or {MODELS.max_member_tags} tags; "
                "cut the file up"
            )
        return part


def local_name(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def gml_id(element: Element) -> str:
    """Return the gml:id of an element, empty without one."""
    return next((id for key in _ID_ATTRIBUTES if (id := element.get(key))), "")


def parse_numbers(text: str | None) -> list[float]:
    """Return the numbers of a list; [NaN] where one of them is invalid."""
    try:
        return [float(number) for number in (text or "").replace(",", " ").split()]
    except ValueError:
        return [float("nan")]


def _open_maybe_gzipped(path: Path) -> IO[bytes]:
    with open_regular(path) as file:
        zipped = file.read(2) == b"\x1f\x8b"
    return cast("IO[bytes]", gzip.open(open_regular(path))) if zipped else open_regular(path)
