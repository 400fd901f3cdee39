"""Records of streets and viewpoints."""

from __future__ import annotations

from typing import NotRequired, TypedDict

from facade_core.atlas.journal import Record, StreetWaveRecord


class ViewpointRecord(Record, total=False):
    """Record of a viewpoint.

    Attributes
    ----------
    panorama : digest of the panorama; missing where none is stored.
    passes : digest of the parts that other streets blend.
    """

    panorama: str
    passes: str


class ViewpointResult(TypedDict):
    """Fields of a viewpoint's record that its worker knows."""

    passes: str
    panorama: NotRequired[str]
    worker: str
    started: float
    seconds: dict[str, float]


class StreetResult(TypedDict):
    """Fields of a street's record that its worker knows."""

    digests: dict[str, str]
    texels: int
    worker: str
    started: float
    seconds: dict[str, float]


class StreetRecord(StreetWaveRecord, total=False):
    """Record of a street.

    Attributes
    ----------
    texels : texels with a view.
    chain : digest of the viewpoint keys that it blends; empty for a material field.
    commits : seconds of each commit of viewpoints.
    """

    texels: int
    chain: str
    commits: list[float]
