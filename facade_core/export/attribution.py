"""Attribution of a block's data with licences, in the form of every export format."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass

from facade_core.core.json_types import JsonObject

PRODUCER = "textured by Streetloom"
# Licence of a source whose licence is not stated, in JSON.
NOT_STATED = "not stated"
_EXTENT = ("startDate", "endDate")


@dataclass(frozen=True, slots=True)
class DataSource:
    """Data source of a block with its licence.

    Attributes
    ----------
    key : key of the block file, such as buildings.path.
    name : name of the file or folder.
    licence : licence with its attribution; None if not stated.
    """

    key: str
    name: str
    licence: str | None = None


@dataclass(frozen=True, slots=True)
class Attribution:
    """Data sources, licences and dates of a block.

    Attributes
    ----------
    sources : sources in the order of the block file; empty if unknown.
    production_date : ISO 8601 date of the newest content; None where the bytes must not depend on the date.
    capture_period : first and last day of the pictures by their EXIF data.
    """

    sources: tuple[DataSource, ...]
    production_date: str | None = None
    capture_period: tuple[str, str] | None = None

    @property
    def licences(self) -> list[str]:
        """Return each stated licence once."""
        return _unique_names(source.licence for source in self.sources if source.licence)

    @property
    def line(self) -> str:
        """Return one line: licences, then sources without a licence, separated by "; " as CesiumJS splits `asset.copyright`."""
        silent = _unique_names(source.name for source in self.sources if not source.licence)
        return "; ".join(
            [
                *(f"© {licence}" for licence in self.licences),
                *([f"{', '.join(silent)}: licence not stated"] if silent else []),
                f"{PRODUCER}, {self.production_date}" if self.production_date else PRODUCER,
            ]
        )

    def to_json(self) -> JsonObject:
        """Return the attribution as a JSON value."""
        return {
            "line": self.line,
            "sources": [
                {"key": source.key, "name": source.name, "licence": source.licence or NOT_STATED}
                for source in self.sources
            ],
            **({"made": self.production_date} if self.production_date else {}),
            **({"captured": list(self.capture_period)} if self.capture_period else {}),
        }

    def tags(self) -> dict[str, str]:
        """Return the attribution as texts by name, for formats without structure."""
        return {"attribution": self.line, "sources": json.dumps(self.to_json(), ensure_ascii=False)}

    def iso_metadata(self) -> JsonObject:
        """Return the attribution by names of ISO 19115, as in CityJSON's extension MetadataExtended."""
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


def merge_attributions(values: Iterable[JsonObject]) -> Attribution:
    """Merge the attributions of several models, each as `Attribution.to_json` gives it; every source appears once."""
    sources: dict[tuple[str, str, str], None] = {}
    made: list[str] = []
    captured: list[str] = []
    for value in values:
        sources |= dict.fromkeys((one["key"], one["name"], one["licence"]) for one in value["sources"])
        made = [max([*made, value["made"]])] if "made" in value else made
        days = [*captured, *value.get("captured", ())]
        captured = [min(days), max(days)] if days else []
    return Attribution(
        tuple(DataSource(key, name, None if licence == NOT_STATED else licence) for key, name, licence in sources),
        made[0] if made else None,
        (captured[0], captured[1]) if captured else None,
    )


def _unique_names(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(value.replace(";", ",") for value in values))


def merge_attribution_lines(lines: Iterable[str]) -> str:
    """Merge the attribution lines of several models; every part appears once."""
    return "; ".join(dict.fromkeys(part for line in lines if line for part in line.split("; ")))
