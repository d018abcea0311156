"""Photographs of a scene: what its camera takes through hot air and without it, with the truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from attrs import asdict, evolve, frozen
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.blocks import blocks
from iriftrace.core.errors import InputError
from iriftrace.core.html import html_table
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.io.photographs import write_photographs
from iriftrace.part.hot_temperature import HotTemperatures
from iriftrace.part.part import Part
from iriftrace.photo.appearance import Appearance
from iriftrace.photo.image_sensor import USUAL_SENSOR, ImageSensor
from iriftrace.photo.light import Light
from iriftrace.photo.options import AMBIENT, HOT, SAMPLES, AirOfPicture
from iriftrace.photo.shading import Shading, Temperatures
from iriftrace.tracing.engine import choose
from iriftrace.tracing.lost import warn_of_lost_points
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.rays import RayEnds
from iriftrace.tracing.scene import Scene, ready_scene

GREY = Appearance()

RAYS = 1 << 19
"""Rays that are traced at once."""


@frozen(eq=False)
class Photograph:
    """Photographs of one camera, and the truth about them.

    Attributes
    ----------
    pictures : dict of (h, w) arrays, uint16
        Grey values, DN, by ``"hot"`` or ``"cold"``, with ``"_step_0"`` and so on where the second
        device has several patterns.
    electrons : dict of (h, w) arrays
        Expected photoelectrons of the same pictures.
    truth : AovImage
        All channels of a rendering at the pixels' centres, and ``second.px.X/Y``.
    sensor : ImageSensor
        With the exposure in force.
    numbers : dict
        What the pictures were made with, as plain JSON values.
    """

    pictures: dict[str, NDArray[np.uint16]]
    electrons: dict[str, FloatArray]
    truth: AovImage
    sensor: ImageSensor
    numbers: JsonObject

    def __repr__(self) -> str:
        width, height = self.truth.camera.resolution
        return f"Photograph({', '.join(self.pictures)}: {width} x {height} px)"

    def _repr_html_(self) -> str:
        """Names of the pictures and exposure, for notebooks."""
        return html_table("Photograph", {"pictures": ", ".join(self.pictures), **self.numbers})

    def save(self, path: str | Path) -> list[Path]:
        """Write pictures, truth and a text with the numbers into the folder of a file.

        Parameters
        ----------
        path : path
            ``image.tiff`` for the hot picture, or the only one; others get their names between
            stem and ending. ``truth.exr`` and ``README.md`` are written next to it. The folder is
            created if it is missing.
        """
        return write_photographs(Path(path), self.pictures, self.truth, self.numbers)


def photograph(
    scene: Scene,
    *,
    air: AirOfPicture = HOT,
    part: Appearance = GREY,
    blockers: Appearance = GREY,
    light: Light | None = None,
    ambient: float = AMBIENT,
    sensor: ImageSensor = USUAL_SENSOR,
    samples: int = SAMPLES,
    seed: int | None = 0,
) -> Photograph:
    """Take photographs of a scene with its camera, through hot air, without it, or both.

    Each pixel is the mean of samples x samples rays (a box); over the members of an ensemble their
    weighted mean, as an exposure that is longer than the plume's motion. A picture without hot air
    has the part at the same size, and nothing glows.

    Left out are light that comes by way of other surfaces, the lens's blur, diffraction and
    nonuniformity of the pixels. Bodies that only block the view do not get light of the second
    device.

    Parameters
    ----------
    scene : Scene
        The second device, a projector or a laser, is the light.
    air : str
        ``"hot"``, ``"cold"`` or ``"both"``, with the same exposure.
    part, blockers : Appearance
        Of the part, or the board; and of bodies that only block the view.
    light : Light, optional
        Pattern and power of the second device; dark by default.
    ambient : float, W/(m^2 nm)
        Irradiance by diffuse light, the same everywhere.
    sensor : ImageSensor
    samples : int
        Rays along each side of a pixel.
    seed : int or None
        Of the noise; None for pictures without noise.

    Returns
    -------
    Photograph

    Raises
    ------
    InputError
        The scene does not state its wavelength, has no second device for the light, or a device
        with parallel rays; or everything is dark.

    Warns
    -----
    IriftraceWarning
        As :func:`iriftrace.tracing.engine.choose`; or rays are lost, which leaves pixels dark.
    """
    loaded = ready_scene(scene)
    wavelength_nm = _checked(loaded, air, light, samples, ambient=ambient, seed=seed or 0)
    camera, second = loaded.camera, loaded.second
    patterns = {} if light is None or second is None else light.patterns(second)
    devices = [camera, second] if patterns else [camera]
    chosen = loaded if air == "cold" else choose(loaded, *devices).scene
    truth = pose_image(chosen)
    if air != "cold":
        lost = np.isin(truth.channels["status.code"], [code for code in Status if code.lost])
        hit = int(np.count_nonzero(truth.channels["part.face"]))
        warn_of_lost_points(int(lost.sum()), hit, "are dark in the picture")
    rates: dict[str, FloatArray] = {}

    def shading(one: Scene, state: str) -> Shading:
        return Shading(
            scene=one,
            bent=state == "hot",
            wavelength_nm=wavelength_nm,
            part=part,
            blockers=blockers,
            part_k=_temperatures(one, one.part, part, state),
            blockers_k=_temperatures(one, (*one.blockers, one.part)[0], blockers, state),
            ambient=ambient,
            irradiance=0.0 if light is None else light.irradiance,
            patterns=list(patterns.values()),
        )

    for state in ("hot", "cold") if air == "both" else (air,):
        fields = ((weight, shading(one, state)) for weight, one in _fields(chosen, state))
        radiance, places = _exposed(fields, camera, samples)
        if patterns:
            truth = _with_places(truth, state, places)
        for name, plane in zip(patterns or [""], radiance, strict=True):
            rate = sensor.electrons(plane, camera.pixel_area_mm2, wavelength_nm)
            rates["_".join(filter(None, (state, name)))] = rate
    exposure = sensor.exposure_for(list(rates.values()))
    electrons = {name: rate * exposure for name, rate in rates.items()}
    generator = None if seed is None else np.random.default_rng(seed)
    numbers = {
        "air": air,
        "wavelength_nm": wavelength_nm,
        "light": "dark" if light is None else asdict(light),
        "ambient_irradiance": ambient,
        "part": _described(part),
        "blockers": _described(blockers),
        "sensor": {**asdict(sensor), "exposure": exposure},
        "samples": samples,
        "seed": seed,
        "left out": "light by way of other surfaces, blur of the lens, nonuniformity of the pixels",
    }
    return Photograph(
        pictures={
            name: sensor.grey_values(each, exposure, generator) for name, each in electrons.items()
        },
        electrons=electrons,
        truth=evolve(truth, header={**truth.header, "photograph": numbers}),
        sensor=evolve(sensor, exposure=exposure),
        numbers=numbers,
    )


def _checked(scene: Scene, air: str, light: Light | None, samples: int, **numbers: float) -> float:
    """Wavelength of a scene, nm; InputError if it cannot be photographed."""
    for name, value in numbers.items():
        if not 0.0 <= value < np.inf:
            raise InputError(
                f"{name} is {value:g}, with which no picture can be taken; give 0 or more.",
                code="photo.negative",
                argument=name,
            )
    if air not in ("hot", "cold", "both") or samples < 1:
        raise InputError(
            f"No picture can be taken with air {air!r} and {samples} samples; use hot, cold or "
            "both, and at least 1 sample.",
            code="photo.unknown_air",
            argument="air",
        )
    if light is not None and scene.second is None:
        raise InputError(
            f"{scene.name} has no second device that could be the light; write it with a projector "
            "or a laser, or leave the light out.",
            code="devices.no_second",
            argument="second",
        )
    devices = [scene.camera, scene.second if light is not None else None]
    if any(one is not None and one.projection == "orthographic" for one in devices):
        raise InputError(
            "A device with parallel rays has no place from which its rays start together; give "
            "camera and light a focal length.",
            code="camera.parallel_rays",
        )
    wavelength_nm = scene.compiled.stated.wavelength_nm
    if wavelength_nm is None:
        raise InputError(
            f"{scene.name} does not state its wavelength, on which glow and exposure depend; give "
            "it.",
            code="light.not_stated",
            argument="wavelength",
        )
    return wavelength_nm


def _fields(scene: Scene, state: str) -> Iterator[tuple[float, Scene]]:
    """Scenes of one field with their weights in the exposure; one without hot air."""
    if not scene.members or state == "cold":
        yield 1.0, next(scene.alone([0]) if scene.members else scene.alone())
        return
    weights = scene.weights.weights
    places = [place for place in scene.counted if weights[place] > 0.0]
    total = sum(weights[place] for place in places)
    for place, one in zip(places, scene.alone(places), strict=True):
        yield float(weights[place] / total), one


def _temperatures(
    scene: Scene, body: Part, appearance: Appearance, state: str
) -> Temperatures | None:
    """Temperatures on a body by its appearance; None if it does not glow."""
    if appearance.temperature is None or state == "cold":
        return None

    def field_wall(_: Part) -> Temperatures:
        cells = scene.air.states[0].cells
        kelvins = cells.air.temperature(cells.refractivity[cells.wall])
        tree = cKDTree(cells.points[cells.wall])
        return lambda points: kelvins[tree.query(points)[1]]

    return HotTemperatures.of(appearance.temperature).at_walls(body, field_wall)


def _seen(ends: RayEnds, camera: Camera) -> IntArray:
    """Row-major numbers of pixels whose centre sees anything, and of those around them."""
    width, height = camera.resolution
    mask = ((ends.face >= 0) | ends.blocked).reshape(height, width)
    return np.flatnonzero(binary_dilation(mask, np.ones((5, 5), dtype=bool)))


def _exposed(
    fields: Iterable[tuple[float, Shading]], camera: Camera, samples: int
) -> tuple[FloatArray, FloatArray]:
    """Weighted means of the radiance, (pictures, h, w), and of the places that light pixels."""
    radiance, places, dark = np.zeros(()), np.zeros(()), np.zeros((), dtype=bool)
    for weight, shading in fields:
        ends = shading.hits(camera)
        radiance = radiance + weight * _picture(shading, camera, _seen(ends, camera), samples)
        if shading.patterns:
            width, height = camera.resolution
            lit_from = shading.places(ends).reshape(height, width, 2)
            dark = dark | (lit_from == -1.0)
            places = places + weight * lit_from
    return radiance, np.where(dark, -1.0, places)


def _picture(shading: Shading, camera: Camera, seen: IntArray, samples: int) -> FloatArray:
    """Radiance of a camera's pixels in each picture, (pictures, h, w) array."""
    width, height = camera.resolution
    within = (np.arange(samples) + 0.5) / samples - 0.5
    samples_px = np.stack([each.ravel() for each in np.meshgrid(within, within)], axis=1)
    found = np.zeros((max(len(shading.patterns), 1), width * height))
    for rows in blocks(len(seen), max(1, RAYS // samples**2)):
        centres = np.stack((seen[rows] % width, seen[rows] // width), axis=1)
        places = (centres[:, None] + samples_px).reshape(-1, 2)
        radiance = shading.radiance(camera, places, 1.0 / samples)
        found[:, seen[rows]] = radiance.reshape(len(found), -1, samples**2).mean(axis=2)
    return found.reshape(-1, height, width)


def _with_places(truth: AovImage, state: str, places: FloatArray) -> AovImage:
    """The truth with the places of the light in one state of the air."""
    name = "second.px" if state == "hot" else "second.cold.px"
    planes = np.moveaxis(places, -1, 0).astype(np.float32)
    added = {f"{name}.{axis}": plane for axis, plane in zip("XY", planes, strict=True)}
    return evolve(truth, channels={**truth.channels, **added})


def _described(appearance: Appearance) -> JsonObject:
    """An appearance as plain JSON values."""
    own, printed = appearance.emissivity, appearance.printed
    found = {
        "emissivity": "a function of the angle" if callable(own) else own,
        "temperature": appearance.temperature or "does not glow",
    }
    if printed is not None:
        found |= {
            "printed": type(printed).__name__,
            "ink_emissivity": appearance.ink_emissivity,
            "print_to_world": appearance.to_world.tolist(),
        }
    return found
