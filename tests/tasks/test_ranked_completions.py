"""`streetloom complete`: ranked completions of a picture or of a layout file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from facade_core.core.errors import InputError
from flows.cli.commands import command_line
from tasks.ranked_completions import complete_file


def write_layout(path: Path, **more: object) -> Path:
    """Write a layout whose right half is hidden."""
    windows = [
        {"label": "window", "x0": x, "y0": y, "x1": x + 10, "y1": y + 15} for x in (10, 30, 50) for y in (10, 40, 70)
    ]
    layout = {"width": 140, "height": 100, "objects": windows, "visible": [{"x0": 0, "y0": 0, "x1": 65, "y1": 100}]}
    path.write_text(json.dumps(layout | more))
    return path


def test_completions_are_ranked_and_begin_with_what_is_observed(tmp_path: Path) -> None:
    shown = CliRunner().invoke(command_line, ["complete", str(write_layout(tmp_path / "layout.json")), "--n", "3"])
    assert shown.exit_code == 0, shown.output
    found = json.loads(shown.output)
    assert found["domain"] == [0, 0, 140, 100]
    scores = [one["score"] for one in found["completions"]]
    assert 1 <= len(scores) <= 3
    assert scores == sorted(scores, reverse=True)
    objects = found["completions"][0]["objects"]
    assert [e["is_observed"] for e in objects] == [True] * 9 + [False] * (len(objects) - 9)
    assert all(e["x0"] >= 65 for e in objects[9:])
    assert len(objects) > 9


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"visible": [1]}, "is no layout"),
        ({"objects": [{"label": "window"}]}, "is no layout"),
        ({"width": 0}, "no area"),
    ],
)
def test_files_that_are_no_layout_are_refused(tmp_path: Path, more: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        complete_file(write_layout(tmp_path / "layout.json", **more), 2)
