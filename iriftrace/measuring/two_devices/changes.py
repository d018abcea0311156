"""Changes of the refraction error with the poses of the devices, and of air between members.

At true points X each device's lines of sight give e(X) = X' - X as in `iriftrace.measure`, so two
calls differ in nothing but the pose, or the air. A sample of the points suffices, as features are
fitted to the same points with and without a change.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from attrs import evolve, frozen
from scipy.spatial.transform import Rotation

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.engines import Engine
from iriftrace.measuring.two_devices.devices import Sensor
from iriftrace.measuring.two_devices.two_points import lines_of_sight
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.medium.path_data import CommonMesh
from iriftrace.part.part import Part
from iriftrace.tracing.scene import Scene

POSE = "position and rotation of the devices"
SURROGATE = "linear mixture of members"

STEP_MM, STEP_RAD = 1.0, 1e-3
"""Least step of a derivative, so that it stands out from the rounding of single precision."""

SAMPLE = 2000
"""Maximum number of points of a region."""

MIXTURES = 8
"""Number of traces of mixed air."""

MOST_UNKNOWN = 0.05
"""Fraction of a region's sampled points with an unknown change, above which none of them is used.

Lines of sight that are lost or have several images pass the steepest air, so that the others would
state too little.
"""


@frozen(eq=False)
class Changes:
    """Change of the refraction error by a group of inputs, in m independent directions.

    Attributes
    ----------
    group, source : str
    rows : (r,) array of int
        Sampled points at which all changes are known; none of a region of which more than
        `MOST_UNKNOWN` are not known.
    errors : (m, r, 3) array, mm
        By one standard uncertainty in each direction.
    """

    group: str
    source: str
    rows: IntArray
    errors: FloatArray


def _known(
    group: str, source: str, rows: IntArray, errors: FloatArray, face: IntArray, part: Part
) -> Changes:
    """The changes by errors (m, r, 3), NaN where a line of sight is not known, at sampled rows."""
    unknown = np.isnan(errors).any(axis=(0, 2))
    region = part.region_of_face[face[rows]]
    doubtful = np.bincount(region, unknown) > MOST_UNKNOWN * np.bincount(region)
    known = ~unknown & ~doubtful[region]
    return Changes(group, source, rows[known], errors[:, known])


def _sampled(face: IntArray, part: Part) -> IntArray:
    """Numbers (r,) of points on faces (n,) of a part, evenly from those of each region."""
    rows = np.flatnonzero(face >= 0)
    region = part.region_of_face[face[rows]]
    found = [rows[region == number] for number in np.unique(region)]
    chosen = [one[:: -(-len(one) // SAMPLE)] for one in found]
    return np.sort(np.concatenate(chosen)) if chosen else rows


def error_at(scene: Scene, sensor: Sensor, points: FloatArray) -> FloatArray:
    """Refraction error (n, 3), mm, of true points (n, 3) in one field; NaN where it is unknown."""
    lines = [lines_of_sight(scene, device.origin, points) for device in sensor.devices]
    seen, _ = sensor.triangulated(*(one.direction for one in lines))
    found = np.logical_and(*(one.found for one in lines))
    return np.where(found[:, None], seen - points, np.nan)


def pose_changes(
    scene: Scene, sensor: Sensor, inputs: Inputs, points: FloatArray, face: IntArray
) -> tuple[Changes, ...]:
    """Changes by the stated uncertainties of the devices' poses; none if they are not stated.

    By central differences at true points (n, 3), mm, on faces (n,), -1 for those to leave out, in
    the member with the largest weight.
    """
    if not inputs.of_pose:
        return ()
    rows = _sampled(face, scene.part)
    heaviest = int(np.argmax(scene.weights.weights)) if scene.members else 0
    found = []
    for field in scene.alone([heaviest]):
        for factor, *pair in _moved(sensor, inputs):
            before, after = (error_at(field, moved, points[rows]) for moved in pair)
            found.append(factor * (after - before))
    source = "stated; central differences"
    return (_known(POSE, source, rows, np.array(found), face, scene.part),)


def _moved(sensor: Sensor, inputs: Inputs) -> Iterator[tuple[float, Sensor, Sensor]]:
    """The sensor with one device moved back and forth along, or about, each of its axes.

    The change between both times the first number is that by one standard uncertainty.
    """
    for u, least in ((inputs.position_mm, STEP_MM), (inputs.rotation_rad, STEP_RAD)):
        if not u:
            continue
        step = max(u, least)
        for second, axis in product((False, True), np.eye(3)):
            device = sensor.second if second else sensor.camera
            before, after = (
                device.at(device.matrix @ _motion(sign * step * axis, turned=least == STEP_RAD))
                for sign in (-1.0, 1.0)
            )
            if second:
                pair = evolve(sensor, second=before), evolve(sensor, second=after)
            else:
                pair = evolve(sensor, camera=before), evolve(sensor, camera=after)
            yield 0.5 * u / step, *pair


def _motion(along: FloatArray, *, turned: bool) -> FloatArray:
    """Rigid motion (4, 4) by a vector, mm, or a turn by a rotation vector, rad."""
    motion = np.eye(4)
    if turned:
        motion[:3, :3] = Rotation.from_rotvec(along).as_matrix()
    else:
        motion[:3, 3] = along
    return motion


def mixture_changes(
    scene: Scene, sensor: Sensor, groups: AirGroups, points: FloatArray, face: IntArray
) -> Changes | None:
    """Difference between traces of mixed air and the linear mixture of the members' errors.

    At true points (n, 3), mm, on faces (n,), through the cells of all fields whatever engine the
    scene has. Each is divided by the root of their number, so that their sum of squares is the mean
    square. None for a scene with nothing to mix. Raises InputError if a field has no file, or
    another mesh.
    """
    mixtures = groups.mixtures(MIXTURES)
    if mixtures is None:
        return None
    rows = _sampled(face, scene.part)
    places = np.flatnonzero(np.any(mixtures != 0.0, axis=0))
    states = [scene.air.states[place] for place in places]
    mesh = CommonMesh.of([state.cells for state in states])
    # Each mixture needs an integrator of its own, which a scene with shells makes.
    shells = evolve(scene, engine=Engine.SHELLS) if scene.engine.through_cells else scene
    found = [
        error_at(base.through(mesh.mixed(shares)), sensor, points[rows])
        for base in shells.alone(places[:1])
        for shares in (*np.eye(len(places)), *mixtures[:, places])
    ]
    by_member, mixed = np.split(np.array(found), [len(places)])
    off = mixed - np.tensordot(mixtures[:, places], by_member, axes=1)
    source = f"{MIXTURES} traces of mixed air"
    return _known(SURROGATE, source, rows, off / np.sqrt(MIXTURES), face, scene.part)
