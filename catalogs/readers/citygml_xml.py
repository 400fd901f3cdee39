"""CityGML as a stream of elements, so that a city of any size needs the memory of one building.

Names are matched without their namespaces, so one reader serves GML 3.1.1 and 3.2 and every version of CityGML.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, cast

from facade_core.errors import InputError

if TYPE_CHECKING:
    from lxml.etree import _Element as Element

_ID = ("{http://www.opengis.net/gml}id", "{http://www.opengis.net/gml/3.2}id")
_MEMBERS = ("Building", "cityObjectMember", "featureMember", "appearanceMember")


def elements(path: Path, names: Collection[str]) -> Iterator[Element]:
    """Elements of these local names as they end; buildings and members are cleared when the next is asked for.

    path: a file, gzipped or not. Prefixes without a namespace are common in attributes that do not matter here, hence the
    recovery: every other flaw is an InputError.
    """
    from lxml import etree

    try:
        with _opened(path) as stream:
            events = etree.iterparse(
                stream,
                events=("end",),
                tag=[f"{{*}}{name}" for name in {*names, *_MEMBERS}],
                resolve_entities=False,
                no_network=True,
                huge_tree=True,
                recover=True,
            )
            for _, element in events:
                if local_name(element) in names:
                    yield element
                if local_name(element) in _MEMBERS:
                    element.clear()
                    parent = element.getparent()
                    while parent is not None and parent[0] is not element:
                        del parent[0]
    except (OSError, EOFError, zlib.error, etree.XMLSyntaxError) as error:
        raise InputError(f"{path} cannot be read ({' '.join(str(error).split())[:120]}); export it again") from error
    if events.root is not None and events.root.getroottree().docinfo.internalDTD is not None:
        raise InputError(f"{path} declares a DTD, which CityGML has no use for; delete its <!DOCTYPE ...>")
    for flaw in events.error_log.filter_from_fatals():
        raise InputError(f"{path} is no well-formed XML (line {flaw.line}: {flaw.message.strip()}); export it again")


def local_name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def id_of(element: Element) -> str:
    """The gml:id of an element, empty where it has none."""
    return next((id for key in _ID if (id := element.get(key))), "")


def numbers_of(text: str | None) -> list[float]:
    """Numbers of a list; NaN where one of them is none."""
    try:
        return [float(number) for number in (text or "").replace(",", " ").split()]
    except ValueError:
        return [float("nan")]


def _opened(path: Path) -> IO[bytes]:
    with path.open("rb") as file:
        zipped = file.read(2) == b"\x1f\x8b"
    return cast("IO[bytes]", gzip.open(path)) if zipped else path.open("rb")
