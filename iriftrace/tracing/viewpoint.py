"""Places for cameras: outside the part and the hot air, with the whole part in the picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import open_edges
from iriftrace.core.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part
    from iriftrace.tracing.hot_air import AirState


DIAGONAL = np.array((0.62, -0.42, 0.66))
"""Direction from the part to a camera diagonally above it."""

FILLED = 0.95
"""Fraction of the picture's width and height that a part may fill; the rest shows that it ends."""

_SAMPLES = 20_000
"""Number of sampled places on the part; fractions differ by about 0.1 % from the part's."""

_CLOSER = 0.01
"""Relative tolerance of the distance at which the part fills the picture."""

_DOUBLINGS = 20
"""Largest multiple of the part's size that is tried as the distance of a camera that sees it."""


def _in_hot_air(points: FloatArray, field: IndexField, hottest_allowed: float) -> BoolArray:
    """(n,) mask of points (n, 3), mm, in air thinner than a refractivity; ambient off the data."""
    # NaN, outside the data, compares as ambient.
    return np.asarray(field.sample(points) < hottest_allowed)


def default_viewpoint(
    part: Part,
    field: IndexField | None,
    stack: ShellStack,
    camera: Camera,
    target: ArrayLike | None = None,
    up: ArrayLike = (0.0, 0.0, 1.0),
) -> FloatArray:
    """Camera-to-world matrix (4, 4) diagonally above the part, in cold air, with all of it in view.

    Lens, sensor and the near end of the focus, beyond which the whole part lies, are those of
    `camera`; without a field, the hot air is the box around the shells. It looks at `target` (3,),
    mm, world, by default the part's centre. If the picture cannot hold the whole part, as for a
    target far from it, the place is the nearest that all other conditions allow.
    """
    direction = DIAGONAL / np.linalg.norm(DIAGONAL)
    diagonal = float(np.linalg.norm(np.ptp(part.bounds, axis=0)))
    aim = part.centre if target is None else target

    def pose(distance_mm: float) -> FloatArray:
        return look_at(part.centre + distance_mm * direction, aim, up)

    nearest = max(diagonal, camera.focus_mm[0] + 0.5 * diagonal)

    def holds(distance_mm: float) -> bool:
        """True if all of the part lies well inside the picture."""
        return bool(_in_picture(camera.at(pose(distance_mm)), part.surface.corners, FILLED).all())

    first = _nearest_with(holds, nearest)
    distances = np.linspace(first, first + 5.0 * diagonal, 101)
    points = part.centre + distances[:, None] * direction
    if field is None:
        vertices = np.concatenate([shell.vertices for shell in stack.shells])
        cold = np.any((points < vertices.min(axis=0)) | (points > vertices.max(axis=0)), axis=1)
    else:
        ambient, hottest = field.ambient_refractivity, field.hottest_refractivity
        cold = ~_in_hot_air(points, field, ambient - 0.02 * (ambient - hottest))
    return pose(float(distances[int(np.argmax(cold))]))


def _nearest_with(holds: Callable[[float], bool], nearest_mm: float) -> float:
    """Smallest distance from which on something holds; `nearest_mm` if there is none."""
    if holds(nearest_mm):
        return nearest_mm
    tried = (nearest_mm * 2.0**number for number in range(1, _DOUBLINGS + 1))
    far = next((distance for distance in tried if holds(distance)), None)
    if far is None:
        return nearest_mm
    near = 0.5 * far
    while far - near > _CLOSER * near:
        middle = 0.5 * (near + far)
        near, far = (near, middle) if holds(middle) else (middle, far)
    return far


def _in_picture(camera: Camera, points: FloatArray, filled: float = 1.0) -> BoolArray:
    """(n,) mask of points (n, 3), mm, that the middle of the picture shows, without occlusion."""
    size = np.array(camera.resolution)
    place = camera.project(points)
    # NaN, behind the camera, compares as outside.
    off: FloatArray = np.max(np.abs(place - 0.5 * (size - 1)) / size, axis=1)
    return np.asarray(off <= 0.5 * filled)


