"""The one buffer of a GLB, as it is put together: views of it, and accessors of what lies in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

# glTF component types.
BYTE = 5120
UNSIGNED_SHORT = 5123
UNSIGNED_INT = 5125
FLOAT = 5126
# glTF targets of buffer views.
ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963


@dataclass
class GlbBuffer:
    """bufferViews and accessors of a glTF document, and the bytes that they are of; each part begins at a multiple of eight."""

    views: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    chunks: list[bytes] = field(default_factory=list)
    length: int = 0

    def add_view(self, data: bytes, **more: Any) -> int:
        """Index of a view of some bytes."""
        self.views.append({"buffer": 0, "byteOffset": self.length, "byteLength": len(data), **more})
        self.chunks.append(data + b"\0" * (-len(data) % 8))
        self.length += len(self.chunks[-1])
        return len(self.views) - 1

    def add_accessor(
        self, values: np.ndarray, component: int, kind: str, *, target: int = ARRAY_BUFFER, **more: Any
    ) -> int:
        """Index of an accessor of values (n, k), whose rows are padded to four bytes where they are a vertex'."""
        stride = {}
        if target == ARRAY_BUFFER:
            width = -(-values.itemsize * values.shape[1] // 4) * 4
            rows = np.zeros((len(values), width // values.itemsize), values.dtype)
            rows[:, : values.shape[1]] = values
            values, stride = rows, {"byteStride": width}
        view = self.add_view(values.tobytes(), target=target, **stride)
        self.accessors.append(
            {"bufferView": view, "componentType": component, "count": len(values), "type": kind, **more}
        )
        return len(self.accessors) - 1

    @property
    def document_parts(self) -> dict[str, Any]:
        """What glTF's document says of it."""
        return {"accessors": self.accessors, "bufferViews": self.views, "buffers": [{"byteLength": self.length}]}
