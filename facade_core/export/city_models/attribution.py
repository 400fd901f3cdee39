"""Where a block's data are from and under which licences, as every format that is handed on says it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

PRODUCER = "textured by Streetloom"
_EXTENT = ("startDate", "endDate")


@dataclass(frozen=True, slots=True)
class DataSource:
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

    sources: tuple[DataSource, ...]
    production_date: str | None = None
    capture_period: tuple[str, str] | None = None

    @property
    def licences(self) -> list[str]:
        """Each licence that is stated, once."""
        return _unique_names(source.licence for source in self.sources if source.licence)

    @property
    def line(self) -> str:
        """One line, parts apart by "; " as CesiumJS takes glTF's `asset.copyright` apart: each licence once, then the sources
        that state none."""
        silent = _unique_names(source.name for source in self.sources if not source.licence)
        return "; ".join(
            [
                *(f"© {licence}" for licence in self.licences),
                *([f"{', '.join(silent)}: licence not stated"] if silent else []),
                f"{PRODUCER}, {self.production_date}" if self.production_date else PRODUCER,
            ]
        )

    def to_json(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "line": self.line,
            "sources": [
                {"key": source.key, "name": source.name, "licence": source.licence or "not stated"}
                for source in self.sources
            ],
            **({"made": self.production_date} if self.production_date else {}),
            **({"captured": list(self.capture_period)} if self.capture_period else {}),
        }

    def tags(self) -> dict[str, str]:
        """The same as texts by name, for formats that have no more: the line, and the value as JSON."""
        return {"attribution": self.line, "sources": json.dumps(self.to_json(), ensure_ascii=False)}

    def iso_metadata(self) -> dict[str, Any]:
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
                {"temporalExtent": {k: f"{d}T00:00:00Z" for k, d in zip(_EXTENT, self.capture_period, strict=True)}}
                if self.capture_period
                else {}
            ),
        }


def _unique_names(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(value.replace(";", ",") for value in values))


def merge_attribution_lines(lines: Iterable[str]) -> str:
    """The lines of several models as one, every part once."""
    return "; ".join(dict.fromkeys(part for line in lines if line for part in line.split("; ")))