@frozen
class PartView:
    """How much of a part its picture shows, as fractions of the solid angle at the camera."""

    # Relative to the sides that face the camera; occlusion between them is not considered.
    # 1 if no side faces the camera, as for a camera inside the part.
    outside: float
    out_of_focus: float  # in the picture, but nearer or farther than the focus interval


def part_view(part: Part, camera: Camera) -> PartView:
    """Measure how much of a part lies outside a camera's picture and focus.

    Both sides of an open part count, as its mesh does not state which is outside.
    """
    points, face = part.surface.even_places(_SAMPLES)
    offset = points - camera.origin
    distance = np.linalg.norm(offset, axis=1)
    parallel = camera.projection == "orthographic"
    sight = camera.forward if parallel else offset / distance[:, None]
    turned = -np.sum(part.face_normals[face] * sight, axis=1)
    turned = np.maximum(turned, 0.0) if part.closed else np.abs(turned)
    fraction = turned if parallel else turned / distance**2
    if not fraction.any():
        return PartView(1.0, 0.0)
    fraction = fraction / fraction.sum()
    length = offset @ camera.forward if parallel else distance
    near, far = camera.focus_mm
    seen = _in_picture(camera, points)
    sharp = (length >= near) & (length <= far)
    return PartView(float(fraction[~seen].sum()), float(fraction[seen & ~sharp].sum()))


def refuse_bad_places(
    camera: Camera, second: Camera | None, bodies: Sequence[Part], air: AirState
) -> None:
    """Refuse devices in a body or in hot air, and two at one place; see `refuse_camera_inside`."""
    if second is not None:
        refuse_one_place(camera, second)
    for device, name in ((camera, "camera"), (second, "second device")):
        if device is not None:
            refuse_camera_inside(device.origin, bodies, air, name)


def refuse_camera_inside(
    origin: ArrayLike, bodies: Sequence[Part], air: AirState, name: str = "camera"
) -> None:
    """Refuse a camera, at (3,) mm in the world, in the part or inside the outermost shell.

    `bodies` are the part and the bodies that only block the view. Without a field, the closed
    shells are used; `name` is the camera's name in the error.
    """
    point = np.asarray(origin, dtype=np.float64).reshape(1, 3)
    place = f"The {name} at {np.round(point[0], 1).tolist()} mm stands"
    for number, body in enumerate(bodies):
        if body.closed and body.surface.inside(point)[0]:
            what = f"blocker {body.path}" if number else "part"
            raise InputError(
                f"{place} in the {what}, where there is nothing to see; move it outside.",
                code="camera.inside",
            )
    shells, field = air.shells.shells, air.field
    if field is None:
        closed = [shell for shell in shells if len(open_edges(shell.faces)) == 0]
        layers = [s.layer for s in closed if Surface(s.vertices, s.faces).inside(point)[0]]
        if layers:
            raise InputError(
                f"{place} inside shell {max(layers)}, in the hot air, where the bending along its "
                "rays is not known; move it outside the outermost shell.",
                code="camera.inside",
            )
        return
    outermost = max(shell.refractivity for shell in shells)
    if _in_hot_air(point, field, outermost)[0]:
        temperature = float(field.air.temperature(field.sample(point))[0]) - ZERO_CELSIUS_K
        raise InputError(
            f"{place} in the hot air (about {temperature:.0f} degC), where the bending along its "
            "rays is not known; move it outside the outermost shell.",
            code="camera.inside",
        )


def refuse_one_place(camera: Camera, second: Camera) -> None:
    """Refuse two devices at one place, whose lines of sight meet only there."""
    if np.linalg.norm(camera.origin - second.origin) < 1e-3:
        raise InputError(
            "Both devices stand at one place, so their lines meet nowhere else; move one of them.",
            code="devices.one_place",
            argument="second",
        )
