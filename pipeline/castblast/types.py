"""Arrays by what they hold, named once for every signature."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
#: Places in another array, of whatever width they were stored in.
IndexArray: TypeAlias = NDArray[np.integer]
BoolArray: TypeAlias = NDArray[np.bool_]
#: Lists of the engine: half the memory, and 2^31 contacts are more than a machine holds.
Int32Array: TypeAlias = NDArray[np.int32]
#: In the working precision of a simulation: float64 or float32.
RealArray: TypeAlias = NDArray[np.floating[Any]]
