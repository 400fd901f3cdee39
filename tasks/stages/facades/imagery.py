"""Pictures of facades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from catalogs.features import file_stem
from facade_core.core.types import AS_FOUND, FacadeCorrection, Pose


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
    textured : whether its wall carries a texture of the model.
    exemplar : (index, name) of its exemplar.
    shops : whether a wall from the exemplar keeps its shops: not where the map has none.
    corrected : its corrections.
    entrances : mapped doors, metres from the left of the wall.
    """

    photo: Path | None = None
    rectified: bool = True
    panoramas: tuple[tuple[Path, Pose], ...] = ()
    earlier: tuple[tuple[Path, Pose], ...] = ()
    captured: Mapping[Path, str] = field(default_factory=dict)
    textured: bool = False
    exemplar: tuple[int, str] | None = None
    shops: bool = True
    corrected: FacadeCorrection = AS_FOUND
    entrances: tuple[float, ...] = ()

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


def collect_imagery(
    names: Sequence[str],
    photos: Mapping[str, Path],
    rectified: bool,
    panoramas: Sequence[Sequence[tuple[Path, Pose]]],
    earlier: Sequence[Sequence[tuple[Path, Pose]]],
    captured: Mapping[Path, str],
    textured: Sequence[bool],
    exemplars: Mapping[int, tuple[int, str]],
    shops: Sequence[int],
    entrances: Sequence[tuple[float, ...]],
    corrected: Mapping[int, FacadeCorrection],
) -> list[FacadeImagery]:
    """Collect the imagery of every facade.

    Parameters
    ----------
    names : ids of the facades.
    photos : by file name.
    captured : by path of the panorama; all others by facade.
    """
    return [
        FacadeImagery(
            photo=photos.get(name, photos.get(file_stem(name))),
            rectified=rectified,
            panoramas=tuple(panoramas[i]),
            earlier=tuple(earlier[i]),
            captured={path: captured[path] for path, _ in (*panoramas[i], *earlier[i]) if path in captured},
            textured=bool(textured[i]),
            exemplar=exemplars.get(i) if corrected.get(i, AS_FOUND).facade else None,
            shops=shops[i] != 0,
            corrected=corrected.get(i, AS_FOUND),
            entrances=entrances[i],
        )
        for i, name in enumerate(names)
    ]
