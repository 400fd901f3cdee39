"""The variations of a facade out of a store: bytes as they were coded, or why there are none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import zarr

from facade_core.atlas.stored_files import digest_stored_file, variation_hierarchy_path, write_stored_file
from facade_core.core.errors import StoreError
from facade_core.core.types import Element
from facade_core.export.pictures.stage_pictures import StoredFacade
from facade_core.facade.variation.encoding import encode


def stored(group: Any, record: dict[str, Any]) -> StoredFacade:
    return StoredFacade(group, None, 0, record, {})  # type: ignore[arg-type]  # no raster is read


def test_a_store_has_the_file_as_it_is() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 30, 3), dtype=np.uint8)
    coded = encode(image, [Element("window", 5, 5, 15, 20)])
    group = zarr.open_group(zarr.storage.MemoryStore(), mode="w")
    path = variation_hierarchy_path(7)
    write_stored_file(group, path, coded.to_bytes(), "variations")
    record: Any = {
        "status": "done",
        "variation_levels": 1,
        "variation_file": path,
        "variation_digest": digest_stored_file(coded.to_bytes()),
    }
    assert group[path][:].tobytes() == coded.to_bytes()
    np.testing.assert_array_equal(stored(group, record).reconstruct_level(0), coded.photo)
    group[path][3] ^= 1
    with pytest.raises(StoreError, match="the next run makes it again"):
        _ = stored(group, record).hierarchy


def test_a_facade_without_stored_variations_names_the_remedy() -> None:
    record: Any = {"status": "done", "variation_levels": 3}
    with pytest.raises(StoreError, match="this facade has no stored variations; run the block again"):
        stored(None, record).reconstruct_level(0)
