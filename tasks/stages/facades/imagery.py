"""What the texture of a facade, or of a piece of ground, is made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from catalogs.features import file_stem
from facade_core.core.types import AS_FOUND, FacadeCorrection, Pose


@dataclass(frozen=True)
class FacadeImagery:
    """The pictures that there are of one facade, in the order in which they are tried.

    Args:
        photo: a photo of it.
        rectified: whether that shows the wall alone, upright; else it is as taken from the street.
        panoramas: those that show it and their poses, best first.
        earlier: of those that show it as it was before, by an earlier capture.
        captured: the days of all these by their path, where they are told.
        textured: whether its wall carries a texture of the source's own.
        exemplar: (index, name) of the one chosen for it.
        shops: whether a wall that is made of that keeps its shops: no where the map has none.
        corrected: what somebody said of it.
        entrances: where the map has doors in it, metres from the left of the wall as it is laid out.
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
        """What the facade can be made from, in the order of trying: where one fails or shows too little, the next.
        A wall that is said to be no facade is made from none."""
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
    """The imagery of every facade; `names` are the facades' ids, `photos` is by name of the file, `captured` by
    panorama, the rest by facade."""
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
