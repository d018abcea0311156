"""Two devices that triangulate: what kind of sensor they are, and where their lines meet."""

from __future__ import annotations

from typing import get_args

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import cross_rows, row_lengths, unit_vectors
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.options import Phase
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.rays import is_inside
from iriftrace.tracing.scene import Scene, ready_scene
from iriftrace.tracing.second_options import SYSTEM_OF_DEVICE, System
from iriftrace.tracing.viewpoint import refuse_one_place


@frozen(eq=False)
class Sensor:
    """Two devices that triangulate, and what their software intersects."""

    camera: Camera
    second: Camera
    system: System
    phase: Phase  # lines of a projector; "both" for two cameras, "columns" for a laser

    @classmethod
    def of(
        cls, camera: Camera, second: Camera, system: System, phase: Phase | None = None
    ) -> Sensor:
        """A sensor; the phase is a projector's, by default its `better_phase`."""
        if system == "fringe":
            return cls(camera, second, system, phase or better_phase(camera, second))
        return cls(camera, second, system, "both" if system == "stereo" else "columns")

    @property
    def devices(self) -> tuple[Camera, Camera]:
        """Both of them."""
        return self.camera, self.second

    def triangulated(self, a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Measured points, mm, and gaps, mm, of lines of the camera and of the second device."""
        camera, second = self.devices
        if self.phase == "both":
            return nearest_point(camera.origin, a, second.origin, b)
        normal = phase_planes(second, b, self.phase)
        return on_plane(camera.origin, a, second.origin, normal), np.zeros(len(a))

    def off_sheet(self, points: FloatArray) -> FloatArray:
        """Distances (n,), mm, of points from a laser's sheet, along the rows of its picture."""
        place = self.second.project(points)
        place[:, 0] = (self.second.resolution[0] - 1) / 2
        start, line = self.second.rays(place)
        return row_lengths(cross_rows(line, points - start))


def sensor_of(
    scene: Scene,
    camera: Camera | None,
    second: Camera | None,
    system: System | None,
    phase: Phase | None,
) -> tuple[Scene, Sensor]:
    """The scene and its sensor, with the defaults of `measure`."""
    loaded = ready_scene(scene)
    camera = loaded.camera if camera is None else camera
    second = loaded.second if second is None else second
    if second is None:
        raise InputError(
            f"{loaded.name} has no second device, so there is nothing to triangulate with; write "
            "it with one, or give second=Camera(...).",
            code="devices.no_second",
            argument="second",
        )
    if system is None:
        system = SYSTEM_OF_DEVICE.get(loaded.second_id, "stereo")
    for value, kinds, what in ((system, System, "system"), (phase, Phase, "phase")):
        if value is not None and value not in get_args(kinds):
            raise InputError(
                f"There is no {what} {value!r}; use {' or '.join(get_args(kinds))}.",
                code="devices.unknown_name",
                argument=what,
            )
    if "orthographic" in (camera.projection, second.projection):
        raise InputError(
            "A device with parallel rays has no place from which to triangulate; give both devices "
            "a focal length.",
            code="camera.parallel_rays",
        )
    refuse_one_place(camera, second)
    places = (camera.origin, second.origin)
    for name, inside in zip(("camera", "second device"), is_inside(loaded, places), strict=True):
        if inside:
            raise InputError(
                f"The {name} stands in the hot air or in the part, where its lines of sight mean "
                "nothing; move it farther away.",
                code="camera.inside",
            )
    return loaded, Sensor.of(camera, second, system, phase)


def better_phase(camera: Camera, projector: Camera) -> Phase:
    """The lines of a projector's picture that run more across the direction to the camera."""
    base = projector.matrix[:3, :2].T @ (camera.origin - projector.origin)
    return "columns" if abs(base[0]) >= abs(base[1]) else "rows"


def provenance_of_two(scene: Scene, camera: Camera) -> JsonObject:
    """Provenance of a measurement of a scene by two devices, as plain JSON values."""
    found = provenance(scene, camera)
    found["assumptions"]["exposure"] = "one instant: both devices see the same air"
    return found


def phase_planes(projector: Camera, direction: FloatArray, phase: str) -> FloatArray:
    """Normals of the planes of a projector's columns or rows at its lines of sight.

    A laser's sheet is a column. Lines of sight beside it turn the sheet about the laser.
    With a distorting lens a column is not a plane; the plane through its tangent is used instead.
    """
    if projector.distortion is None:
        axis = projector.matrix[:3, 1 if phase == "columns" else 0]
        return unit_vectors(cross_rows(direction, np.broadcast_to(axis, direction.shape)))
    place = projector.project(projector.origin + direction)
    along = np.array((0.0, 0.5) if phase == "columns" else (0.5, 0.0))
    (_, before), (_, after) = projector.rays(place - along), projector.rays(place + along)
    return unit_vectors(cross_rows(before, after))


def nearest_point(
    first_origin: FloatArray, first: FloatArray, second_origin: FloatArray, second: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Midpoint (n, 3) of the shortest segment between skew lines (stereo), and its length (n,), mm.

    Hartley and Zisserman, Multiple View Geometry, 12.2, for lines in space. Origins are (3,) or
    (n, 3) arrays, mm, directions (n, 3) unit vectors, nowhere parallel.
    """
    base = second_origin - first_origin
    cosine = np.vecdot(first, second)
    normal = np.cross(first, second)
    sine_squared = np.einsum("ij,ij->i", normal, normal)
    along_first, along_second = np.vecdot(first, base), np.vecdot(second, base)
    s = (along_first - cosine * along_second) / sine_squared
    t = (cosine * along_first - along_second) / sine_squared
    one = first_origin + s[:, None] * first
    other = second_origin + t[:, None] * second
    return (one + other) / 2, np.linalg.norm(other - one, axis=1)


def on_plane(
    line_origin: FloatArray, line: FloatArray, plane_origin: FloatArray, normal: FloatArray
) -> FloatArray:
    """Points (n, 3), mm, where lines meet planes (fringe projection, sheets of light).

    Origins are (3,) or (n, 3) arrays, mm; directions and normals (n, 3) arrays.
    """
    reach = np.vecdot(normal, plane_origin - line_origin) / np.vecdot(normal, line)
    points: FloatArray = line_origin + reach[:, None] * line
    return points
