"""A scene in light of another wavelength than the one it was made for.

n - 1 of all the air, hot or not, is proportional to that of the ambient air (Gladstone and Dale),
so another wavelength multiplies every n - 1 of the scene by one number. The shells do not move,
because each lies at one temperature.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from iriftrace.core.errors import InputError

if TYPE_CHECKING:
    import mitsuba as mi

WAVELENGTH = "wavelength"
"""Parameter of every scene, independent of its file."""


def of_the_file(values: Mapping[str, str]) -> dict[str, str]:
    """The parameters that belong to the scene file itself."""
    return {name: value for name, value in values.items() if name != WAVELENGTH}


def set_shells(scene: mi.Scene, factor: float) -> None:
    """Multiply n - 1 on both sides of all shells of a Mitsuba scene."""
    from iriftrace.plugins.kernels.tables import shell_indices

    shells = {}
    for shape in scene.shapes():
        bsdf = shape.bsdf()
        if shell_indices(bsdf) is None:
            continue
        if not hasattr(bsdf, "ext_ior"):
            raise InputError(
                "The scene has shells with Mitsuba's dielectric, whose indices are not stated, so "
                "they cannot be changed to another wavelength; use iso_shell."
            )
        # Several shapes may use one bsdf.
        shells[id(bsdf)] = bsdf
    for bsdf in shells.values():
        bsdf.ext_ior = 1.0 + factor * (bsdf.ext_ior - 1.0)
        bsdf.int_ior = 1.0 + factor * (bsdf.int_ior - 1.0)
        bsdf.iso_ior = 1.0 + factor * (bsdf.iso_ior - 1.0)
