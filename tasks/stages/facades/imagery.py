"""Inputs of facades."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from facade_core.core.types import AS_FOUND, SHIPPED_MODELS, FacadeCorrections, Pose, Privacy, TrainedModelFiles
from tasks.engine.inputs import (
    GEOMETRY_CHANGED,
    MODELS_CHANGED,
    PANORAMAS_CHANGED,
    SETTINGS_CHANGED,
    SURROUNDINGS_CHANGED,
    input_field,
)
from tasks.stages.shared.scene_view import SceneView

EXEMPLAR_CHANGED = "exemplar changed"
HOUSE_CHANGED = "pictures of the building changed"
OWN_TEXTURE_CHANGED = "own texture changed"
PHOTO_CHANGED = "photo changed"


@dataclass(frozen=True)
class ChosenExemplar:
    """Exemplar of a facade.

    Attributes
    ----------
    index : its index in the block.
    name : its name.
    key : key of the unit that prepared it.
    ground_floor : exemplar whose ground floor it shows, None for its own, "plain" where no exemplar shows one well.
    """

    index: int
    name: str
    key: str = ""
    ground_floor: ChosenExemplar | Literal["plain"] | None = None

    def digest_content(self) -> tuple[object, ...]:
        """Return the values that stand for it in keys: its index differs between blocks."""
        other = self.ground_floor
        return self.name, self.key, other.digest_content() if isinstance(other, ChosenExemplar) else other

    @property
    def names(self) -> str:
        """Return its name and that of the exemplar whose ground floor it shows."""
        other = self.ground_floor
        return f"{self.name}, {other.name}" if isinstance(other, ChosenExemplar) else self.name


@dataclass(frozen=True)
class FacadeImagery:
    """Pictures of one facade, in the order in which they are tried.

    Attributes
    ----------
    corrected : its corrections.
    photo : photo of it.
    rectified : whether the photo shows the wall alone and upright; else it is as taken.
    panoramas : panoramas that show it and their poses, best first.
    earlier : those of an earlier capture.
    captured : day of each panorama, by path.
    exposure_factors : factors to the common exposure of each panorama that shares ground with others, by path.
    textured : whether its wall carries a texture of the model.
    exemplar : its exemplar.
    is_exemplar_stated : whether a correction names the exemplar, which a pictured facade of the building then leaves alone.
    entrances : mapped doors, metres from the left of the wall.
    """

    corrected: FacadeCorrections = input_field("corrected", default=AS_FOUND)
    photo: Path | None = input_field(PHOTO_CHANGED, new="new photo", default=None)
    rectified: bool = input_field(PHOTO_CHANGED, default=True)
    panoramas: tuple[tuple[Path, Pose], ...] = input_field(PANORAMAS_CHANGED, default=())
    earlier: tuple[tuple[Path, Pose], ...] = input_field("panoramas of an earlier capture changed", default=())
    captured: Mapping[Path, str] = input_field(PANORAMAS_CHANGED, default_factory=dict)
    exposure_factors: Mapping[Path, tuple[float, ...]] = input_field(PANORAMAS_CHANGED, default_factory=dict)
    textured: bool = input_field(OWN_TEXTURE_CHANGED, default=False)
    exemplar: ChosenExemplar | None = input_field(EXEMPLAR_CHANGED, default=None)
    is_exemplar_stated: bool = input_field(EXEMPLAR_CHANGED, default=False)
    entrances: tuple[float, ...] = input_field("entrances of the map changed", default=())

    @property
    def is_photographed(self) -> bool:
        """Return whether a photo or panoramas show it."""
        return self.corrected.facade and bool(self.photo or self.panoramas or self.earlier)


@dataclass(frozen=True, kw_only=True)
class FacadeInputs(FacadeImagery):
    """Inputs of one facade.

    Attributes
    ----------
    own : its wall with the texture of the model that it carries; None without one.
    view : its wall as pictures show it.
    between : what may stand between it and its panoramas.
    house_view : its wall and those around it, to which a wall from an exemplar fits.
    exposed_with : keys of the photographed facades of the building, which take one exposure.
    coloured_by : keys of the pictured facades of the building, which give colour and style to the others.
    models : trained models.
    walls : how walls without pictures are textured.
    privacy : treatment of people and cars.
    seed, wall_seed, building_seed : seeds of the facade, of its wall and of its building.
    texture_files : files of `own`, by their number in the model.
    beside : the other facades of the building with pictures, by index.
    """

    own: SceneView | None = input_field(OWN_TEXTURE_CHANGED)
    between: SceneView = input_field(SURROUNDINGS_CHANGED)
    house_view: SceneView = input_field(SURROUNDINGS_CHANGED)
    models: TrainedModelFiles = input_field(MODELS_CHANGED, default=SHIPPED_MODELS)
    view: SceneView = input_field(GEOMETRY_CHANGED)
    walls: str = input_field("block's texture.walls changed")
    privacy: Privacy = input_field(SETTINGS_CHANGED)
    seed: int = input_field(SETTINGS_CHANGED)
    wall_seed: int = input_field(SETTINGS_CHANGED)
    building_seed: int = input_field(SETTINGS_CHANGED)
    exposed_with: tuple[str, ...] = input_field(HOUSE_CHANGED, default=())
    coloured_by: tuple[str, ...] = input_field(HOUSE_CHANGED, default=())
    texture_files: Mapping[int, Path] = field(default_factory=dict)
    beside: tuple[int, ...] = field(default=())


def iterate_sources(imagery: FacadeImagery) -> Iterator[str]:
    """Iterate over the pictures of a facade in the order of trying: the next is used where one fails or shows too little.

    Looks at no picture before it is asked for. A wall that a correction declares plain has none.
    """
    if not imagery.corrected.facade:
        return
    if imagery.photo is not None:
        yield "photo"
    if imagery.panoramas or imagery.earlier:
        yield "panoramas"
    if imagery.textured:
        yield "own"
