"""Fields of the stored record of a facade."""

from __future__ import annotations

from facade_core.atlas.journal import Record


class StoredFacadeRecord(Record, total=False):
    """Fields of a facade's record that its pictures are drawn from.

    Attributes
    ----------
    source : picture or exemplar that the facade is made from.
    lattice : rows and columns, texels.
    elements : label, x0, y0, x1, y1 in texels, confidence, depth in metres outward, source of the depth.
    provenance : share of texels of each provenance.
    cut_kept : share of the rectified picture that was cut out.
    cut_found : whether a facade was found there.
    cut_notes : what of the photo was left out, in words.
    variation_levels : levels of the variation hierarchy.
    variation_file : stored file of the variations.
    variation_digest : its digest.
    """

    source: str
    lattice: dict[str, list[int]]
    elements: list[tuple[str, float, float, float, float, float, float, str]]
    provenance: list[float]
    cut_kept: float
    cut_found: bool
    cut_notes: list[str]
    variation_levels: int
    variation_file: str
    variation_digest: str
