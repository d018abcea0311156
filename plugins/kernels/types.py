"""Names of Dr.Jit's arrays for annotations.

The types themselves belong to a variant and exist once it is set; to a type checker they are Any.
"""

from __future__ import annotations

from typing import Any

Bool = Any
Float = Any
Float64 = Any
UInt32 = Any
Point3d = Any
Vector3d = Any
Vector3f = Any
