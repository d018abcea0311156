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

MEMBERS_CHANNEL = "ensemble.members"
"""Number of members of an ensemble in which the pixel's ray counts."""

SCATTER_CHANNELS: tuple[str, ...] = (
    *(f"displacement.std.{axis}" for axis in "XYZ"),
    "displacement.std.norm",
    "shift.px.std.X",
    "shift.px.std.Y",
    MEMBERS_CHANNEL,
)
"""Standard deviations over an ensemble's members, mm and pixels; its other channels are means."""
