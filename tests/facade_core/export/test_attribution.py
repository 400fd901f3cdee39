"""Who is named for a model: each licence once, and what states none."""

from __future__ import annotations

from facade_core.export.attribution import Attribution, DataSource, merge_attribution_lines, merge_attributions

OSM = "OpenStreetMap contributors, ODbL 1.0"


def test_a_licence_is_named_once_and_silence_is_told() -> None:
    sources = (
        DataSource("buildings.path", "city.pbf", OSM),
        DataSource("streets.path", "city.pbf", OSM),
        DataSource("imagery.photos.path", "photos"),
        DataSource("imagery.aerial.path", "a;b.tif", "City; CC BY 4.0"),
    )
    found = Attribution(sources, "2026-01-02", ("2025-05-01", "2025-06-01"))
    assert found.line == (f"© {OSM}; © City, CC BY 4.0; photos: licence not stated; textured by Streetloom, 2026-01-02")
    value = found.to_json()
    assert [source["licence"] for source in value["sources"]] == [OSM, OSM, "not stated", "City; CC BY 4.0"]
    assert value["captured"] == ["2025-05-01", "2025-06-01"]
    assert Attribution(()).line == "textured by Streetloom"
    assert Attribution(()).to_json().keys() == {"line", "sources"}


def test_lines_of_several_models_are_one() -> None:
    assert merge_attribution_lines(["© A; © B", "", "© B; © C"]) == "© A; © B; © C"


def test_attributions_of_blocks_are_merged() -> None:
    one = Attribution(
        (DataSource("a", "x.pbf", "ODbL 1.0"), DataSource("b", "y")), "2026-11-01", ("2020-01-01", "2021-01-01")
    )
    two = Attribution(
        (DataSource("a", "x.pbf", "ODbL 1.0"), DataSource("c", "z", "CC0 1.0")), "2026-11-03", ("2019-05-01",) * 2
    )
    bare = Attribution(())
    merged = merge_attributions([one.to_json(), two.to_json(), bare.to_json()])
    assert merged.sources == (*one.sources, two.sources[1])
    assert merged.production_date == "2026-11-03"
    assert merged.capture_period == ("2019-05-01", "2021-01-01")
    assert merge_attributions([one.to_json()]) == one
    assert merge_attributions([]) == bare
