"""How rays are bent between a scene's shells: at each of them, or all along the layers.

Both rules are told of every shell that a ray crosses, and of the end of its way. They hold what
they need to remember of a ray in a tuple of Dr.Jit arrays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .geometry import SceneTables
from .layer_turn import Layer, onto_plane, outside, slope_of
from .refraction import (
    GRAZING,
    Triangle,
    between_corners,
    corner_weights,
    cross_surface,
    interpolated_normal,
)


class Passage(NamedTuple):
    """A ray's way to the next shell, and its crossing there."""

    direction: Any  # Vector3d, unit: along the way
    length: Any  # Float64, mm: since the shell before, or the start
    first: Any  # Bool: there is no shell before
    point: Any  # Point3d, mm: where it crosses the shell
    outward: Any  # Bool: along the shell's normals
    face: Any  # UInt32: row of the triangle in the tables
    triangle: Triangle
    facet: Any  # Vector3d: the triangle's unit normal
    shape: Any  # UInt32: number of the shell
    near: Any  # Float64: index of the layer that it comes from
    far: Any  # Float64: index of the layer that it goes into
    crossed: Any  # Bool: the ray does cross a shell


class AtShells:
    """Snell's law at every shell; between them the rays are straight.

    Parameters
    ----------
    tables : SceneTables
    gradient_normals : bool
        Refract at the normals interpolated from the vertices, not at the facets'.
    """

    def __init__(self, tables: SceneTables, gradient_normals: bool) -> None:
        self._tables = tables
        self._gradient_normals = gradient_normals

    def start(self, width: int) -> tuple[Any, ...]:
        """What is remembered of rays that have crossed no shell."""
        return ()

    def cross(self, memory: tuple[Any, ...], passage: Passage) -> tuple[Any, Any, tuple[Any, ...]]:
        """Direction (Vector3d) behind a shell, whether it is reflected (Bool), and the memory."""
        shading = None
        if self._gradient_normals:
            normals = self._tables.vertex_normals(passage.face, passage.crossed)
            shading = interpolated_normal(passage.point, passage.triangle, normals, passage.facet)
        ratio = passage.near / passage.far
        bent, reflected = cross_surface(
            passage.direction, passage.facet, shading, ratio, passage.outward
        )
        return bent, reflected, memory

    def end(
        self, memory: tuple[Any, ...], direction: Any, length: Any, facet: Any, any_shell: Any
    ) -> tuple[Any, Any]:
        """How far the last way's end lies beside the ray (Vector3d, mm), and its direction."""
        return 0 * direction, direction


class Memory(NamedTuple):
    """What :class:`InLayers` remembers of a ray."""

    pull: Any  # Vector3f, 1/mm: gradient of the index at the last shell
    change: Any  # Vector3f, 1/mm^2: its change along the ray
    level: Any  # Float64: index of the air at that shell
    beyond: Any  # Float64: index of the layer behind it
    aside: Any  # Vector3f, mm: how far the ray lies beside the one that is marched
    along: Any  # Float64, mm: how much further along it is, where it crosses the shell's plane


