"""One pose: from a scene to its AOV image and metrics."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.core.html import html_table, picture
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.metrics import PoseMetrics, pose_metrics, write_metrics
from iriftrace.io.exr import write_exr
from iriftrace.tracing.engine import choose
from iriftrace.tracing.lost import warn_of_lost_rays
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.scene import Scene, ready_scene


@frozen(eq=False)
class Rendering:
    """One pose's image and its metrics."""

    image: AovImage
    metrics: PoseMetrics

    def __repr__(self) -> str:
        width, height = self.image.resolution
        return f"Rendering({width} x {height} px, {self.metrics!r})"

    def _repr_html_(self) -> str:
        """Numbers and picture, for notebooks."""
        size, metrics = self.image.resolution, self.metrics
        found, shift = metrics.displacement_mm, metrics.shift_px
        rows = {
            "displacement, median": f"{1e3 * (found.median or 0.0):.3g} um",
            "95th percentile": f"{1e3 * (found.p95 or 0.0):.3g} um",
            "shift in the picture, median": f"{shift.median or 0.0:.3g} px",
            "rays on the part": f"{metrics.rays.hit:,}",
        }
        return html_table(f"Rendering, {size[0]} x {size[1]} px", rows) + picture(self)

    def save(self, path: str | Path, *, rgb: str | None = None) -> tuple[Path, Path]:
        """Write the AOV EXR and, next to it, the metrics JSON; returns both names.

        `rgb` is passed to :func:`iriftrace.write_exr`.
        """
        self.saved(path, rgb=rgb)
        return Path(path), Path(path).with_suffix(".json")

    def saved(self, path: str | Path, *, rgb: str | None = None) -> Rendering:
        """Write as `save`; returns the rendering with the time that it took."""
        started = time.perf_counter()
        write_exr(path, self.image, rgb=rgb)
        written = self.with_time("write", started)
        write_metrics(Path(path).with_suffix(".json"), written.metrics)
        return written

    def with_time(self, stage: str, started: float) -> Rendering:
        """The rendering with the time of a stage that began at this count of seconds."""
        seconds = time.perf_counter() - started
        return evolve(self, metrics=self.metrics.with_time(stage, seconds))


def render_scene(
    scene: Scene,
    *,
    camera: Camera | None = None,
    include: Collection[int] = (0,),
    empty: bool = False,
    each: Callable[[int, AovImage], None] | None = None,
) -> Rendering:
    """Trace a camera's straight and refracted rays through a scene, and reduce the hits to metrics.

    The engine is chosen by :func:`iriftrace.tracing.engine.choose`; the metrics' key
    ``engine_test`` has the result of its test. For an ensemble (`Scene.members`) the image holds
    the mean displacement of the members and its standard deviation, and the metrics have the key
    ``ensemble``; see `pose_image`.

    Parameters
    ----------
    scene : Scene
    camera : Camera, optional
        Used instead of the scene's own sensor.
    include : collection of int
        Status codes whose rays the metrics use.
    empty : bool
        Accept a picture without a good ray as a result instead of raising an error.
    each : callable, optional
        Called with the place, from 0, and the image of each member of an ensemble, or of the one
        field.

    Raises
    ------
    InputError
        If the camera stands in the hot air or in the part, the film would smear the channels, or
        no ray hits the part in focus.

    Warns
    -----
    IriftraceWarning
        The shells are too few for the view, or over 0.5 % of its hits are lost (status 5 or 6).
    """
    loaded = ready_scene(scene)
    compiled = loaded.compiled
    if camera is None and loaded.camera is not compiled.camera:
        camera = loaded.camera
    began = time.perf_counter()
    choice = choose(loaded, camera)
    check_s = time.perf_counter() - began - choice.straight_s
    image = pose_image(choice.scene, camera, include, choice.straight, each)
    known = image.header["time_s"]
    # Loading the field is part of the check, and done once for many poses.
    known.update(load=compiled.load_s, build=compiled.build_s)
    known["straight"] += choice.straight_s
    if not empty:
        _refuse_empty(image)
    reduced = time.perf_counter()
    metrics = pose_metrics(image, loaded.part, include=tuple(include))
    warn_of_lost_rays(metrics.rays)
    done = time.perf_counter()
    times: dict[str, float | None] = {
        **image.header["time_s"],
        "check": check_s,
        "metrics": done - reduced,
        "write": 0.0,
        "figures": 0.0,
        # Further members of an ensemble are loaded after the start.
        "total": compiled.load_s + compiled.build_s + done - began,
    }
    return Rendering(image, evolve(metrics, time_s=times, engine_test=choice.as_dict()))


def keep_checks(metrics: PoseMetrics, earlier: JsonObject) -> PoseMetrics:
    """Copy times and checks that only rendering knew to the metrics of an image reduced again.

    `earlier` are the JSON values written when it was rendered; another pose's are not used.
    """
    known = earlier.get("time_s")
    if earlier.get("pose") != metrics.as_dict()["pose"] or not isinstance(known, Mapping):
        return metrics
    return evolve(
        metrics,
        time_s={
            key: known.get(key) if value is None else value for key, value in metrics.time_s.items()
        },
        engine_test=earlier.get("engine_test"),
        aperture=earlier.get("aperture"),
    )


def _refuse_empty(image: AovImage) -> None:
    if (image.channels["status.code"] == Status.GOOD).any():
        return
    status = image.status
    if (status == Status.MISSED).all():
        raise InputError(
            "No ray of the camera hits the part; point the camera at it (lookat in the scene).",
            code="picture.no_hit",
        )
    if np.isin(status, (Status.MISSED, Status.OUT_OF_FOCUS, Status.BLOCKED)).all():
        camera = image.camera
        hit = status == Status.OUT_OF_FOCUS
        if not hit.any():
            raise InputError(
                "Another object hides the part from every pixel; move the camera.",
                code="picture.hidden",
            )
        lengths = np.linalg.norm(image.vector("straight")[hit] - camera.origin, axis=1)
        raise InputError(
            f"No ray that hits the part is in focus: the hits are {lengths.min():.1f} to "
            f"{lengths.max():.1f} mm away, the focus interval is {camera.focus_mm[0]:g} to "
            f"{camera.focus_mm[1]:g} mm; move the camera or change focus_near and focus_far.",
            code="picture.out_of_focus",
            argument="focus",
        )
