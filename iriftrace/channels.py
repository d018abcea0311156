"""Names of the AOV channels, in the order in which the integrator delivers them."""

from __future__ import annotations

CHANNELS: tuple[str, ...] = (
    *(f"{name}.{axis}" for name in ("straight", "refracted", "displacement") for axis in "XYZ"),
    "displacement.norm",
    "shift.px.X",
    "shift.px.Y",
    "incidence.angle",
    "path.length",
    "path.crossings",
    "part.face",
    "status.code",
)
"""Millimetres and radians in the world's frame; ``shift.px`` in pixels."""

ERROR_CHANNEL = "path.error"
"""Estimated error of the refracted hit, mm; only the continuous engine delivers it."""
