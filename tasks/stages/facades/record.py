"""Records of facades."""

from __future__ import annotations

from facade_core.atlas.journal import Record
from facade_core.facade.variation.hierarchy import Hierarchy


class FacadeRecord(Record, total=False):
    """Record of a facade: fields that code reads by name.

    Fields that only the catalogue reads are those of `catalogs.published.columns.COLUMNS`.

    Attributes
    ----------
    source : pictures or exemplar that the facade is made from.
    corrected : whether somebody corrected it.
    facade : False for a wall that is said to be no facade.
    label_digest : digest of its labels, which surfaces read.
    change_map : changed cells.
    before_file : stored picture of the facade at the earlier capture.
    before_digest : its digest.
    elements : label, x0, y0, x1, y1, confidence.
    lattice : rows and columns, pixels.
    occluded : occluded share.
    masked : boxes of masked objects, pixels.
    repeated_foot : share of the height at the foot that is hidden, and repeats storeys above.
    pictured_colour : lit colour of the wall, 0..255, as its photo or panoramas show it; none where they show too little.
    common_exposure : whether it has the exposure that all panoramas with common ground have.
    tone_slope : slopes at black of the tone curve that brought it to the exposure of its building; none of 1.
    looked : whether faces and plates were looked for.
    cut_kept : of photos: share of the rectified picture that was cut out.
    cut_found : whether a facade was found there.
    stretched : how many times wider, for its height, the wall is than the cut.
    cut_notes : what of the photo was left out, in words.
    provenance : share of texels of each provenance.
    variation_levels : levels of the variation hierarchy.
    variation_file : stored file of the variations.
    variation_digest : its digest.
    """

    source: str
    corrected: bool
    facade: bool
    label_digest: str
    change_map: list[str]
    before_file: str
    before_digest: str
    floors: int
    elements: list[tuple[str, float, float, float, float, float]]
    lattice: dict[str, list[int]]
    occluded: float
    masked: list[list[int]]
    repeated_foot: float
    pictured_colour: list[float]
    common_exposure: bool
    tone_slope: list[float]
    looked: bool
    cut_kept: float
    cut_found: bool
    stretched: float
    cut_notes: list[str]
    provenance: list[float]
    variation_levels: int
    variation_file: str
    variation_digest: str


def count_variations(hierarchy: Hierarchy) -> dict[str, int]:
    """Return the fields of a record on a variation hierarchy."""
    return {
        "variation_types": int((hierarchy.levels[0].counts > 0).sum()),
        "variation_levels": len(hierarchy.levels),
        "variation_bytes": int(hierarchy.nbytes),
    }
