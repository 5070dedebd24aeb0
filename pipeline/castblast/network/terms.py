"""Words that the record and its checks share."""

from __future__ import annotations

from typing import Literal

Transform = Literal["linear", "log"]
Activation = Literal["identity", "tanh", "relu", "logistic", "silu"]

#: Written into every file. Version 2 added derived columns, silu, density and members.
SCHEMA_VERSION = 2
