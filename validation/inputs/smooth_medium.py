"""Media whose index is a formula, in the form that the cells engine uses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from iriftrace.plugins.kernels.bundle import straight_hits
from iriftrace.plugins.kernels.curve import curved_hits
from iriftrace.plugins.kernels.tetrahedra import CellPassage, Entrance
from iriftrace.plugins.kernels.vertex_table import aligned
from validation.inputs.small_scenes import scene

Field = Callable[[Any], tuple[Any, Any]]
"""n - 1 and its gradient (Vector3d, 1/mm) at points (Point3d, mm)."""


class SmoothMedium:
    """A medium without bounds, passed in steps of one length.

    Where hot air begins, and the gradient has a jump, `kink` gives the distance to it along rays:
    one step through the ambient air ends just before it, and another of a few billionths of a
    millimetre leads across.
    """

    def __init__(
        self, field: Field, step: float, kink: Callable[[Any, Any], Any] | None = None
    ) -> None:
        self.field, self.step, self.kink = field, step, kink
        self.ambient, self.open_step = 0.0, float("inf")

    def cell(self, place: Any, active: Any) -> SmoothPiece:
        return SmoothPiece(self)

    @staticmethod
    def unentered(place: Any) -> Any:
        return place

    def boundary_beside(self, scene: Any) -> Any:
        return scene

    def forget_scene(self) -> None:
        """There is no boundary that knows one."""

    def is_hot(self, point: Any, scene: Any) -> bool:
        """It goes on without end, so rays may start anywhere in it."""
        return False

    def entrance(self, preliminary: Any, active: Any) -> Entrance:
        """Everything is inside."""
        import mitsuba as mi

        return Entrance(active, mi.Float64(0), mi.UInt32(0), mi.Bool(False))


class SmoothPiece:
    """The next step of each ray."""

    def __init__(self, medium: SmoothMedium) -> None:
        self.medium = medium

    def refractivity(self, point: Any) -> Any:
        return self.medium.field(point)[0]

    def acceleration(self, point: Any, heading: Any) -> Any:
        refractivity, gradient = self.medium.field(point)
        return gradient * (1 + refractivity)

    def gradient_error(self, point: Any, heading: Any) -> Any:
        import mitsuba as mi

        return mi.Vector3d(0)

    def entry_distance(self, point: Any, direction: Any) -> tuple[Any, Any]:
        import mitsuba as mi

        return mi.Float64(0), mi.Bool(True)

    def passage(self, point: Any, direction: Any) -> CellPassage:
        import drjit as dr
        import mitsuba as mi

        never = mi.Bool(False)
        length = dr.opaque(mi.Float64, self.medium.step)
        if self.medium.kink is not None:
            to_kink = self.medium.kink(point, direction)
            length = dr.select(to_kink > 0, dr.maximum(to_kink - 1e-9, 3e-9), length)
        return CellPassage(length, mi.UInt32(0), never, never, never)


class Ends:
    """Ends of rays, as NumPy arrays."""

    def __init__(self, hits: Any) -> None:
        import drjit as dr

        # Together, the rays are traced once.
        dr.eval(*hits)
        self.point = np.stack([np.array(axis) for axis in hits.point], axis=1)
        self.direction = np.stack([np.array(axis) for axis in hits.direction], axis=1)
        self.outcome = np.array(hits.outcome)
        self.path_length = np.array(hits.path_length)
        self.crossings = np.array(hits.crossings)
        self.entry_index = np.array(hits.entry_index)
        self.index_sum = np.array(hits.index_sum)
        self.error = np.array(hits.error)
        self.opened = np.array(hits.opened)
        self.relocations = np.array(hits.relocations)


def follow(
    part: dict[str, Any],
    medium: Any,
    origins: np.ndarray,
    directions: np.ndarray,
    *,
    max_steps: int = 100_000,
) -> tuple[Ends, np.ndarray]:
    """Trace rays through a medium to a part; returns their ends and the straight hits."""
    import mitsuba as mi

    loaded = scene({"part": part})
    prepared = loaded.integrator().prepare(loaded)
    origin = mi.Point3d(*(aligned(axis) for axis in np.array(origins, dtype=float).T))
    direction = mi.Vector3d(*(aligned(axis) for axis in np.array(directions, dtype=float).T))
    straight = straight_hits(prepared, origin, direction, coherent=False)
    bent = curved_hits(prepared, medium, origin, direction, coherent=False, max_steps=max_steps)
    reached = np.array(origins) + np.array(directions) * np.array(straight.distance)[:, None]
    return Ends(bent), reached
