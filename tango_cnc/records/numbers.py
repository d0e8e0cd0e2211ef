"""What every record is made of: arrays, vectors, names of axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Vector = tuple[float, float, float]
Id = str  # facets and balls: integers and strings in files, text inside

LINEAR, ROTARY = "XYZ", "ABC"
COMPONENTS = "XYZABC"  # of an error: three translations, three rotations (ISO 230-1)
