"""Key and answers of blind pairs."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def write_key(to: Path, sides: Sequence[tuple[str, str]], **facts: str | int) -> None:
    """Write key.json, with `facts` and the names of A and B of each pair, and answers.csv to be filled in."""
    key = facts | {"pairs": {str(number): dict(zip("AB", names, strict=True)) for number, names in enumerate(sides, 1)}}
    (to / "key.json").write_text(json.dumps(key, indent=1) + "\n", encoding="utf-8")
    with (to / "answers.csv").open("w", encoding="utf-8", newline="") as file:
        rows = [("pair", "preferred", "why"), *((number, "", "") for number in range(1, len(sides) + 1))]
        csv.writer(file, lineterminator="\n").writerows(rows)


def count_answers(answers: Sequence[Mapping[str, str]], key: Mapping[str, Any]) -> dict[str, Any]:
    """Count how often each name of the key was preferred, and the reasons that were given.

    Parameters
    ----------
    answers : rows of pair, preferred and why, reasons separated by ";".
    key : content of key.json.

    Raises
    ------
    SystemExit : a pair is not in the key, or an answer is neither A nor B nor empty.
    """
    preferred: Counter[str] = Counter()
    why: dict[str, Counter[str]] = {}
    for answer in answers:
        pair, said = answer["pair"].strip(), answer["preferred"].strip().upper()
        if pair not in key["pairs"] or said not in ("A", "B", ""):
            raise SystemExit(f"blind pairs: pair {pair!r}, preferred {said!r}: say A, B or nothing of a known pair")
        chosen = key["pairs"][pair][said] if said else "neither"
        preferred[chosen] += 1
        why.setdefault(chosen, Counter()).update(part for p in answer["why"].split(";") if (part := p.strip()))
    names = dict.fromkeys(name for sides in key["pairs"].values() for name in sorted(sides.values(), reverse=True))
    return {
        "pairs": len(answers),
        "preferred": {name: preferred[name] for name in (*names, "neither")},
        "why": {name: dict(reasons.most_common()) for name, reasons in sorted(why.items())},
    }
