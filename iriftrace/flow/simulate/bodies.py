"""Solid bodies in the air besides the part: supports, a gripper, a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import PLAUSIBLE_K
from iriftrace.flow.simulate.domain import Domain
from iriftrace.flow.simulate.draught import SIDES
from iriftrace.flow.simulate.part_surface import is_symmetric, write_stl
from iriftrace.io.named_files import BODIES
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.wall_temperature import HOTTEST

FLOOR = "floor"
"""Name of the floor among the bodies."""
_LOWER = 0.01  # mm
_INLET_SAMPLES = 40
_MOST_BLOCKED = 0.5
_SLICES = 9
_INWARD = 1e-3  # mm


@frozen(eq=False)
class Body:
    """Closed body with a wall of one temperature, or an insulated wall."""

    surface: Part
    temperature_k: float | None = None  # None if it is insulated

    @property
    def name(self) -> str:
        """Name of its file without the suffix."""
        return Path(self.surface.path).stem

    def record(self) -> JsonObject:
        """Description of the body, with the file of its copy next to the field."""
        return {
            "name": self.name,
            "file": f"{BODIES}/{self.name}.stl",
            "sha256": self.surface.sha256,
            "temperature_k": self.temperature_k,
        }


def floor_below(grid: pv.UnstructuredGrid, height: float) -> Body:
    """The floor at a height z, mm, that blocks the view: a plate as large as the field above it.

    It lies slightly lower, so that it hides the underside of a part that stands on it.
    """
    import trimesh

    box = np.reshape(grid.bounds, (3, 2)).T
    box[:, 2] = height - _LOWER - 1.0, height - _LOWER
    plate = trimesh.creation.box(bounds=box)
    return Body(part_of_mesh(plate.vertices, plate.faces, name=FLOOR))


def write_bodies(bodies: Sequence[Body], folder: Path) -> None:
    """Write copies of the bodies, mm, world, into `BODIES` in the field's folder."""
    for body in bodies:
        target = folder / str(body.record()["file"])
        target.parent.mkdir(parents=True, exist_ok=True)
        write_stl(body.surface, target, scale=1.0)


def check_bodies(bodies: Sequence[Body], part: Part, domain: Domain, floor: bool = False) -> None:
    """Refuse bodies that are not possible in this air, perhaps with a floor; an InputError."""
    names = [body.name for body in bodies] + [FLOOR] * floor
    for body in bodies:
        path = body.surface.path
        if names.count(body.name) > 1:
            raise InputError(
                f'there are two bodies of the name "{body.name}", which results could not '
                "distinguish; rename a file.",
                code="body.same_name",
                argument="body",
            )
        if not body.surface.closed:
            raise InputError(
                f"the body {path} is not closed, so the air cannot be meshed around it; close the "
                "holes of its surface first.",
                code="body.open",
            )
        kelvin = body.temperature_k
        if kelvin is not None and not PLAUSIBLE_K[0] <= kelvin <= HOTTEST:
            raise InputError(
                f"the body {path} cannot have {kelvin:g} K here; give a temperature from "
                f"{PLAUSIBLE_K[0]:g} to {HOTTEST:g} K, or insulated.",
                code="body.temperature",
                argument="body_temperature",
            )
        low, high = body.surface.bounds
        if (high <= domain.lower).any() or (low >= domain.upper).any():
            raise InputError(
                f"the body {path} lies outside the air that is computed; check its position and "
                "unit, or enlarge the air.",
                code="body.outside_air",
                argument="margin",
            )
        solid = body.surface.closed_surface
        # A part that is the body itself lies on its surface and not inside it.
        if solid.inside(part.face_centres - _INWARD * part.face_normals).all():
            raise InputError(
                f"the part lies inside the body {path}, so no air touches it; check the place of "
                "both.",
                code="body.around_part",
            )
        if solid.inside(np.array([domain.point_in_air])).any():
            raise InputError(
                f"the body {path} fills the upper corner of the air that is computed; give a "
                "smaller one, or enlarge the air.",
                code="body.fills_corner",
                argument="margin",
            )


def check_inlets(bodies: Sequence[Body], inlets: Sequence[str], domain: Domain) -> None:
    """Refuse bodies that block the draught where it enters, with an InputError."""
    for name in inlets:
        points = _inlet_points(name, domain)
        blocked: BoolArray = np.zeros(len(points), dtype=bool)
        for body in bodies:
            blocked |= body.surface.closed_surface.inside(points)
        if blocked.mean() > _MOST_BLOCKED:
            raise InputError(
                f"the bodies fill {blocked.mean():.0%} of the side {name} of the air through which "
                "the draught enters; give smaller ones, enlarge the air, or let the "
                "draught come from another side.",
                code="draught.blocked",
                argument="margin",
            )
        if _screened(bodies, name, points, domain):
            raise InputError(
                f"the bodies close the air between its side {name}, through which the draught "
                "enters, and the part; give smaller ones, or let the draught come from another "
                "side.",
                code="draught.screened",
            )


def _screened(bodies: Sequence[Body], inlet: str, points: FloatArray, domain: Domain) -> bool:
    """True if bodies hide the part from all of the (n, 3) points of an inlet."""
    axis, sign = SIDES[inlet]
    middle = 0.5 * (domain.lower[axis] + domain.upper[axis])
    blocked: BoolArray = np.zeros(len(points), dtype=bool)
    for body in bodies:
        low, high = body.surface.bounds[:, axis]
        for place in np.linspace(low, high, _SLICES + 2)[1:-1]:
            if sign * (place - middle) > 0.0:
                moved = points.copy()
                moved[:, axis] = place
                blocked |= body.surface.closed_surface.inside(moved)
    return bool(blocked.all())


def check_mirrored_bodies(bodies: Sequence[Body], centre: FloatArray, mirrors: str) -> None:
    """Refuse bodies that are not symmetric about the part's centre plane, with an InputError."""
    for body in bodies:
        for name in mirrors:
            if not is_symmetric(body.surface, name, centre):
                raise InputError(
                    f"the body {body.surface.path} is not symmetric about the part's centre plane "
                    f"{name} = {centre['xy'.index(name)]:g} mm, so the air is not; leave {name} "
                    "out of the symmetry.",
                    code="body.asymmetric",
                    argument="symmetry",
                )


def _inlet_points(name: str, domain: Domain) -> FloatArray:
    """(n, 3) points, mm, spread over a side of the air, a rounding error inside it."""
    axis, sign = SIDES[name]
    low, high = np.array(domain.lower), np.array(domain.upper)
    steps = (np.arange(_INLET_SAMPLES) + 0.5) / _INLET_SAMPLES
    across, up = (grid.ravel() for grid in np.meshgrid(steps, steps))
    points = low + np.stack((across, across, up), axis=1) * (high - low)
    points[:, axis] = (high if sign > 0.0 else low)[axis] - sign * 1e-3
    return as_float64(points)
