"""Counts of a city are estimated from a few planned parts, those of a small block from its plan, with an interval."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks.city.reading import write_town
from catalogs.block.reader import read_block
from tasks.city import estimated_counts
from tasks.city.block_counts import NO_COUNTS, BlockCounts, share_exemplars
from tasks.city.estimated_counts import choose_sample, estimate_counts, ratio_margin
from tasks.stages.ingest.planning import make_plan


def test_a_city_is_estimated_from_a_sample_of_its_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    town = write_town(tmp_path, 8, 6, metres=100)
    steps: list[str] = []
    monkeypatch.setattr(estimated_counts, "MAX_PLANNED_BUILDINGS", 1000)
    whole = estimate_counts(town)
    monkeypatch.setattr(estimated_counts, "MAX_PLANNED_PARTS", 4)
    found = estimate_counts(town, steps.append)
    assert found.is_city
    assert (found.planned, len(found.blocks)) == (4, len(whole.blocks))
    assert found.parts == whole.parts == whole.planned > 4
    assert whole.margin_s == 0 < found.margin_s
    facades, exact = (sum(one.blocks, NO_COUNTS).facades for one in (found, whole))
    assert facades == pytest.approx(exact, rel=0.1)
    assert [step for step in steps if "part" in step] == [f"planning part {n} of 4" for n in (1, 2, 3, 4)]
    assert estimate_counts(town) == found, "the sample is seeded"


def test_a_small_block_counts_as_planned(tmp_path: Path) -> None:
    write_town(tmp_path, 2, 1)
    found = estimate_counts(tmp_path / "block.yaml")
    plan = make_plan(read_block(tmp_path / "block.yaml"))
    (counts,) = found.blocks
    assert not found.is_city
    assert (counts.facades, counts.viewpoints) == (len(plan.facades), len(plan.viewpoints))


def test_a_large_block_is_one_block_of_sampled_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_town(tmp_path, 6, 4)
    exact = len(make_plan(read_block(tmp_path / "block.yaml")).facades)
    monkeypatch.setattr(estimated_counts, "MAX_PLANNED_PARTS", 3)
    found = estimate_counts(tmp_path / "block.yaml")
    (counts,) = found.blocks
    assert (counts.blocks, found.planned) == (1, 3)
    assert counts.facades == pytest.approx(exact, rel=0.1)


def test_of_many_block_files_a_few_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(5):
        folder = tmp_path / f"town-{number}"
        write_town(folder, 1 + number % 2, 1)
        keys = yaml.safe_load((folder / "block.yaml").read_text())
        named = {
            section: {name: str(folder / value) if name == "path" else value for name, value in keys[section].items()}
            for section in ("buildings", "streets")
        }
        imagery = {"exemplars": {"path": str(folder / keys["imagery"]["exemplars"]["path"])}}
        (tmp_path / "blocks").mkdir(exist_ok=True)
        (tmp_path / "blocks" / f"b{number}.yaml").write_text(yaml.safe_dump(keys | named | {"imagery": imagery}))
    (tmp_path / "blocks" / "b4.yaml").write_text("name: [")
    (tmp_path / "city.yaml").write_text("blocks: {path: blocks}")
    steps: list[str] = []
    monkeypatch.setattr(estimated_counts, "MAX_READ_FILES", 3)
    found = estimate_counts(tmp_path / "city.yaml", steps.append)
    assert (len(steps), len(found.blocks), found.planned, found.parts) == (3, 5, 3, 5)
    assert found.parts_are_files
    assert all(one.facades > 0 for one in found.blocks) or "b4.yaml" in " ".join(steps)


def test_a_sample_takes_one_of_each_stratum() -> None:
    sizes = list(np.random.default_rng(1).permutation(30).astype(float))
    chosen = choose_sample(sizes, 6, seed=3)
    assert sorted(int(sizes[index]) // 5 for index in chosen) == [0, 1, 2, 3, 4, 5]
    assert chosen == choose_sample(sizes, 6, seed=3) != choose_sample(sizes, 6, seed=4)
    assert choose_sample([1.0, 2.0], 6, seed=0) == [0, 1]


def test_an_interval_holds_most_totals() -> None:
    random = np.random.default_rng(2)
    known = random.uniform(10, 100, 60)
    true = known * random.uniform(0.7, 1.3, 60)
    held = 0
    for seed in range(100):
        chosen = choose_sample(known.tolist(), 10, seed)
        total = true[chosen].sum() / known[chosen].sum() * known.sum()
        held += abs(total - true.sum()) <= ratio_margin(known[chosen].tolist(), true[chosen].tolist(), known.tolist())
    assert held >= 90
    assert ratio_margin([1.0, 2.0], [1.0, 3.0], [1.0, 2.0]) == 0


def test_counts_add_up() -> None:
    one = BlockCounts(1, 2, 3, 4, 5, photos=6, panoramas=7, exemplar_megapixels=8)
    assert asdict(one + one)["exemplar_megapixels"] == 16
    shared = sum(share_exemplars([one, one, one]), NO_COUNTS)
    assert (shared.exemplars, shared.exemplar_megapixels, shared.photos) == (4, 8, 18)
