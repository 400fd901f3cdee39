"""A first run writes into a new or empty folder, or into one of its own."""

from pathlib import Path

import pytest

from facade_core.core.errors import InputError
from flows.output_folder import check_output_folder


def test_a_folder_of_other_files_is_refused_in_one_line_naming_some(tmp_path: Path) -> None:
    for name in ("a.txt", "b.txt", "c", "d.txt"):
        (tmp_path / name).touch()
    with pytest.raises(
        InputError, match=r"holds other files \(a\.txt, b\.txt, c, \.\.\.\); name a new or empty folder with --out"
    ):
        check_output_folder(tmp_path)


@pytest.mark.parametrize("own", [None, ".lock", "input", "store"])
def test_a_new_an_empty_and_a_used_folder_are_taken(tmp_path: Path, own: str | None) -> None:
    check_output_folder(tmp_path / "new")
    if own is not None:
        (tmp_path / own).touch()
        (tmp_path / "notes.txt").touch()
    check_output_folder(tmp_path)
