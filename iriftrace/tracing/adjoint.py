"""Reverse pass of hits: derivative of a sum of hits by the temperatures of the field."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.core.runtime import variant as runtime
from iriftrace.tracing.hits import hits
from iriftrace.tracing.scene import Scene

Bundle = tuple[FloatArray, FloatArray, FloatArray]
"""Origins, mm, unit directions and weights of rays, (n, 3) arrays."""

TEMPERATURE = "field.temperature"


def temperature_gradient(scene: Scene, bundles: Iterable[Bundle]) -> FloatArray:
    """Derivative (m,), per K, of a weighted sum of hits by the temperatures at the field's points.

    The sum is that of weight times refracted hit (mm) over the rays of all bundles. Rays are
    constants, and those that are not good have no derivative, as for `iriftrace.hits`, whose errors
    it raises. Each bundle is one reverse pass.

    Parameters
    ----------
    scene : Scene
        Of one field, traced through its cells. Its integrator has no gradients when this returns.
    bundles : iterable of tuple of three (n, 3) arrays
        Origins (mm), unit directions, and weights.
    """
    compiled = scene.compiled
    with runtime.using(compiled.variant), runtime.full_precision():
        import drjit as dr
        import mitsuba as mi

        temperature = mi.traverse(compiled.integrator)[TEMPERATURE]
        dr.enable_grad(temperature)
        try:
            for origins, directions, weights in bundles:
                found = hits(scene, (mi.Point3d(origins.T), mi.Vector3d(directions.T)))
                good = found.status == 0
                weight = dr.gather(mi.Vector3d, mi.Vector3d(weights.T), found.ray, good)
                dr.backward(dr.sum(dr.dot(weight, found.refracted)))
            return as_float64(np.array(dr.grad(temperature)))
        finally:
            dr.disable_grad(temperature)
