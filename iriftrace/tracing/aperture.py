"""Effect of a lens's aperture: bias and blur of the displacement against the pinhole."""

from __future__ import annotations

import math

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import unit_vectors
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import Status
from iriftrace.part.part import Part
from iriftrace.tracing.engine import choose
from iriftrace.tracing.rays import refuse_several_fields, traced_as_chosen
from iriftrace.tracing.scene import Scene, ready_scene

SAMPLES, MOST_SAMPLES = 32, 1024
"""Rays over the lens, by default and at most."""

PIXELS = 2000
"""Number of pixels that are looked at."""

CANDIDATES = 10
"""Pixels from which each is chosen, as a part may fill little of the picture."""

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@frozen(eq=False)
class ApertureEffect:
    """Effect of an aperture on n pixels whose rays over the whole lens hit the part.

    Attributes
    ----------
    f_number : float
    focus_mm : float, mm
        Distance of the plane in focus from the lens, along the optical axis.
    samples : int
        Rays over the lens.
    pixel : (n, 2) array, px
    shift : (n, 2) array, px
        In the picture, through the pinhole.
    bias : (n, 2) array, px
        Mean shift over the lens less that through the pinhole.
    blur : (n,) array, px
        Root mean square distance of the shifts over the lens from their mean.
    defocus : (n,) array, px
        The same of the places in the picture without hot air: 0 in the plane in focus.
    cut : int
        Pixels left out because some rays over the lens do not hit the part.
    """

    f_number: float
    focus_mm: float
    samples: int
    pixel: FloatArray
    shift: FloatArray
    bias: FloatArray
    blur: FloatArray
    defocus: FloatArray
    cut: int

    def as_dict(self) -> JsonObject:
        """Plain JSON values: medians and 95th percentiles of the lengths."""
        columns = {
            "shift_px": np.linalg.norm(self.shift, axis=1),
            "bias_px": np.linalg.norm(self.bias, axis=1),
            "blur_px": self.blur,
            "defocus_px": self.defocus,
        }
        quantiles = {key: np.quantile(column, (0.5, 0.95)) for key, column in columns.items()}
        return {
            "f_number": self.f_number,
            "focus_mm": self.focus_mm,
            "samples": self.samples,
            "pixels": len(self.pixel),
            "cut": self.cut,
            **{
                key: {"median": float(median), "p95": float(p95)}
                for key, (median, p95) in quantiles.items()
            },
        }


