"""Pictures of facades."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from facade_core.core.types import AS_FOUND, FacadeCorrections, Pose


@dataclass(frozen=True)
class FacadeImagery:
    """Pictures of one facade, in the order in which they are tried.

    Attributes
    ----------
    photo : photo of it.
    rectified : whether the photo shows the wall alone and upright; else it is as taken.
    panoramas : panoramas that show it and their poses, best first.
    earlier : those of an earlier capture.
    captured : day of each panorama, by path.
    exposure_factors : factors to the common exposure of each panorama that shares ground with others, by path.
    textured : whether its wall carries a texture of the model.
    exemplar : (index, name) of its exemplar.
    is_exemplar_stated : whether a correction names the exemplar, which a pictured facade of the building then leaves alone.
    shops : whether a wall from the exemplar keeps its shops: not where the map has none.
    corrected : its corrections.
    entrances : mapped doors, metres from the left of the wall.
    """

    photo: Path | None = None
    rectified: bool = True
    panoramas: tuple[tuple[Path, Pose], ...] = ()
    earlier: tuple[tuple[Path, Pose], ...] = ()
    captured: Mapping[Path, str] = field(default_factory=dict)
    exposure_factors: Mapping[Path, tuple[float, ...]] = field(default_factory=dict)
    textured: bool = False
    exemplar: tuple[int, str] | None = None
    is_exemplar_stated: bool = False
    shops: bool = True
    corrected: FacadeCorrections = AS_FOUND
    entrances: tuple[float, ...] = ()

    @property
    def is_photographed(self) -> bool:
        """Return whether a photo or panoramas show it."""
        return self.corrected.facade and bool(self.photo or self.panoramas or self.earlier)

    def sources(self) -> tuple[str, ...]:
        """Return the sources in the order of trying: the next one is used where one fails or shows too little.

        A wall that a correction declares plain has none.
        """
        if not self.corrected.facade:
            return ("none",)
        there = {
            "photo": self.photo is not None,
            "panoramas": bool(self.panoramas or self.earlier),
            "own": self.textured,
        }
        return (*(source for source, given in there.items() if given), "none")
