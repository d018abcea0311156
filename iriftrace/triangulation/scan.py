"""The cloud of points that a triangulating sensor measures through hot air, and its error.

The camera's pixel sees X on the part along a bent ray, and the second device sees or lights X along
another one. The sensor's software knows neither: it intersects the two straight lines of sight of
its calibration, and finds X'. The error is X' - X.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from attrs import Factory, evolve, frozen
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.camera.tiles import pixels_in_tiles
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.statistics import spread
from iriftrace.geometry.triangles import cross_rows, row_lengths, unit_vectors
from iriftrace.image.aov_image import Status
from iriftrace.part.part import Part
from iriftrace.scene.load import LoadedScene
from iriftrace.scene.member_weights import MemberWeights
from iriftrace.scene.scene import AnyScene, loaded_scene
from iriftrace.scene.viewpoint import refuse_one_place
from iriftrace.trace.engine import choose
from iriftrace.trace.lost import warn_of_lost_points
from iriftrace.trace.provenance import provenance
from iriftrace.trace.rays import traced_as_chosen
from iriftrace.triangulation.cloud_write import by_axis, save_cloud
from iriftrace.triangulation.cold_size import ColdSizes
from iriftrace.triangulation.feature_table import feature_table
from iriftrace.triangulation.intersection import nearest_point, on_plane
from iriftrace.triangulation.outliers import GATE
from iriftrace.triangulation.region_table import region_table
from iriftrace.triangulation.relations import relations, value_key
from iriftrace.triangulation.statistics import PointStatus, each_along, worst_member
from iriftrace.triangulation.two_points import lines_of_sight

SCHEMA = "iriftrace.scan/1"

System = Literal["stereo", "fringe", "laser"]
Phase = Literal["columns", "rows", "both"]

SYSTEM_OF_DEVICE: dict[str, System] = {
    "camera_2": "stereo",
    "projector": "fringe",
    "laser": "laser",
}
"""Kind of sensor by the id of the scene's second device."""

DEVICE_OF_SYSTEM = {system: device for device, system in SYSTEM_OF_DEVICE.items()}

LEAST_ANGLE = math.radians(1.0)
"""Lines at a smaller angle are warned of: their intersection moves 57 times as far as they do."""

CLEAR_MM = 1e-3
"""Length of a ray that may lack at a point it sees: what the miss allows at 0.06 degrees."""


class ScanStatus(PointStatus):
    """Outcome of a pixel of the device that is traced forward."""

    MEASURED = 0
    NOT_SEEN = 1
    OUTSIDE_PICTURE = 2
    SHADOW = 3
    SEVERAL_IMAGES = 4
    OUT_OF_FOCUS = 5
    LOST = 6


