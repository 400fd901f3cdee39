"""Order in which the pictures of a chart are taken, so that few of them show all of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facade_core.imagery.rectify.panorama import Sighting

# Share of a chart that a picture must show besides those before it, to be taken before better ones.
MIN_ADDED_SHARE = 0.1


def order_by_coverage(sightings: Sequence[Sighting]) -> list[Sighting]:
    """Order the sightings of a chart so that the first ones show most of it together.

    Each next sighting is the one with the highest score of what none before it shows. Those that add less than
    MIN_ADDED_SHARE follow by score: panoramas, which mostly show all of a wall, keep their order.

    Parameters
    ----------
    sightings : sightings of one chart, best first.
    """
    left, ordered = list(sightings), []
    covered = np.zeros_like(left[0].is_seen) if left else np.zeros(0, bool)
    while left:
        added = [float((one.is_seen & ~covered).mean()) for one in left]
        gains = [
            one.score * share / one.seen_share if share >= MIN_ADDED_SHARE else 0.0
            for one, share in zip(left, added, strict=True)
        ]
        if max(gains) == 0:
            break
        ordered.append(left.pop(int(np.argmax(gains))))
        covered = covered | ordered[-1].is_seen
    return ordered + left