class InLayers:
    r"""The ray equation integrated from shell to shell.

    At its shells the gradient of the index is known (their normals and how steep the index is), its
    derivatives, and what n changes by from one to the next. So a ray's turn in a layer is

    .. math:: \Delta t = \frac{1}{n} \int (\nabla n)_\perp \, ds

    by Hermite's cubic through the gradients and their changes along the ray at both ends, which is
    exact for gradients that are cubic in s. Then the length of the gradient is corrected so that
    the index changes by what it must, as far as the ray runs along the gradient (``LEAN``) and its
    direction is the same at both ends (``ALIKE``).

    Outside the outermost shell n is taken to fade towards the ambient, the sooner the more the
    shell curves away from the ray; how the gradient turns and how far out that happens is what the
    outermost shell's derivatives say (:mod:`iriftrace.outer_air`). In other layers, such as that
    at the part, the gradient is linear in s, and n changes by half a step at most for rays across
    the layer, by a whole one for rays along it; a ray that comes from far into such a layer enters
    the data there, and n fades.

    A ray is marched along straight ways and turned at the shells. By how much the bent ways end
    beside the straight ones is added up: where the ray really crosses a shell's plane, up to some
    micrometres beside, the gradient is taken, and there it hits the part in the end.

    Snell's law at the shells sees a ray that just touches a shell turned much and one that just
    misses it not at all, so single rays that turn round in the air converge with order 1/2 in the
    number of shells; here the layer is the same for both, and they converge with order 2 to 2.5.

    Parameters
    ----------
    tables : SceneTables
        Of shells that have vertex normals and steepnesses.
    """

    def __init__(self, tables: SceneTables) -> None:
        self._tables = tables

    def start(self, width: int) -> tuple[Any, ...]:
        """What is remembered of rays that have crossed no shell."""
        import drjit as dr
        import mitsuba as mi

        pull, change, aside = (dr.zeros(mi.Vector3f, width) for _ in range(3))
        level, beyond, along = (dr.zeros(mi.Float64, width) for _ in range(3))
        return pull, change, level, beyond, aside, along

    def cross(self, memory: Any, passage: Passage) -> tuple[Any, Any, tuple[Any, ...]]:
        """Direction (Vector3d) behind a shell, whether it is reflected (Bool), and the memory."""
        import drjit as dr
        import mitsuba as mi

        last = Memory(*memory)
        direction, crossed = passage.direction, passage.crossed
        beside = mi.Vector3d(last.aside)
        along = onto_plane(beside, direction, passage.facet)
        point = passage.point + beside + along * direction
        length = mi.Float(dr.maximum(passage.length + along - last.along, 0))
        level = self._tables.level(passage.shape, crossed)
        # Turns are small, so single precision will do, which takes half the time.
        heading = mi.Vector3f(direction)
        weights = corner_weights(point, passage.triangle, passage.facet)
        weights = mi.Float(weights[0]), mi.Float(weights[1])
        gradients, changes = self._tables.gradients(passage.face, heading, crossed)
        pull, change = between_corners(gradients, weights), between_corners(changes, weights)
        layer = Layer(
            slope_of(last.pull, last.change),
            slope_of(pull, change),
            last.level,
            level,
            passage.near,
            self._ambient,
        )
        # The mean direction, which a guess of the turn tells, is the same for the way back.
        guess = dr.select(
            passage.first,
            layer.coming(heading, length)[0],
            layer.through(heading, length)[0],
        )
        turn, aside = layer.turn(dr.normalize(heading + 0.5 * guess), length, passage.first)
        ahead = direction + mi.Vector3d(turn)
        away = dr.select(passage.outward, passage.facet, -passage.facet)
        ahead += dr.maximum(GRAZING - dr.dot(ahead, away), 0) * away
        kept = (
            dr.select(crossed, pull, last.pull),
            dr.select(crossed, change, last.change),
            dr.select(crossed, level, last.level),
            dr.select(crossed, passage.far, last.beyond),
            dr.select(crossed, last.aside + aside, last.aside),
            dr.select(crossed, along, last.along),
        )
        return dr.normalize(ahead), mi.Bool(False), kept

    def end(
        self, memory: Any, direction: Any, length: Any, facet: Any, any_shell: Any
    ) -> tuple[Any, Any]:
        """How far the last way's end lies beside the ray (Vector3d, mm), and its direction."""
        import drjit as dr
        import mitsuba as mi

        last = Memory(*memory)
        beside, heading = mi.Vector3d(last.aside), mi.Vector3f(direction)
        length = length + onto_plane(beside, direction, facet) - last.along
        slope = slope_of(last.pull, last.change)
        air = slope, last.level, last.beyond, self._ambient
        guess, _ = outside(*air, heading, mi.Float(length), 1)
        mean = dr.normalize(heading + 0.5 * guess)
        turn, late = (mi.Vector3d(v) for v in outside(*air, mean, mi.Float(length), 1))
        # Counted from the shell, as if the ray ran backwards; the rest of the way is a lever. What
        # leaves the scene is given by a point at its last shell and the direction far from it.
        lever = dr.select(dr.isfinite(length), length, 0)
        aside = beside + turn * lever - late
        return (
            dr.select(any_shell, aside, 0),
            dr.select(any_shell, dr.normalize(direction + turn), direction),
        )

    @property
    def _ambient(self) -> Any:
        import drjit as dr
        import mitsuba as mi

        return dr.opaque(mi.Float64, self._tables.ambient)
