"""A scene made with Mitsuba, for the rest of the package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from iriftrace.tracing.compiled import of_mitsuba
from iriftrace.tracing.hot_air import AirFiles, AirState, HotAir
from iriftrace.tracing.scene import Scene

if TYPE_CHECKING:
    import mitsuba as mi


def from_mitsuba(scene: mi.Scene) -> Scene:
    """Use a scene made with Mitsuba in `render_scene`, `trace_rays` and `measure`.

    Parameters
    ----------
    scene : mitsuba.Scene
        A scene of the current variant, loaded with ``optimize=False``, with the integrator
        ``first_hit`` or ``gradient_path``, a part (mm) and one or two sensors
        ``calibrated_camera``.

    Returns
    -------
    Scene
        Its part has the mesh's triangles, and regions by their form. Of its air only what bends
        the rays is known: no wavelength, no source, no shells and no cells. It is the scene as it
        is now: after a change by `mitsuba.traverse` it is refused, and made again.

    Raises
    ------
    InputError
        If it is something else, or has no sensor, no part, or another integrator, or the current
        variant traces no rays here.
    """
    compiled, part, devices = of_mitsuba(scene)
    own = Scene(
        part,
        HotAir.of_states([AirState(None, files=AirFiles(None, None, None))]),
        *devices,
        engine=compiled.engine,
        variant=compiled.variant,
        stored=True,
    )
    own._held.compiled = compiled
    return own
