"""Every format, and what is published, names whom the block is from and under which licence, in the file itself."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tasks.export.formats import export_run
from tasks.publish.published_run import PublishedBlock
from tests.exports import EACH, MAP, READERS, copyright_of

Run = tuple[Path, dict[str, Any]]


@pytest.mark.parametrize("style", EACH)
def test_a_format_names_the_licence_of_the_map(
    found: PublishedBlock, undisturbed: Run, tmp_path: Path, style: str
) -> None:
    name = found.names[int(found.plan.facades.building[found.select_finished_facades(found.select_buildings(()))[0]])]
    line = found.attribution.line
    folder = export_run(undisturbed[0], style, tmp_path / style, [name]).path
    said = list(READERS[style].attributions(Path(str(folder))))
    assert line.startswith(MAP)
    assert said
    assert set(said) == {line}


def test_what_is_published_names_it_without_a_day(found: PublishedBlock) -> None:
    line = replace(found.attribution, production_date=None).line
    folder = Path(str(found.snapshot.folder))
    assert line.startswith(MAP)
    models = [folder / "block.glb", folder / "overview.glb", *(folder / "tiles").glob("*.glb")]
    assert len(models) > 2
    assert {copyright_of(model) for model in models} == {line}
    assert json.loads((folder / "tiles/index.json").read_text())["attribution"]["line"] == line
    for kind in ("facades", "streets", "blocks", "runs"):
        collection = json.loads((folder / f"stac/{kind}/collection.json").read_text())
        licensors = [one for one in collection["providers"] if "licensor" in one["roles"]]
        assert [one["name"] for one in licensors] == ["OpenStreetMap contributors"]
        assert "ODbL 1.0" in licensors[0]["description"]
        assert [link["href"] for link in collection["links"] if link["rel"] == "license"]
        assert collection["license"] == "other", "the exemplars and photos of the block file state none"
    models_of = json.loads((folder / "stac/models/collection.json").read_text())
    assert [one["name"] for one in models_of["providers"]] == ["Streetloom"]
