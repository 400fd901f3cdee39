"""Streets cut at junctions, so that viewpoints do not depend on the partition of a city."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from shapely.ops import substring

from facade_core.core.types import Street

# Distance of a cut from the street's end and from the previous cut.
MIN_SEGMENT_LENGTH_M = 60.0


def split_streets_at_junctions(streets: Sequence[Street]) -> tuple[Street, ...]:
    """Cut streets at junctions, each from its start.

    The junctions used depend only on the streets that meet there. A segment's id is its street's, with .0, .1, ... if
    there are several.
    """
    met = Counter(place for street in streets for place in _vertices(street))
    return tuple(segment for street in streets for segment in _split_street(street, met))


def _vertices(street: Street) -> set[tuple[float, float]]:
    return set(map(tuple, shapely.get_coordinates(street.line).tolist()))


def _split_street(street: Street, met: Counter[tuple[float, float]]) -> list[Street]:
    points = shapely.get_coordinates(street.line)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    cuts = [0.0]
    for place, at in zip(map(tuple, points.tolist()), along.tolist(), strict=True):
        if met[place] > 1 and at - cuts[-1] >= MIN_SEGMENT_LENGTH_M and along[-1] - at >= MIN_SEGMENT_LENGTH_M:
            cuts.append(at)
    if len(cuts) == 1:
        return [street]
    ends = [*cuts[1:], float(along[-1])]
    return [
        replace(street, id=f"{street.id}.{number}", line=substring(street.line, start, end))
        for number, (start, end) in enumerate(zip(cuts, ends, strict=True))
    ]
