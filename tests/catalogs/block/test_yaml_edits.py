"""Panoramas named in a block file that somebody wrote: everything else in it stays."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from catalogs.block.yaml_edits import add_imagery_entry

NAMED = {"path": "panoramas", "poses": "panoramas/poses.json"}


@pytest.mark.parametrize(
    "text",
    [
        "name: a  # mine\nbuildings: {path: b}\n",
        "name: a\nimagery:   # pictures\n    # of facades\n    exemplars: {path: e}\nbuildings: {path: b}\n",
        "imagery:\n  exemplars:\n    path: e\n\nname: a\nbuildings: {path: b}",
        "name: a\nbuildings: {path: b}\nimagery:\n",
    ],
)
def test_the_file_names_them_and_keeps_its_lines(tmp_path: Path, text: str) -> None:
    path = tmp_path / "block.yaml"
    path.write_text(text)
    assert add_imagery_entry(path, "panoramas", NAMED)
    before, after = yaml.safe_load(text), yaml.safe_load(path.read_text())
    assert after.pop("imagery") == {**(before.pop("imagery", None) or {}), "panoramas": NAMED}
    assert after == before
    assert [line for line in path.read_text().splitlines() if "panoramas" not in line and line != "imagery:"] == [
        line for line in text.splitlines() if line != "imagery:"
    ]
    assert [one.name for one in tmp_path.iterdir()] == ["block.yaml"]


@pytest.mark.parametrize(
    "text", ["name: a\nimagery: {exemplars: {path: e}}\n", "{name: a, imagery: {}}\n", "{name: a}\n"]
)
def test_one_that_is_written_in_braces_is_left_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "block.yaml"
    path.write_text(text)
    assert not add_imagery_entry(path, "panoramas", NAMED)
    assert path.read_text() == text


def test_a_name_is_quoted_where_yaml_wants_it(tmp_path: Path) -> None:
    path = tmp_path / "block.yaml"
    path.write_text("name: a\n")
    odd = "a: b, {c} #d"
    assert add_imagery_entry(path, "panoramas", {"path": odd, "poses": f"{odd}/poses.json"})
    assert yaml.safe_load(path.read_text())["imagery"]["panoramas"]["path"] == odd


def test_ends_of_lines_stay_and_a_link_stays_one(tmp_path: Path) -> None:
    path, link = tmp_path / "there.yaml", tmp_path / "block.yaml"
    path.write_bytes(b"name: a\nimagery:\r\n  exemplars: {path: e}\r\n")
    link.symlink_to(path)
    assert add_imagery_entry(link, "panoramas", NAMED)
    assert link.is_symlink()
    first, second, added, last = path.read_bytes().splitlines(keepends=True)
    assert (first, second, last) == (b"name: a\n", b"imagery:\r\n", b"  exemplars: {path: e}\r\n")
    assert added.endswith(b"\r\n")
    assert yaml.safe_load(path.read_text())["imagery"]["panoramas"] == NAMED