def aperture_effect(
    scene: Scene,
    f_number: float,
    *,
    camera: Camera | None = None,
    focus_mm: float | None = None,
    samples: int = SAMPLES,
    pixels: int = PIXELS,
) -> ApertureEffect:
    """Trace rays over a lens, in focus at one distance, for a sample of a camera's pixels.

    The lens is thin and stands at the pinhole; its diameter is the focal length over the f-number.
    Each ray leads from a point of the lens to where the pixel's own line of sight meets the plane
    in focus. The shift of a ray has the sign of the channel ``shift.px``: the image of its straight
    hit minus that of its refracted hit.

    Parameters
    ----------
    scene : Scene
    f_number : float
        4 for f/4.
    camera : Camera, optional
        Used instead of the scene's own sensor.
    focus_mm : float, mm, optional
        Distance of the plane in focus along the optical axis; by default the middle of the
        camera's focus interval, or the part's centre if that has no far end.
    samples : int
        Rays over the lens, even.
    pixels : int
        Number of pixels.

    Raises
    ------
    InputError
        A value is out of range, the camera has no lens, no pixel
        sees the part over the whole lens, or the scene is an ensemble.
    """
    loaded = ready_scene(scene)
    refuse_several_fields(loaded)
    device = loaded.camera if camera is None else camera
    distance = _focus(device, scene.part, focus_mm)
    lens = _lens_points(device, f_number, samples)
    chosen = choose(loaded, device).scene
    size = device.resolution
    places = np.random.default_rng(1).uniform(size=(CANDIDATES * pixels, 2)) * size
    places = np.floor(places)
    origin, direction = device.rays(places)
    central = traced_as_chosen(chosen, origin, direction, focus_mm=device.focus_mm)
    good = np.flatnonzero(central.status == Status.GOOD)[:pixels]
    place, start, sight = (each[central.ray[good]] for each in (places, origin, direction))
    focused = start + sight * (distance / (sight @ device.forward))[:, None]
    origins = start[:, None] + lens
    headings = unit_vectors((focused[:, None] - origins).reshape(-1, 3))
    cold, hot = np.full((2, len(headings), 3), np.nan)
    if len(headings):
        over = traced_as_chosen(chosen, origins.reshape(-1, 3), headings)
        hits = over.status == Status.GOOD
        cold[over.ray[hits]], hot[over.ray[hits]] = over.straight[hits], over.refracted[hits]
    without, with_air = (device.project(one).reshape(-1, samples, 2) for one in (cold, hot))
    whole = np.isfinite(with_air - without).all(axis=(1, 2))
    if not whole.any():
        raise InputError(
            f"No pixel sees the part sharply by all rays over a lens of f/{f_number:g}; focus the "
            "camera on the part, or take a larger f-number.",
            code="aperture.no_hit",
            argument="aperture",
        )
    shifts, at_rest = (without - with_air)[whole], without[whole]
    pinhole = device.project(central.straight[good]) - device.project(central.refracted[good])
    mean = shifts.mean(axis=1)
    return ApertureEffect(
        f_number=float(f_number),
        focus_mm=distance,
        samples=samples,
        pixel=place[whole],
        shift=pinhole[whole],
        bias=mean - pinhole[whole],
        blur=_spread(shifts),
        defocus=_spread(at_rest),
        cut=int((~whole).sum()),
    )


def _focus(camera: Camera, part: Part, stated: float | None) -> float:
    """Distance of the plane in focus along the optical axis, mm."""
    if camera.projection != "pinhole":
        raise InputError(
            f"The camera is {camera.projection} and has no focal length, from which the lens's "
            "diameter follows; give it a perspective one.",
            code="camera.orthographic",
        )
    near, far = camera.focus_mm
    distance = 0.5 * (near + far) if stated is None else float(stated)
    if math.isinf(far) and stated is None:
        distance = float((part.centre - camera.origin) @ camera.forward)
    if not 0.0 < distance < math.inf:
        raise InputError(
            f"The distance in focus is {distance:g} mm; give a positive length.",
            code="camera.focus_distance",
            argument="focus_distance",
        )
    return distance


def _lens_points(camera: Camera, f_number: float, samples: int) -> FloatArray:
    """Points on the lens (samples, 3), mm from its centre, world; as many on every area.

    Half of a Vogel spiral and its mirror image, so that effects that are odd in the place on the
    lens leave the mean as it is.
    """
    if not 0.0 < f_number < math.inf:
        raise InputError(
            f"The f-number is {f_number:g}; give a positive one, such as 4 (f/4).",
            code="aperture.not_positive",
            argument="aperture",
        )
    if not (2 <= samples <= MOST_SAMPLES and samples % 2 == 0):
        raise InputError(
            f"{samples} rays over the lens are not an even number from 2 to {MOST_SAMPLES}.",
            code="aperture.samples",
        )
    number = np.arange(samples // 2)
    radius = 0.5 * camera.focal_length_mm / f_number * np.sqrt((number + 0.5) / len(number))
    angle = _GOLDEN_ANGLE * number
    half = np.stack((radius * np.cos(angle), radius * np.sin(angle)), axis=1)
    points: FloatArray = np.concatenate((half, -half)) @ camera.matrix[:3, :2].T
    return points


def _spread(places: FloatArray) -> FloatArray:
    """Root mean square distance (n,) of places (n, s, 2) from their mean."""
    off = places - places.mean(axis=1, keepdims=True)
    return np.asarray(np.sqrt(np.square(off).sum(axis=2).mean(axis=1)))
