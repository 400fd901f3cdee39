"""Streets of one wave share no chunk that either writes; a street waits for those of earlier waves that do."""

from __future__ import annotations

import numpy as np

from facade_core.geometry.streets import assign_streets_to_waves, street_predecessors


def test_waves_separate_writers_and_readers() -> None:
    rng = np.random.default_rng(3)
    writes = [set(rng.choice(60, 6, replace=False).tolist()) for _ in range(20)]
    reads = [w | set(rng.choice(60, 4, replace=False).tolist()) for w in writes]
    wave = assign_streets_to_waves(reads, writes)
    for a in range(20):
        for b in range(a):
            if wave[a] == wave[b]:
                assert not writes[a] & reads[b]
                assert not writes[b] & reads[a]
    assert set(wave) == set(range(wave.max() + 1))


def test_reading_the_same_chunk_is_no_conflict() -> None:
    assert assign_streets_to_waves([{1, 9}, {2, 9}], [{1}, {2}]).tolist() == [0, 0]


def test_no_streets() -> None:
    assert len(assign_streets_to_waves([], [])) == 0


def _pairs(chunks: list[set[int]]) -> np.ndarray:
    return np.array([(street, chunk) for street, of in enumerate(chunks) for chunk in of], np.int64).reshape(-1, 2)


def test_a_street_waits_for_all_of_earlier_waves_that_it_shares_chunks_with_and_for_no_other() -> None:
    rng = np.random.default_rng(4)
    writes = [set(rng.choice(90, 5, replace=False).tolist()) for _ in range(25)]
    reads = [w | set(rng.choice(90, 3, replace=False).tolist()) for w in writes]
    wave = assign_streets_to_waves(reads, writes)
    found = street_predecessors(wave, _pairs(reads), _pairs(writes))
    for street in range(25):
        share = {o for o in range(25) if o != street and (writes[o] & reads[street] or writes[street] & reads[o])}
        assert set(found[street].tolist()) == {other for other in share if wave[other] < wave[street]}
        assert all(wave[other] > wave[street] for other in share - set(found[street].tolist()))
    assert 0 < sum(map(len, found)) < sum(int((wave < w).sum()) for w in wave)


def test_who_waits_for_none() -> None:
    assert street_predecessors(np.zeros(0, np.int32), _pairs([]), _pairs([])) == []
    assert [
        one.tolist() for one in street_predecessors(np.array([0, 1]), _pairs([{1}, {2}]), _pairs([{1}, set()]))
    ] == [
        [],
        [],
    ]