@frozen(eq=False)
class Scan:
    """Measured points and their errors, in the world's frame.

    Attributes
    ----------
    points : (n, 3) array, mm
        Measured points X'.
    true : (n, 3) array, mm
        The points X on the part.
    normal : (n, 3) array
        Outward unit normals of the part at X.
    gap : (n,) array, mm
        Distance of the two straight lines; 0 where a plane was intersected.
    angle : (n,) array, rad
        Between the two straight lines.
    pixel : (n, 2) array, px
        Of the camera; pixel centres at whole numbers.
    face : (n,) array of int
        Of the part, from 0.
    status : (h, w) array of int
        `ScanStatus` of every pixel of the device that was traced forward.
    system : str
        ``"stereo"``, ``"fringe"`` or ``"laser"``.
    phase : str
        Direction of the fringes' phase: ``"columns"``, ``"rows"`` or ``"both"``.
    camera, second : Camera
    provenance : dict
        Version, scene, field and part, and the assumptions in force; see
        :func:`iriftrace.trace.provenance.provenance`.
    errors : (k, n, 3) array or None, mm
        X' - X in the air of each member of an ensemble, whose weighted means over the k members
        all else is; None for one field.
    weights : MemberWeights or None
        Of the members.
    time_s : dict of float, s
        ``load`` and ``build`` of the scene, and ``measure``.
    """

    points: FloatArray
    true: FloatArray
    normal: FloatArray
    gap: FloatArray
    angle: FloatArray
    pixel: FloatArray
    face: IntArray
    status: NDArray[np.int64]
    system: str
    phase: str
    camera: Camera
    second: Camera
    provenance: dict[str, Any]
    errors: FloatArray | None = None
    weights: MemberWeights | None = None
    time_s: dict[str, float] = Factory(dict)

    def __repr__(self) -> str:
        middle = 1e3 * float(np.median(self.error_normal))
        return f"Scan({len(self.points):,} points, {self.system}, error {middle:.3g} um (median))"

    @property
    def error(self) -> FloatArray:
        """(n, 3) array, mm: X' - X."""
        return self.points - self.true

    @property
    def error_normal(self) -> FloatArray:
        """(n,) array, mm: the error along the outward normal, as a map against the CAD shows it."""
        along: FloatArray = np.einsum("ij,ij->i", self.error, self.normal)
        return along

    @property
    def scatter_normal(self) -> FloatArray | None:
        """(n,) array, mm: standard deviation over an ensemble's members along the normal."""
        if self.errors is None or self.weights is None:
            return None
        return self.weights.scatter(each_along(self.errors, self.normal))

    @property
    def worst_member(self) -> IntArray | None:
        """(n,) array: number of the member with the largest error along the normal."""
        if self.errors is None:
            return None
        numbers = [member["number"] for member in self.provenance["ensemble"]["members"]]
        along = each_along(self.errors, self.normal)
        return np.asarray(np.array(numbers)[np.abs(along).argmax(axis=0)])

    def _by_member(self) -> dict[str, Any]:
        """JSON values of an ensemble: scatter, and the error along the normal by each member."""
        scatter = self.scatter_normal
        if self.errors is None or scatter is None:
            return {}
        rows = [
            {
                **{key: member[key] for key in ("number", "label", "weight")},
                "error_normal_mm": spread(values),
            }
            for member, values in zip(
                self.provenance["ensemble"]["members"],
                each_along(self.errors, self.normal),
                strict=True,
            )
        ]
        worst = max(rows, key=lambda row: row["error_normal_mm"]["rms"])
        return {
            "scatter_normal_mm": spread(scatter),
            "members": rows,
            "worst_member": worst["number"],
        }

    def best_fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What a rigid alignment of the cloud to the part takes for pose, and what it leaves.

        Least squares of the errors along the normals over small motions, x -> x + w x (x - c) + t
        about the cloud's centre c (Chen and Medioni, Image and Vision Computing 10 (1992) 145).
        Motions that no normal tells of, as of a cylinder along its axis, are left at 0.

        Returns
        -------
        translation : (3,) array, mm
        rotation : (3,) array, rad
        error_normal : (n,) array, mm
            After the alignment.
        """
        arm = self.true - self.true.mean(axis=0)
        motions = np.hstack((self.normal, np.cross(arm, self.normal)))
        found, *_ = np.linalg.lstsq(motions, -self.error_normal, rcond=1e-6)
        return found[:3], found[3:], self.error_normal + motions @ found

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, schema ``iriftrace.scan/1``."""
        translation, rotation, left = self.best_fit()
        return {
            "schema": SCHEMA,
            **self.provenance,
            "system": self.system,
            "phase": self.phase,
            "points": {"pixels": int(self.status.size), **ScanStatus.counts(self.status)},
            "error_normal_mm": spread(self.error_normal),
            "error_mm": spread(np.linalg.norm(self.error, axis=1)),
            **self._by_member(),
            "gap_mm": spread(self.gap),
            "angle_deg": spread(np.degrees(self.angle)),
            "best_fit": {
                "translation_mm": translation.tolist(),
                "rotation_rad": rotation.tolist(),
                "error_normal_mm": spread(left),
            },
            "devices": {"camera": self.camera.as_dict(), "second": self.second.as_dict()},
            "time_s": self.time_s,
        }

    def features(
        self, part: Part, choices: Sequence[str], gate: float | None = GATE
    ) -> list[dict[str, Any]]:
        """Features of the points, cold and measured; see `feature_table`.

        Of an ensemble also ``size_scatter_mm``, the size's standard deviation over its members,
        and ``worst_member`` with ``worst_size_mm``, the size farthest from the cold one; of a part
        that is expanded ``at_reference`` (`ColdSizes`).
        """
        clouds = {"cold": self.true, "measured": self.points}
        by_member = () if self.errors is None else self.true + self.errors
        rows = feature_table(clouds, self.face, part, choices, by_member, gate)
        return ColdSizes(part).add_to_features([self._with_scatter(row) for row in rows], "cold")

    def relations(self, part: Part, features: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Distances and angles between `features` (see `relations`), with what they have.

        The keys of angles end in ``_deg`` in place of ``_mm``.
        """
        rows = [self._with_scatter(row) for row in relations(features)]
        return ColdSizes(part).add_to_relations(rows, features, "cold")

    def _with_scatter(self, row: dict[str, Any]) -> dict[str, Any]:
        """A feature or relation with its scatter and worst member."""
        key = value_key(row)
        if self.weights is None:
            return row
        sizes = row["by_member"][key]
        scatter_key = f"size_scatter_{key.rpartition('_')[2]}"
        if None in sizes:
            return row | {scatter_key: None}
        worst = worst_member(sizes, row[key]["cold"], key, self.provenance)
        return row | {scatter_key: float(self.weights.scatter(sizes)), **worst}

    def regions(self, part: Part) -> list[dict[str, Any]]:
        """Errors along the normal by region of the part; see `region_table`."""
        return region_table(part, self.face, self.error_normal)

    def save(
        self,
        path: str | Path,
        features: Sequence[dict[str, Any]] = (),
        acceptance: Sequence[dict[str, Any]] = (),
        regions: Sequence[dict[str, Any]] = (),
        related: Sequence[dict[str, Any]] = (),
    ) -> tuple[Path, Path]:
        """Write the cloud and, next to it, its numbers (.json).

        Parameters
        ----------
        path : path
        features, acceptance, regions, related : sequences of dict
            Written with the numbers.

        Raises
        ------
        InputError
            If the name ends in none of `iriftrace.triangulation.cloud_write.WRITTEN`.
        """
        values = self.as_dict() | {
            "features": list(features),
            "relations": list(related),
            "regions": list(regions),
        }
        if acceptance:
            values["acceptance"] = list(acceptance)
        scatter, worst = self.scatter_normal, self.worst_member
        columns: dict[str, NDArray[Any]] = {
            **by_axis("true", self.true),
            **by_axis("error", self.error),
            "error_normal": self.error_normal,
            **({} if scatter is None else {"scatter_normal": scatter}),
            **({} if worst is None else {"worst_member": worst.astype(np.int32)}),
            "gap": self.gap,
            "angle": self.angle,
            "pixel_u": self.pixel[:, 0],
            "pixel_v": self.pixel[:, 1],
            "face": self.face.astype(np.int32),
            # Of the points that were measured, which are the cloud.
            "status": np.full(len(self.points), ScanStatus.MEASURED, dtype=np.int32),
        }
        return save_cloud(path, self.points, columns, values)


def measure(
    scene: AnyScene,
    camera: Camera | None = None,
    second: Camera | None = None,
    *,
    system: System | None = None,
    phase: Phase | None = None,
) -> Scan:
    """Simulate a measurement with two devices in hot air.

    Of an ensemble of fields the weighted means over its members, with their scatter.

    The camera's pixels (the rays of the sheet, of a laser) are traced along their bent rays to the
    part. The other device's line of sight to each point is found by `lines_of_sight`. The measured
    point is where the straight lines meet:

    - ``stereo``: the midpoint between two cameras' lines.
    - ``fringe``: the camera's line meets the plane of the projector's column (``phase="columns"``)
      or row (``"rows"``) that lights the point; with ``"both"`` the midpoint between the lines.
    - ``laser``: the camera's line meets the sheet of light, which is the middle column of the
      second device.

    Parameters
    ----------
    scene : Scene, LoadedScene or path
    camera, second : Camera, optional
        The scene's own two sensors by default.
    system : str, optional
        By default what the id of the scene's second sensor says: ``camera_2``, ``projector`` or
        ``laser``; stereo for other ones.
    phase : str, optional
        Of fringe projection; by default columns or rows, whichever run more across the way from the
        projector to the camera.

    Raises
    ------
    InputError
        If there is no second device, both stand at one place, or they see nothing in common (of an
        ensemble: in the air of every member).

    Warns
    -----
    IriftraceWarning
        Half of the lines meet at less than 1 degree, or as :func:`iriftrace.trace.engine.choose`.
    """
    loaded, camera, second, system, phase = devices_of(scene, camera, second, system, phase)
    started = time.perf_counter()
    chosen = choose(loaded, camera, second).scene
    if chosen.ensemble is None:
        found = _scan(chosen, camera, second, system, phase)
    else:
        members = chosen.ensemble.scenes()
        scans = [_scan(member, camera, second, system, phase) for member in members]
        found = evolve(
            _together(scans, chosen.ensemble.weights),
            provenance=provenance_of_two(chosen, camera),
        )
    measure_s = time.perf_counter() - started
    time_s = {"load": loaded.load_s, "build": loaded.build_s, "measure": measure_s}
    return evolve(found, time_s=time_s)


def _together(scans: Sequence[Scan], weights: MemberWeights) -> Scan:
    """Weighted means of the points that are measured in the air of every member of an ensemble."""
    status = np.max([scan.status for scan in scans], axis=0)
    kept = (status == ScanStatus.MEASURED).ravel()
    if not kept.any():
        raise InputError(
            "No point is measured in the air of every member of the ensemble; point both devices "
            "at the same side, or measure one member (-D member=1)."
        )
    # Row by row of the picture, as the points of each scan are.
    rows = [np.cumsum(scan.status == ScanStatus.MEASURED)[kept] - 1 for scan in scans]

    def each(name: str) -> FloatArray:
        pairs = zip(scans, rows, strict=True)
        return np.array([getattr(scan, name)[chosen] for scan, chosen in pairs])

    true, errors = weights.mean(each("true")), each("error")
    first = scans[0]
    return evolve(
        first,
        points=true + weights.mean(errors),
        true=true,
        normal=first.normal[rows[0]],
        gap=weights.mean(each("gap")),
        angle=weights.mean(each("angle")),
        pixel=first.pixel[rows[0]],
        face=first.face[rows[0]],
        status=status,
        errors=errors,
        weights=weights,
    )


def devices_of(
    scene: AnyScene,
    camera: Camera | None,
    second: Camera | None,
    system: System | None,
    phase: Phase | None,
) -> tuple[LoadedScene, Camera, Camera, System, Phase]:
    """The scene, its two devices and the kind of sensor, with the defaults of `measure`."""
    loaded = loaded_scene(scene)
    camera = loaded.camera if camera is None else camera
    second = loaded.second if second is None else second
    if second is None:
        raise InputError(
            f"{loaded.name} has no second device, so there is nothing to triangulate with; write "
            "it with one (iriftrace scene --second X,Y,Z), or give second=Camera(...) from Python."
        )
    if system is None:
        system = SYSTEM_OF_DEVICE.get(loaded.second_id, "stereo")
    for value, kinds, what in ((system, System, "system"), (phase, Phase, "phase")):
        if value is not None and value not in get_args(kinds):
            raise InputError(f"There is no {what} {value!r}; use {' or '.join(get_args(kinds))}.")
    if "orthographic" in (camera.projection, second.projection):
        raise InputError(
            "A device with parallel rays has no place from which to triangulate; give both devices "
            "a focal length."
        )
    refuse_one_place(camera, second)
    if system == "stereo":
        return loaded, camera, second, system, "both"
    if system == "laser":
        return loaded, camera, second, system, "columns"
    return loaded, camera, second, system, phase or better_phase(camera, second)


def better_phase(camera: Camera, projector: Camera) -> Phase:
    """The lines of a projector's picture that run more across the way to the camera."""
    base = projector.matrix[:3, :2].T @ (camera.origin - projector.origin)
    return "columns" if abs(base[0]) >= abs(base[1]) else "rows"


def _scan(scene: LoadedScene, camera: Camera, second: Camera, system: System, phase: Phase) -> Scan:
    forward, solved = (second, camera) if system == "laser" else (camera, second)
    pixels, number, shape = _pixels(forward, sheet=system == "laser")
    towards = _towards_part(forward, scene.part, pixels)
    pixels, number = pixels[towards], number[towards]
    if len(pixels) == 0:
        raise InputError(_nothing_in_common(np.empty(0, np.int64), np.empty(0, np.int64)))
    origin, direction = forward.rays(pixels)
    hits = traced_as_chosen(
        scene, origin, direction, focus_mm=forward.focus_mm, coherent=True, trace_all=False
    )
    seen = hits.status == Status.GOOD
    lost = np.isin(hits.status, [code for code in Status if code.lost])
    candidates = hits.ray[seen]
    place = number[candidates]
    true, face = hits.refracted[seen], hits.refracted_face[seen]
    normal = scene.part.surface.normals[face]

    distance = row_lengths(true - solved.origin)
    near, far = solved.focus_mm
    # An open part may be seen from the back of its triangles, by both devices then.
    sides = (np.einsum("ij,ij->i", normal, one.origin - true) for one in (forward, solved))
    turned = np.prod(list(sides), axis=0) <= 0
    with np.errstate(invalid="ignore"):
        places = solved.project(true)
        inside = solved.holds(places)
    codes = np.select(
        [~inside, (distance < near) | (distance > far), turned],
        [ScanStatus.OUTSIDE_PICTURE, ScanStatus.OUT_OF_FOCUS, ScanStatus.SHADOW],
        ScanStatus.MEASURED,
    )
    asked = np.flatnonzero(codes == ScanStatus.MEASURED)
    lines = lines_of_sight(scene, solved.origin, true[asked])
    clear = np.abs(lines.lacking) <= CLEAR_MM
    codes[asked[~lines.found]] = ScanStatus.SEVERAL_IMAGES
    codes[asked[lines.lost]] = ScanStatus.LOST
    codes[asked[lines.found & ~clear]] = ScanStatus.SHADOW
    status = np.full(len(towards), ScanStatus.NOT_SEEN, dtype=np.int64)
    status[place] = codes
    status[number[hits.ray[lost]]] = ScanStatus.LOST
    missing = int((status == ScanStatus.LOST).sum())
    warn_of_lost_points(missing, len(true) + int(lost.sum()), "are left out")
    good = np.flatnonzero(lines.found & clear)
    good = good[np.argsort(place[asked[good]])]
    kept = asked[good]
    if len(kept) == 0:
        raise InputError(_nothing_in_common(hits.status, codes))
    one, other = direction[candidates[kept]], lines.direction[good]
    a, b = (other, one) if system == "laser" else (one, other)
    points, gap = triangulated(camera, second, a, b, system, phase)
    angle = np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1.0, 1.0))
    if np.median(angle) < LEAST_ANGLE:
        warnings.warn(
            f"The lines of the two devices meet at {np.degrees(np.median(angle)):.2g} degrees "
            "(median), so that small errors of either become large in depth; set them farther "
            "apart.",
            IriftraceWarning,
            stacklevel=4,
        )
    seen_at = camera.project(camera.origin + a) if system == "laser" else pixels[candidates[kept]]
    return Scan(
        points=points,
        true=true[kept],
        normal=normal[kept],
        gap=gap,
        angle=angle,
        pixel=seen_at,
        face=face[kept],
        status=status.reshape(shape),
        system=system,
        phase=phase,
        camera=camera,
        second=second,
        provenance=provenance_of_two(scene, camera),
    )


