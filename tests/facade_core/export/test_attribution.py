"""Who is named for a model: each licence once, and what states none."""

from __future__ import annotations

from facade_core.export.city_models.attribution import Attribution, Source, joined_lines

OSM = "OpenStreetMap contributors, ODbL 1.0"


def test_a_licence_is_named_once_and_silence_is_told() -> None:
    sources = (
        Source("buildings.path", "city.pbf", OSM),
        Source("streets.path", "city.pbf", OSM),
        Source("imagery.photos.path", "photos"),
        Source("imagery.aerial.path", "a;b.tif", "City; CC BY 4.0"),
    )
    found = Attribution(sources, "2026-01-02", ("2025-05-01", "2025-06-01"))
    assert found.line == (f"© {OSM}; © City, CC BY 4.0; photos: licence not stated; textured by Streetloom, 2026-01-02")
    value = found.value()
    assert [source["licence"] for source in value["sources"]] == [OSM, OSM, "not stated", "City; CC BY 4.0"]
    assert value["captured"] == ["2025-05-01", "2025-06-01"]
    assert Attribution(()).line == "textured by Streetloom"
    assert Attribution(()).value().keys() == {"line", "sources"}


def test_lines_of_several_models_are_one() -> None:
    assert joined_lines(["© A; © B", "", "© B; © C"]) == "© A; © B; © C"
