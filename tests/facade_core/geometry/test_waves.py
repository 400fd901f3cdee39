"""Streets of one wave share no chunk that either writes."""

from __future__ import annotations

import numpy as np

from facade_core.geometry import colour_waves


def test_waves_separate_writers_and_readers() -> None:
    rng = np.random.default_rng(3)
    writes = [set(rng.choice(60, 6, replace=False).tolist()) for _ in range(20)]
    reads = [w | set(rng.choice(60, 4, replace=False).tolist()) for w in writes]
    wave = colour_waves(reads, writes)
    for a in range(20):
        for b in range(a):
            if wave[a] == wave[b]:
                assert not writes[a] & reads[b]
                assert not writes[b] & reads[a]
    assert set(wave) == set(range(wave.max() + 1))


def test_reading_the_same_chunk_is_no_conflict() -> None:
    assert colour_waves([{1, 9}, {2, 9}], [{1}, {2}]).tolist() == [0, 0]


def test_no_streets() -> None:
    assert len(colour_waves([], [])) == 0
