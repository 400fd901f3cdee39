"""Records of facades."""

from __future__ import annotations

from facade_core.facade.stored_record import StoredFacadeRecord
from facade_core.facade.variation.hierarchy import Hierarchy


class FacadeRecord(StoredFacadeRecord, total=False):
    """Record of a facade: fields that code reads by name, besides those of its pictures.

    Fields that only the catalogue reads are those of `catalogs.published.columns.COLUMNS`.

    Attributes
    ----------
    corrected : whether somebody corrected it.
    facade : False for a wall that is said to be no facade.
    label_digest : digest of its labels, which surfaces read.
    change_map : changed cells.
    before_file : stored picture of the facade at the earlier capture.
    before_digest : its digest.
    occluded : occluded share.
    masked : boxes of masked objects, pixels.
    implausible : whether a wall from an exemplar has an implausible layout, as in `facade_core.facade.layout.settings`.
    foreign_share : as in `facade_core.facade.texture_faults`; none without pictures.
    doubtful_inpainting_m : radius of the largest circle that is inpainted throughout, times the doubt of the parse in the
        inpainted part, metres; none without pictures.
    pictured_colour : lit colour of the wall, 0..255, as its photo or panoramas show it; none where they show too little.
    common_exposure : whether it has the exposure that all panoramas with common ground have.
    tone_slope : slopes at black of the tone curve that brought it to the exposure of its building; none of 1.
    looked : whether faces and plates were looked for.
    stretched : how many times wider, for its height, the wall is than the cut.
    """

    corrected: bool
    facade: bool
    label_digest: str
    change_map: list[str]
    before_file: str
    before_digest: str
    floors: int
    occluded: float
    masked: list[list[int]]
    implausible: bool
    foreign_share: float
    doubtful_inpainting_m: float
    pictured_colour: list[float]
    common_exposure: bool
    tone_slope: list[float]
    looked: bool
    stretched: float


def count_variations(hierarchy: Hierarchy) -> dict[str, int]:
    """Return the fields of a record on a variation hierarchy."""
    return {
        "variation_types": int((hierarchy.levels[0].counts > 0).sum()),
        "variation_levels": len(hierarchy.levels),
        "variation_bytes": int(hierarchy.nbytes),
    }


def names_source(source: str | None, name: str) -> bool:
    """Return True if the source of a texture names a picture or exemplar, whose name may contain a comma."""
    return f", {name}, " in f", {source or ''}, "