def provenance_of_two(scene: LoadedScene, camera: Camera) -> dict[str, Any]:
    """Provenance of what two devices measure of a scene, as plain JSON values."""
    found = provenance(scene, camera)
    found["assumptions"]["exposure"] = "one instant: both devices see the same air"
    return found


def _nothing_in_common(forward: IntArray, solved: IntArray) -> str:
    """Why no point is measured, by what became of the rays of the one and of the other device."""
    blurred = (forward == Status.OUT_OF_FOCUS).sum() + (solved == ScanStatus.OUT_OF_FOCUS).sum()
    if blurred > 0.5 * len(forward):
        return (
            "The two devices see no point of the part in common, as most of what they see is out "
            "of focus; move them, or change focus_near and focus_far (iriftrace scene --focus)."
        )
    return "The two devices see no point of the part in common; point both at the same side."


def _pixels(device: Camera, sheet: bool) -> tuple[FloatArray, NDArray[np.uint32], tuple[int, int]]:
    """Positions of a device's rays, px, in tiles; their row-major numbers; rows and columns."""
    width, height = device.resolution
    columns = np.array([(width - 1) / 2]) if sheet else np.arange(width, dtype=np.float64)
    number = pixels_in_tiles(len(columns), height)
    row, column = np.divmod(number, len(columns))
    return np.column_stack((columns[column], row)), number, (height, len(columns))


