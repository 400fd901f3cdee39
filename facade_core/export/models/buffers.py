"""Binary buffer of a GLB with its buffer views and accessors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from facade_core.core.arrays import NumericArray

# glTF component types.
BYTE = 5120
UNSIGNED_BYTE = 5121
UNSIGNED_SHORT = 5123
UNSIGNED_INT = 5125
FLOAT = 5126
# Greatest index of 16 bits.
MAX_UNSIGNED_SHORT = 65535
# glTF targets of buffer views.
ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963


@dataclass
class GlbBuffer:
    """Growing binary chunk of a glTF document; each view starts at a multiple of eight bytes.

    Attributes
    ----------
    views : bufferViews of the document.
    accessors : accessors of the document.
    chunks : bytes of the views in their order, padded.
    length : bytes so far.
    """

    views: list[dict[str, object]] = field(default_factory=list)
    accessors: list[dict[str, object]] = field(default_factory=list)
    chunks: list[bytes] = field(default_factory=list)
    length: int = 0

    def add_view(self, data: bytes, **more: object) -> int:
        """Append bytes as a buffer view and return its index."""
        self.views.append({"buffer": 0, "byteOffset": self.length, "byteLength": len(data), **more})
        self.chunks.append(data + b"\0" * (-len(data) % 8))
        self.length += len(self.chunks[-1])
        return len(self.views) - 1

    def add_accessor(
        self, values: NumericArray, component: int, kind: str, *, target: int = ARRAY_BUFFER, **more: object
    ) -> int:
        """Append an array as an accessor with a view of its own and return its index.

        Parameters
        ----------
        values : (n, k) one row per element; rows of vertices are padded to multiples of four bytes.
        component : glTF component type, such as FLOAT.
        kind : glTF accessor type, such as "VEC3".
        target : ARRAY_BUFFER for vertices, ELEMENT_ARRAY_BUFFER for indices.
        more : further properties of the accessor, such as min and max.
        """
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
    def document_parts(self) -> dict[str, object]:
        """Return the accessors, bufferViews and buffers of the glTF document."""
        return {"accessors": self.accessors, "bufferViews": self.views, "buffers": [{"byteLength": self.length}]}
