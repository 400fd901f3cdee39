"""Columns of numbers that may be heights or storeys under a name that is not known."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from catalogs.readers.vectors.lengths import parse_length
from facade_core.core.arrays import Float64Array

if TYPE_CHECKING:
    from pandas import DataFrame

# Heights of buildings and numbers of storeys, in metres or feet.
_PLAUSIBLE_RANGE = (1.0, 1500.0)
_MIN_PLAUSIBLE_SHARE = 0.6  # of the numbers of a column
_MAX_NAMED = 5
_WORDS = (
    "height hght hgt hoeh höhe hohe haut altu altit altez alt_ elev hojd höjd hoogt hoyde høyde korke korgu vysk vyso vyš "
    "wysok visin tall roof eave ridge floor storey stories story level etag geschos piso pian kerro vånin vanin podlaz "
    "kondyg etaz dach kote cota quota pavim plant magas emel yuksek yüksek kat_say высот этаж 高 层 階 높이 층"
)
_HEIGHT_WORD = re.compile(f"{'|'.join(_WORDS.split())}|(?:^|_)(?:h|ht|z|hmax|hmin|zmax|zmin)(?:$|_|\\d)")
_OTHER_WORD = re.compile(
    "area|perim|length|width|angle|azim|year|date|code|count|longi|latit|(?:^|_)(?:id|x|y|no|nr|lon|lat)(?:$|_)"
)


def find_height_like_columns(table: DataFrame) -> list[str]:
    """Return the names of columns that look like heights, those named like one before other fractional numbers.

    Parameters
    ----------
    table : columns whose names are not known.
    """
    numbers = {
        str(name): table[name].to_numpy(np.float64)
        if table[name].dtype.kind in "iuf"
        else np.array([parse_length(str(value)) for value in table[name]], np.float64)
        for name in table
        if table[name].dtype.kind in "iuf" or is_height_like_name(str(name))
    }
    plausible = {name: values for name, values in numbers.items() if _is_plausible(values)}
    names = [name for name in plausible if not _OTHER_WORD.search(name.lower())]
    named = [name for name in names if is_height_like_name(name)]
    return (named or [name for name in names if (plausible[name] % 1.0 > 0).any()])[:_MAX_NAMED]


def is_height_like_name(name: str) -> bool:
    """Return True where a column is named like heights or storeys."""
    return bool(_HEIGHT_WORD.search(name.lower())) and not _OTHER_WORD.search(name.lower())


def _is_plausible(values: Float64Array) -> bool:
    values = values[np.isfinite(values) & (values != 0)]
    low, high = _PLAUSIBLE_RANGE
    return bool(len(values) and np.mean((values >= low) & (values <= high)) >= _MIN_PLAUSIBLE_SHARE)
