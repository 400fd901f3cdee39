"""Licences and licensors in the STAC of a snapshot."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catalogs.stac.facts import DataSourceFacts

if TYPE_CHECKING:
    from pystac import Link, Provider

# Ending of a licence's words -> SPDX identifier and address of the text.
SPDX = {
    "ODbL 1.0": ("ODbL-1.0", "https://opendatacommons.org/licenses/odbl/1-0/"),
    "CC BY 4.0": ("CC-BY-4.0", "https://creativecommons.org/licenses/by/4.0/"),
    "CC0 1.0": ("CC0-1.0", "https://creativecommons.org/publicdomain/zero/1.0/"),
    "CC-BY-SA-4.0": ("CC-BY-SA-4.0", "https://creativecommons.org/licenses/by-sa/4.0/"),
    "etalab-2.0": ("etalab-2.0", "https://spdx.org/licenses/etalab-2.0.html"),
}
# STAC's word for a licence without an identifier, or for several.
OTHER_LICENSE = "other"


def common_license(sources: Sequence[DataSourceFacts]) -> str:
    """Return the SPDX identifier that all sources share, or OTHER_LICENSE."""
    found = {known[0] if (known := _spdx_license(source.licence)) else OTHER_LICENSE for source in sources}
    return found.pop() if len(found) == 1 else OTHER_LICENSE


def license_links(sources: Sequence[DataSourceFacts]) -> list[Link]:
    """Return links to the texts of the known licences."""
    import pystac

    texts = dict.fromkeys(known for source in sources if (known := _spdx_license(source.licence)))
    return [pystac.Link("license", url, "text/html", name) for name, url in texts]


def licensors(sources: Sequence[DataSourceFacts]) -> list[Provider]:
    """Return a provider for each stated licence, with its words and its files."""
    import pystac

    files: dict[str, list[str]] = {}
    for source in sources:
        if source.licence:
            files.setdefault(source.licence, []).append(f"{source.name} ({source.key})")
    roles = [pystac.ProviderRole.LICENSOR, pystac.ProviderRole.PRODUCER]
    return [
        pystac.Provider(re.split("[,:]", licence)[0], f"{licence}: {', '.join(names)}", roles)
        for licence, names in files.items()
    ]


def _spdx_license(licence: str | None) -> tuple[str, str] | None:
    return next((found for words, found in SPDX.items() if (licence or "").endswith(words)), None)
