"""Where a block's data are from and under which licences, as every format that is handed on says it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

MAKER = "textured by Streetloom"
_EXTENT = ("startDate", "endDate")


@dataclass(frozen=True, slots=True)
class Source:
    """What a block was made from. key: of the block file, such as buildings.path; name: of the file or folder; licence: as it
    is known, with whoever is to be named; None where nobody stated it."""

    key: str
    name: str
    licence: str | None = None


@dataclass(frozen=True, slots=True)
class Attribution:
    """sources: in the block file's order, none where they are not known.

    made: the day, ISO 8601, on which the newest of what is shown was made; None in what must be the same bytes whenever it is
    made. captured: the first and the last day on which its pictures were taken, where their EXIF says so.
    """

    sources: tuple[Source, ...]
    made: str | None = None
    captured: tuple[str, str] | None = None

    @property
    def licences(self) -> list[str]:
        """Each licence that is stated, once."""
        return _once(source.licence for source in self.sources if source.licence)

    @property
    def line(self) -> str:
        """One line, parts apart by "; " as CesiumJS takes glTF's `asset.copyright` apart: each licence once, then the sources
        that state none."""
        silent = _once(source.name for source in self.sources if not source.licence)
        return "; ".join(
            [
                *(f"© {licence}" for licence in self.licences),
                *([f"{', '.join(silent)}: licence not stated"] if silent else []),
                f"{MAKER}, {self.made}" if self.made else MAKER,
            ]
        )

    def value(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "line": self.line,
            "sources": [
                {"key": source.key, "name": source.name, "licence": source.licence or "not stated"}
                for source in self.sources
            ],
            **({"made": self.made} if self.made else {}),
            **({"captured": list(self.captured)} if self.captured else {}),
        }

    def tags(self) -> dict[str, str]:
        """The same as texts by name, for formats that have no more: the line, and the value as JSON."""
        return {"attribution": self.line, "sources": json.dumps(self.value(), ensure_ascii=False)}

    def iso(self) -> dict[str, Any]:
        """The same by ISO 19115's names, as CityJSON's extension MetadataExtended has them."""
        return {
            "lineage": [
                {
                    "statement": self.line,
                    "source": [
                        {"description": f"{source.name} ({source.key}): {source.licence or 'licence not stated'}"}
                        for source in self.sources
                    ],
                }
            ],
            "constraints": {"legalConstraints": "licence", "userNote": self.line},
            **(
                {"temporalExtent": {k: f"{d}T00:00:00Z" for k, d in zip(_EXTENT, self.captured, strict=True)}}
                if self.captured
                else {}
            ),
        }


def _once(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(value.replace(";", ",") for value in values))


def joined_lines(lines: Iterable[str]) -> str:
    """The lines of several models as one, every part once."""
    return "; ".join(dict.fromkeys(part for line in lines if line for part in line.split("; ")))