def _towards_part(device: Camera, part: Part, pixels: FloatArray) -> NDArray[np.bool_]:
    """Mask of the places in a picture, px, at which the part may be seen along straight lines."""
    places = device.project(part.vertices)
    # A distorting lens bends the outline beyond its corners; behind the device there are none.
    if device.distortion is not None or not np.isfinite(places).all():
        return np.ones(len(pixels), dtype=np.bool_)
    low, high = places.min(axis=0), places.max(axis=0)
    return np.asarray(((pixels >= low - 1.0) & (pixels <= high + 1.0)).all(axis=1))


def triangulated(
    camera: Camera, second: Camera, a: FloatArray, b: FloatArray, system: System, phase: Phase
) -> tuple[FloatArray, FloatArray]:
    """Measured points, mm, and gaps, mm, of lines of the camera and of the second device."""
    if phase == "both":
        return nearest_point(camera.origin, a, second.origin, b)
    if system == "laser":
        # The plane of the laser's middle column.
        middle, height = (second.resolution[0] - 1) / 2, second.resolution[1]
        _, (top, bottom) = second.rays(((middle, -0.5), (middle, height - 0.5)))
        across = np.cross(top, bottom)
        normal = np.broadcast_to(across / np.linalg.norm(across), a.shape)
    else:
        normal = phase_planes(second, b, phase)
    return on_plane(camera.origin, a, second.origin, normal), np.zeros(len(a))


def phase_planes(projector: Camera, direction: FloatArray, phase: str) -> FloatArray:
    """Normals of the planes of a projector's columns or rows at its lines of sight.

    With a distorting lens a column is no plane; the plane through its tangent takes its place.
    """
    place = projector.project(projector.origin + direction)
    along = np.array((0.0, 0.5) if phase == "columns" else (0.5, 0.0))
    (_, before), (_, after) = projector.rays(place - along), projector.rays(place + along)
    return unit_vectors(cross_rows(before, after))
