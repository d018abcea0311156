"""Hits of rays as Dr.Jit arrays, attached to the parameters of a Mitsuba scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError
from iriftrace.core.runtime import variant as runtime
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.tracing.compiled import integrator_for, sensors_of
from iriftrace.tracing.rays import refuse_several_fields
from iriftrace.tracing.scene import Scene, ready_scene

if TYPE_CHECKING:
    import mitsuba as mi

    from iriftrace.plugins.kernels import types as dt

_Devices = tuple[tuple[Camera | None, Camera | None], ...]


@frozen(eq=False)
class Hits:
    """Hits of n traced rays, as Dr.Jit arrays of the current variant.

    Attributes
    ----------
    ray : UInt32
        Number of each ray: of its pixel, row by row in the film's crop window, or of the ray in the
        bundle that was given.
    straight, refracted : Point3d, mm, world
        First hits on the part; 0 where there is none.
    displacement : Vector3d, mm, world
        Refracted minus straight hit; 0 where one of them does not exist.
    shift_px : two Float64, px, or None
        Shift of the refracted hit's image, right and down; 0 where there is no image. None for a
        bundle of rays, which has no camera.
    incidence : Float64, rad
        Angle between straight ray and the part's normal, 0 to pi/2.
    face, refracted_face : UInt32
        Face of the part under either hit; meaningless where there is none.
    status : UInt32
        Codes of :class:`iriftrace.image.aov_image.Status`; 0 is a good ray.
    """

    ray: dt.UInt32
    straight: dt.Point3d
    refracted: dt.Point3d
    displacement: dt.Vector3d
    shift_px: tuple[dt.Float64, dt.Float64] | None
    incidence: dt.Float64
    face: dt.UInt32
    refracted_face: dt.UInt32
    status: dt.UInt32


def hits(
    scene: Scene | mi.Scene,
    rays: tuple[dt.Point3d, dt.Vector3d] | None = None,
    *,
    sensor: int = 0,
    coherent: bool = False,
) -> Hits:
    """Trace rays, and return their hits attached to the scene's parameters.

    Hits are differentiable functions of the parameters that `mi.traverse` shows as such, of the
    scene's integrator (the field of ``gradient_path``), its shells (the indices of ``iso_shell``)
    and sensors (``calibrated_camera``), and of the rays that are given; forward and reverse mode
    of Dr.Jit work. The integrator of a Scene is ``scene.compiled.integrator``.

    Derivatives hold for rays that keep their status and the faces they hit. They leave out what
    jumps: rays that begin or cease to hit the part or another object, and hits that go over to
    another face of the part, which matters at silhouettes and edges. Near a silhouette a hit's own
    derivative grows with 1 / cos^2 of the incidence angle; leave out rays with a cosine below 0.2.
    The engine is that of the scene's integrator, and is never switched; statuses are constants.
    Positions of shells' and the part's vertices are constants, too: rays that begin or cease to
    touch a shell make derivatives by the vertices of shells wrong by 4 % and more.

    Parameters
    ----------
    scene : Scene or mitsuba.Scene
        A scene with one field, or a scene of Mitsuba, as it is now.
    rays : tuple of Point3d (mm) and Vector3d, world, optional
        Origins and unit directions; by default those through the centres of the sensor's pixels.
    sensor : int
        Number of the scene's sensor whose pixels are traced, within its film's crop window: 0 for
        the camera, 1 for the second device. A device that replaced the one of the file (`evolve`)
        is no sensor of the Mitsuba scene, so hits are not attached to its parameters.
    coherent : bool
        Neighbouring rays of a bundle are similar; this affects only the speed.

    Raises
    ------
    InputError
        No ray hits the part; the scene is an ensemble; or, with a gradient requested, a ray takes
        more passes of the tracing loop than the integrator's ``reverse_passes``.
    """
    devices: _Devices = ()
    if isinstance(scene, Scene):
        loaded = ready_scene(scene)
        refuse_several_fields(loaded)
        compiled = loaded.compiled
        integrator, traced = compiled.integrator, compiled.mitsuba_scene
        integrator.refresh(traced)
        variant = compiled.variant
        devices = ((loaded.camera, compiled.camera), (loaded.second, compiled.second))
    else:
        variant, traced = runtime.ensure(), scene
        own, name = scene.integrator(), "Your mi.Scene"
        integrator = integrator_for(own, Engine.AUTO, name, Path(FIELD_FILE))
        integrator.begin(traced)
    with runtime.using(variant):
        seen_by = _sensor(traced, sensor, devices) if rays is None else None
        return _traced(integrator, traced, rays, seen_by, coherent)


def _sensor(scene: mi.Scene, number: int, devices: _Devices) -> mi.Sensor:
    """Mitsuba's own sensor, to which derivatives are attached, unless another device replaced it.

    Devices are those of the scene by number, each with the one that the own sensor shows.
    """
    from iriftrace.plugins.calibrated_camera import sensor_of

    for device, own in devices[number : number + 1]:
        if device is not None and (own is None or device.as_dict() != own.as_dict()):
            replaced: mi.Sensor = sensor_of(device)
            return replaced
    return sensors_of(scene, "The scene")[number]


def _traced(
    integrator: Any,
    scene: mi.Scene,
    rays: tuple[dt.Point3d, dt.Vector3d] | None,
    sensor: mi.Sensor | None,
    coherent: bool,
) -> Hits:
    import drjit as dr
    import mitsuba as mi

    from iriftrace.plugins.kernels.bundle import rays_of
    from iriftrace.plugins.kernels.queries import HIT_PART

    if rays is None:
        pixels, bundle = integrator.trace_pixels(scene, sensor)
    else:
        bundle = integrator.trace(
            scene,
            rays_of(*rays),
            dr.width(*rays),
            focus=(0.0, float("inf")),
            coherent=coherent,
            trace_all=integrator.trace_all,
        )
    trace = bundle.trace
    if trace is None:
        raise InputError(
            "No ray hits the part, so there are no hits; check the camera's pose, or the rays.",
            code="rays.no_hit",
        )
    bent = trace.refracted
    first = dr.opaque(mi.UInt32, integrator.prepare(scene).tables.part_first_face)
    return Hits(
        ray=trace.ray if rays else dr.gather(mi.UInt32, pixels.numbers, trace.ray),
        straight=trace.straight,
        refracted=dr.select(bent.outcome == HIT_PART, bent.point, 0),
        displacement=trace.displacement,
        shift_px=None if rays else trace.shift_px(pixels.camera),
        incidence=trace.incidence,
        face=trace.straight_face,
        refracted_face=bent.face - first,
        status=trace.status,
    )
