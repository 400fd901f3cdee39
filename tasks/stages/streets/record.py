"""Records of streets and viewpoints."""

from __future__ import annotations

from typing import TypedDict

from facade_core.atlas.journal import Record, StreetWaveRecord


class ViewpointRecord(Record, total=False):
    """Record of a viewpoint.

    Attributes
    ----------
    panorama : digest of the panorama.
    passes : digest of the parts that other streets blend.
    textured : share that was textured before translation.
    """

    panorama: str
    passes: str
    textured: float


class ViewpointResult(TypedDict):
    """Fields of a viewpoint's record that its worker knows."""

    textured: float
    passes: str
    panorama: str
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
