"""Analysed exemplars that a worker keeps between units: many buildings show one exemplar."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from facade_core.atlas.journal import read_records
from facade_core.core.zarr_types import StoreGroup
from facade_core.facade.texture.ground_floor import replace_shops_by_windows
from facade_core.facade.texture.retargeting import ExemplarAnalysis, analyse_exemplar
from tasks.engine.run import Run
from tasks.stages.exemplars.worker import read_exemplar

# Pixels of the exemplars that are kept; each takes 4 bytes, besides the tables of its lattice.
MAX_KEPT_PIXELS = 8_000_000


class _ExemplarKey(NamedTuple):
    """What an analysed exemplar depends on."""

    out: str
    exemplar: int
    key: str
    shops: bool


# The one used last comes last.
_kept: dict[_ExemplarKey, tuple[ExemplarAnalysis, float]] = {}


def load_exemplar_analysis(run: Run, group: StoreGroup, index: int, *, shops: bool) -> tuple[ExemplarAnalysis, float]:
    """Return an analysed exemplar, with or without its shops, and its metres per texel.

    Parameters
    ----------
    run : run of the unit.
    group : root of the store.
    index : number of the exemplar.
    shops : whether its shops are kept, or replaced by windows.
    """
    (record,) = read_records(group, "exemplars", np.array([index]))
    entry = _ExemplarKey(run.out, index, record["key"] if record else "", shops)
    analysed = _kept.pop(entry, None)
    if analysed is None:
        image, labels, metres_per_texel = read_exemplar(group, index)
        if not shops:
            image, labels = replace_shops_by_windows(image, labels)
        analysed = analyse_exemplar(image, labels), metres_per_texel
    _kept[entry] = analysed
    while len(_kept) > 1 and sum(style.labels.size for style, _ in _kept.values()) > MAX_KEPT_PIXELS:
        del _kept[next(iter(_kept))]
    return analysed
