"""The AOV image of one pose: of one field, or of the mean of several with their scatter."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from attrs import frozen

from iriftrace import runtime
from iriftrace.camera import Camera
from iriftrace.ensemble.statistics import EnsembleStatistics
from iriftrace.errors import InputError
from iriftrace.exr import SCHEMA, AovImage
from iriftrace.provenance import provenance
from iriftrace.scene import LoadedScene


@frozen(eq=False)
class PoseImage:
    """An image and the seconds it took, stage by stage."""

    image: AovImage
    time_s: dict[str, float]


def pose_image(
    scene: LoadedScene, camera: Camera | None = None, include: Collection[int] = (0,)
) -> PoseImage:
    """Trace a camera's rays, straight and bent.

    Parameters
    ----------
    scene : LoadedScene
        Of an ensemble all members are traced, one after the other; straight rays only once.
    camera : Camera, optional
        Takes the place of the scene's own sensor.
    include : collection of int
        Status codes of the rays that enter an ensemble's mean and scatter.

    Raises
    ------
    InputError
        If the camera stands in the hot air or in the part, or the film would smear the channels.
    """
    if scene.ensemble is None:
        return _one_field(scene, camera)[0]
    statistics = EnsembleStatistics(include)
    time_s: dict[str, float] = {}
    counts: dict[str, int] = {}
    straight: Any = None
    for number, member in enumerate(scene.ensemble.scenes(), start=1):
        found, straight = _one_field(member, camera, straight, f" of member {number}")
        statistics.add(found.image)
        for key, seconds in found.time_s.items():
            time_s[key] = time_s.get(key, 0.0) + seconds
        for key, count in found.image.header["counts"].items():
            counts[key] = max(counts.get(key, 0), count)
        last = found.image.header
    header = {
        **last,
        **provenance(scene, Camera.from_dict(last["camera"])),
        "time_s": time_s,
        "counts": counts,
    }
    return PoseImage(statistics.image(header), time_s)


def _one_field(
    scene: LoadedScene, camera: Camera | None, straight: Any = None, whose: str = ""
) -> tuple[PoseImage, Any]:
    """The image of one field, and its straight hits, which serve other fields too."""
    with runtime.using(scene.variant):
        sensor = sensor_of_pose(scene, camera)
        _refuse_inside(scene, sensor, whose)
        tensor, report = scene.integrator.image(scene.mitsuba_scene, sensor, straight)
        # A view of Dr.Jit's memory where that is the processor's own.
        planes = tensor.numpy()
    time_s = {
        "load": scene.load_s,
        "build": scene.build_s,
        "straight": report["time_s"]["straight"],
        "refracted": report["time_s"]["refracted"],
    }
    channels = dict(zip(scene.integrator.aov_names(), planes, strict=True))
    header = {**_header(scene, report, time_s), "full_resolution": _full_resolution(scene, camera)}
    return PoseImage(AovImage(channels, header), time_s), report["straight"]


def _full_resolution(scene: LoadedScene, camera: Camera | None) -> list[int] | None:
    """Of the scene's film before ``scale`` changed it, px; None for a camera with another film."""
    if camera is not None and camera.resolution != scene.camera.resolution:
        return None
    return list(scene.full_resolution)


def sensor_of_pose(scene: LoadedScene, camera: Camera | None) -> Any:
    """The scene's own sensor, or one for the camera that takes its place (mi.Sensor)."""
    if camera is None:
        return scene.mitsuba_scene.sensors()[0]
    from iriftrace.plugins.calibrated_camera import sensor_of

    return sensor_of(camera)


def _refuse_inside(scene: LoadedScene, sensor: Any, whose: str) -> None:
    where = scene.integrator.surroundings(scene.mitsuba_scene, sensor)
    if where is not None:
        raise InputError(
            f"The camera stands inside the {where}{whose if where == 'hot air' else ''}, where its "
            "picture means nothing; move it farther away."
        )


def _header(scene: LoadedScene, report: dict[str, Any], time_s: dict[str, float]) -> dict[str, Any]:
    camera = report["camera"]
    return {
        "schema": SCHEMA,
        **provenance(scene, Camera.from_dict(camera)),
        "camera": camera,
        "pose": {
            "origin_mm": [row[3] for row in camera["matrix"][:3]],
            "matrix": camera["matrix"],
        },
        "time_s": time_s,
        "counts": report["counts"],
    }
