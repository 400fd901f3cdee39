"""The licence of a snapshot is said by its identifier where all of its sources have the same, and by nothing that is not so."""

from __future__ import annotations

import pytest

from catalogs.stac.facts import DataSourceFacts
from catalogs.stac.licences import common_license, license_links, licensors

OSM, CITY = "OpenStreetMap contributors, ODbL 1.0", "A city: its buildings, CC BY 4.0"


@pytest.mark.parametrize(
    ("licences", "found"),
    [((OSM, OSM), "ODbL-1.0"), ((OSM, CITY), "other"), ((OSM, None), "other"), (("a policy",), "other"), ((), "other")],
)
def test_one_identifier_or_other(licences: tuple[str | None, ...], found: str) -> None:
    assert common_license([DataSourceFacts("k", "n", licence) for licence in licences]) == found


def test_each_licensor_is_named_once_with_its_files() -> None:
    sources = [
        DataSourceFacts("buildings.path", "a", OSM),
        DataSourceFacts("streets.path", "b", OSM),
        DataSourceFacts("p", "c", CITY),
    ]
    found = licensors([*sources, DataSourceFacts("photos", "d", None)])
    assert [one.name for one in found] == ["OpenStreetMap contributors", "A city"]
    assert found[0].description == f"{OSM}: a (buildings.path), b (streets.path)"
    assert len({link.href for link in license_links(sources)}) == 2
