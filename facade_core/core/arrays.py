"""Aliases of numpy arrays by dtype, for signatures. Shapes, units and frames are in the docstrings."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
UInt8Array: TypeAlias = NDArray[np.uint8]
UInt16Array: TypeAlias = NDArray[np.uint16]
UInt64Array: TypeAlias = NDArray[np.uint64]
Int16Array: TypeAlias = NDArray[np.int16]
Int32Array: TypeAlias = NDArray[np.int32]
Int64Array: TypeAlias = NDArray[np.int64]
Float32Array: TypeAlias = NDArray[np.float32]
Float64Array: TypeAlias = NDArray[np.float64]
# Any width, where a function takes more than one.
IntArray: TypeAlias = NDArray[np.integer[Any]]
FloatArray: TypeAlias = NDArray[np.floating[Any]]
# Numbers of any kind.
NumericArray: TypeAlias = NDArray[np.number[Any]]
# Strings and objects, as columns of tables hold them.
ObjectArray: TypeAlias = NDArray[np.object_]
StringArray: TypeAlias = NDArray[np.str_]
AnyArray: TypeAlias = NDArray[Any]
