"""Choice of the engine for a view: the scene's shells, or its field where they are too coarse.

There is one test (`iriftrace.trace.shell_convergence`) on one sample of rays: those of the devices'
own pictures that hit the part in focus. So a picture, a measurement and a correction with the same
devices are traced with the same engine.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.runtime import variant as runtime
from iriftrace.scene.load import LoadedScene
from iriftrace.trace.lost import LIMIT as LOST_LIMIT
from iriftrace.trace.shell_convergence import (
    SAMPLE,
    PictureTest,
    ShellResolution,
    shell_resolution,
    warn_of_coarse_shells,
)

PIXELS = 100_000
"""Of the picture by which a device of a measurement is tested; a sample of them is traced."""


@frozen(eq=False)
class Choice:
    """The scene as it is to be traced, and what its shells were tested with."""

    scene: LoadedScene
    test: PictureTest

    @property
    def resolution(self) -> ShellResolution | None:
        """The result of the test; None without one."""
        return self.test.resolution


def choose(scene: LoadedScene, camera: Camera | None = None, sample: int = SAMPLE) -> Choice:
    """Choose what bends the rays of one picture, of the scene's own camera by default.

    The field is chosen where the shells are too few for the view, it lies beside the scene, no
    engine was asked for, and it does not lose over 0.5 % of the same rays. Warns where shells are
    too few.
    """
    test = shell_resolution(scene, camera, sample)
    if test.resolution is None or test.resolution.suffices:
        return Choice(scene, test)
    field = scene.through_field
    if field is not None and test.rays is not None:
        lost = _lost_fraction(field, *test.rays)
        if lost > LOST_LIMIT:
            warnings.warn(
                f"The shells are too coarse for this view, but the field loses {lost:.1%} of its "
                "rays in cells that are badly shaped, so the shells are used; check the field's "
                "mesh (iriftrace field check), or write the scene with --layers 40.",
                IriftraceWarning,
                stacklevel=3,
            )
            return Choice(scene, test)
    warn_of_coarse_shells(test.resolution, field is not None)
    return Choice(field or scene, test)


def choose_for_devices(scene: LoadedScene, devices: Sequence[Camera]) -> LoadedScene:
    """Choose what bends the rays of several devices alike: the field if one of them needs it."""
    for device in devices:
        width, height = device.resolution
        coarser = device.scaled(min(1.0, (PIXELS / (width * height)) ** 0.5))
        choice = choose(scene, coarser)
        if choice.resolution is not None and not choice.resolution.suffices:
            return choice.scene
    return scene


def _lost_fraction(scene: LoadedScene, origin: Any, direction: Any) -> float:
    """Fraction of a sample of rays (Point3d, Vector3d) whose end is not known."""
    with runtime.using(scene.variant):
        import drjit as dr
        import mitsuba as mi

        count = dr.width(origin, direction)
        # A camera's rays all have the same origin, which is a single number an axis.
        starts, ways = (
            [axis + dr.zeros(mi.Float64, count) for axis in vector]
            for vector in (origin, direction)
        )
        trace = scene.integrator.trace(
            scene.mitsuba_scene,
            lambda ray: (
                mi.Point3d(*(dr.gather(mi.Float64, axis, ray) for axis in starts)),
                mi.Vector3d(*(dr.gather(mi.Float64, axis, ray) for axis in ways)),
            ),
            count,
            focus=(0.0, float("inf")),
            coherent=False,
            trace_all=True,
        ).trace
        status = np.array(trace.status)
    return float(np.isin(status, [code for code in Status if code.lost]).mean())
