"""Generated inputs: each case is made again by its number, and the readers take a few without a word too few."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.generated_inputs.__main__ import measure
from benchmarks.generated_inputs.cases import write_case
from benchmarks.generated_inputs.child import read_facts
from benchmarks.generated_inputs.judge import FAULTY, judge
from facade_core.core.errors import InputError

SEED = 12


@pytest.mark.parametrize("number", range(12))
def test_inputs_are_read_right_or_named(tmp_path: Path, number: int) -> None:
    case = write_case(SEED, number, tmp_path / "case")
    try:
        answer = read_facts(tmp_path / "case" / "block.yaml") | {"warnings": []}
    except InputError as error:
        answer = {"result": "refused", "message": str(error)}
    outcome, why = judge(case, answer)
    assert outcome not in FAULTY, (case.made, why)


def test_what_nothing_speaks_of_is_silent(tmp_path: Path) -> None:
    number = next(n for n in range(50) if write_case(SEED, n, tmp_path / str(n)).sound)
    case = write_case(SEED, number, tmp_path / "again")
    answer = read_facts(tmp_path / "again" / "block.yaml") | {"warnings": []}
    assert judge(case, answer)[0] in ("right", "noted")
    answer["buildings"][0]["height"] *= 1.1
    for one in answer["buildings"][:1]:
        one["levels"] = None
    answer["notes"] = answer["faults"] = []
    outcome, why = judge(case, answer)
    assert outcome == "silent"
    assert why


def test_cases_are_counted_by_kind(tmp_path: Path) -> None:
    found = measure(SEED, [3], tmp_path)
    assert sum(found["outcomes"].values()) == 1
    assert found["to_mend"] == []
