"""Columns of the tables of the engine: balls, contact memory, dissipated work.

Plain integers, so that kernels take them as constants. Of a vector the y and z part follow the x
part: ``motion[i, axis + WX]`` is the spin about an axis.
"""

from __future__ import annotations

from typing import Final

#: Of a point or vector, and of `Balls.place`: centre and radius [m].
X: Final = 0
Y: Final = 1
Z: Final = 2
RADIUS: Final = 3

#: Of `Balls.motion`: velocity [m s-1], spin [rad s-1], mass [kg], held in place.
VX: Final = 0
VY: Final = 1
VZ: Final = 2
WX: Final = 3
WY: Final = 4
WZ: Final = 5
MASS: Final = 6
HELD: Final = 7

#: Of `Balls.force`: force [N] and moment [N m].
FX: Final = 0
FY: Final = 1
FZ: Final = 2
MX: Final = 3
MY: Final = 4
MZ: Final = 5

#: Of `Contacts.memory`: shear force [N], rolling moment [N m], stiffness k_n [N m-1], and
#: 2 sqrt(m_c k_n) [kg s-1].
SHEAR_X: Final = 0
SHEAR_Y: Final = 1
SHEAR_Z: Final = 2
ROLL_X: Final = 3
ROLL_Y: Final = 4
ROLL_Z: Final = 5
STIFFNESS: Final = 6
DAMPING: Final = 7

#: Of the dissipated work [J].
SLIP: Final = 0
ROLLING_SLIP: Final = 1
DASHPOT: Final = 2
