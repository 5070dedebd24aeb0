"""Coefficients of the explicit Runge-Kutta method of order 8(5,3) of Dormand & Prince.

Published as DOP853 in Hairer, Norsett & Wanner (1993), Solving Ordinary Differential Equations I,
2nd edition, section II.5; taken from `scipy.integrate.DOP853`. Twelve stages; two embedded
formulas, of order 5 and 3, together estimate the error.

SciPy pads `A`, `E3` and `E5` with zeros at the end, which no formula here reads. The arrays are
contiguous copies, as compiled kernels freeze them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.integrate import DOP853

from castblast.types import FloatArray

NODES: Final[FloatArray] = np.array(DOP853.C)
STAGES: Final[FloatArray] = np.array(DOP853.A[:, :-1], order="C")
WEIGHTS: Final[FloatArray] = np.array(DOP853.B)
FIFTH_ORDER_ERROR: Final[FloatArray] = np.array(DOP853.E5[:-1])
THIRD_ORDER_ERROR: Final[FloatArray] = np.array(DOP853.E3[:-1])
