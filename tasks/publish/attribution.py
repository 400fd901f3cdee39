"""Attribution of a published snapshot, read from its own catalogue."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from datetime import datetime

from catalogs.published.folders import Folder
from catalogs.stac.facts import DataSourceFacts
from catalogs.stac.snapshot import item_file_stem
from facade_core.core.errors import InputError
from facade_core.export.attribution import Attribution, DataSource


def build_attribution(
    sources: Sequence[DataSourceFacts], created: datetime | None = None, captured: Sequence[str] = ()
) -> Attribution:
    """Build the attribution of a block from its data sources.

    Parameters
    ----------
    sources : data sources of the block.
    created : time of publication; None if unknown.
    captured : capture dates of the pictures of its facades, in any order.
    """
    return Attribution(
        tuple(DataSource(source.key, source.name, source.licence) for source in sources),
        created.date().isoformat() if created else None,
        (min(captured), max(captured)) if captured else None,
    )


def read_attribution(stac: Folder, items: Folder, block: str) -> Attribution:
    """Read the attribution of a published block from its STAC Item and item table.

    No source is known where the Item is missing: writing it may have failed alone.

    Parameters
    ----------
    stac : folder of the STAC catalogue.
    items : GeoParquet file with the rows of the block.
    block : name of the block.

    Raises
    ------
    InputError : the item table cannot be read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(items.read_bytes()), columns=["capture_date", "updated"])
    except (OSError, pa.ArrowException) as error:
        raise InputError(f"{items}: cannot be read as GeoParquet; `streetloom run` publishes again") from error
    days = [day for day in table["capture_date"].to_pylist() if day]
    created = max(table["updated"].to_pylist())
    try:
        item = json.loads((stac / "blocks" / f"{item_file_stem(block)}.json").read_bytes())
    except (OSError, ValueError):
        return build_attribution((), created, days)
    listed = item["properties"].get("streetloom:sources", ())
    sources = [DataSourceFacts(source["key"], source["name"], source.get("licence")) for source in listed]
    return build_attribution(sources, created, days)
