r"""Rays bent between a scene's shells: at each of them, or all along the layers between them.

Geometrical optics in air of the index :math:`n(x)`: a ray with unit tangent t obeys

.. math:: \frac{d}{ds}(n t) = \nabla n
          \qquad\Rightarrow\qquad
          \frac{dt}{ds} = \frac{1}{n} (\nabla n)_\perp

(Born and Wolf, Principles of Optics, 3.2), where :math:`\perp` is the part across the ray. Over a
segment of length L from a shell a to the next shell b the tangent changes by the *deflection*, and
the end of the path is off the straight one by the *lateral offset*:

.. math:: \Delta t = \frac{1}{n} \int_0^L g_\perp \, ds, \qquad
          \Delta x = \frac{1}{n} \int_0^L (L - s) \, g_\perp \, ds, \qquad g = \nabla n

Given are g and the Hessian H at every shell, hence g and :math:`g' = H t` at both ends of the
segment, and the index at the shells, hence :math:`n_b - n_a`.

1. Quadrature of Hermite's cubic through :math:`g_a, g_a', g_b, g_b'` (Davis and Rabinowitz, Methods
   of Numerical Integration, 2.7):

   .. math:: \int_0^L g \, ds = \frac{L}{2}(g_a + g_b) + \frac{L^2}{12}(g_a' - g_b')

2. The same integral along the ray is known exactly, :math:`\int g \cdot t \, ds = n_b - n_a`, and
   these steps telescope to the whole change of the index along the ray. The residual of the
   quadrature, :math:`r = n_b - n_a - t \cdot \int g \, ds`, shows by how much its gradient is too
   short: see :func:`length_gain`.

From the last shell to the part the segment's length is known and :math:`g(s) = g_a + s g_a'`
(:func:`beside_part`); in the ambient air outside the first shell n approaches the ambient index
(:func:`outside`).
"""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.between import (
    AtShell,
    between_shells,
    layer_at_rim,
    onto_plane,
    open_layer,
    transverse,
    weighted_mean,
)
from iriftrace.plugins.kernels.snell import (
    GRAZING,
    Triangle,
    between_corners,
    corner_weights,
    cross_surface,
    interpolated_normal,
)
from iriftrace.plugins.kernels.tables import SceneTables


class Passage(NamedTuple):
    """A ray's segment to the next shell, and its crossing there."""

    direction: dt.Vector3d  # unit: along the segment
    length: dt.Float64  # mm: since the shell before, or the start
    first: dt.Bool  # there is no shell before
    point: dt.Point3d  # mm: where it crosses the shell
    outward: dt.Bool  # along the shell's normals
    face: dt.UInt32  # row of the triangle in the tables
    triangle: Triangle
    facet: dt.Vector3d  # the triangle's unit normal
    shape: dt.UInt32  # number of the shell
    near: dt.Float64  # index of the layer that it comes from
    far: dt.Float64  # index of the layer that it goes into
    crossed: dt.Bool  # the ray does cross a shell


class AtShells:
    """Snell's law at every shell; between them the rays are straight.

    With `gradient_normals` at the normals interpolated from the vertices, else at the facets'.
    """

    def __init__(self, tables: SceneTables, gradient_normals: bool) -> None:
        self._tables = tables
        self._gradient_normals = gradient_normals

    def start(self, width: int) -> tuple[dt.Array, ...]:
        """What is remembered of rays that have crossed no shell."""
        return ()

    def cross(
        self, memory: tuple[dt.Array, ...], passage: Passage
    ) -> tuple[dt.Vector3d, dt.Bool, tuple[dt.Array, ...]]:
        """Direction (Vector3d) behind a shell, whether it is reflected (Bool), and the memory."""
        shading = None
        if self._gradient_normals:
            normals = self._tables.vertices.normals(passage.face, passage.crossed)
            shading = interpolated_normal(passage.point, passage.triangle, normals, passage.facet)
        ratio = passage.near / passage.far
        bent, reflected = cross_surface(
            passage.direction, passage.facet, shading, ratio, passage.outward
        )
        return bent, reflected, memory

    def end(
        self,
        memory: tuple[dt.Array, ...],
        direction: dt.Vector3d,
        length: dt.Float64,
        facet: dt.Vector3d,
        any_shell: dt.Bool,
    ) -> tuple[dt.Vector3d, dt.Vector3d]:
        """Lateral offset of the last segment's end (Vector3d, mm), and the direction there."""
        return 0 * direction, direction


class Memory(NamedTuple):
    """What :class:`InLayers` remembers of a ray."""

    gradient: dt.Vector3f  # 1/mm: of the index at the last shell
    change: dt.Vector3f  # 1/mm^2: of the gradient along the ray
    index: dt.Float64  # of the air at that shell
    beyond: dt.Float64  # of the layer behind it
    offset: dt.Vector3f  # mm: lateral offset of the ray from the one that is marched
    along: dt.Float64  # mm: how much further along it is, where it crosses the shell's plane

    @property
    def shell(self) -> AtShell:
        """The last shell."""
        return AtShell(self.gradient, self.change, self.index)


class InLayers:
    r"""The ray equation integrated from shell to shell.

    A ray is marched along straight segments and turned at each shell by the deflection of the layer
    before it (:func:`between_shells`). The lateral offsets are added up: the gradient is evaluated
    where the ray really crosses a shell's plane, up to some micrometres away, and the hit on the
    part is there too.

    Before the first shell, and where a ray leaves all of them or comes back, the layer is known
    from one shell only (:func:`outside`), and so it is at the part, at a known distance
    (:func:`beside_part`).

    Snell's law at the shells sees a ray that just touches a shell turned much and one that just
    misses it not at all, so single rays that turn round in the air converge with order 1/2 in the
    number of shells; here the layer is the same for both, and they converge with order 2.

    The tables are of shells that have vertex normals and Hessians.
    """

    def __init__(self, tables: SceneTables) -> None:
        self._tables = tables

    def start(self, width: int) -> tuple[dt.Array, ...]:
        """What is remembered of rays that have crossed no shell."""
        gradient, change, offset = (dr.zeros(mi.Vector3f, width) for _ in range(3))
        index, beyond, along = (dr.zeros(mi.Float64, width) for _ in range(3))
        return gradient, change, index, beyond, offset, along

    def cross(
        self, memory: tuple[dt.Array, ...], passage: Passage
    ) -> tuple[dt.Vector3d, dt.Bool, tuple[dt.Array, ...]]:
        """Direction (Vector3d) behind a shell, whether it is reflected (Bool), and the memory."""
        last = Memory(*memory)
        direction, crossed = passage.direction, passage.crossed
        aside = mi.Vector3d(last.offset)
        along = onto_plane(aside, direction, passage.facet)
        point = passage.point + aside + along * direction
        length = mi.Float(dr.maximum(passage.length + along - last.along, 0))
        # Deflections are small, so single precision will do, which takes half the time.
        heading = mi.Vector3f(direction)
        weights = corner_weights(point, passage.triangle, passage.facet)
        weights = mi.Float(weights[0]), mi.Float(weights[1])
        gradients, changes = self._tables.vertices.gradients(passage.face, heading, crossed)
        here = AtShell(
            between_corners(gradients, weights),
            between_corners(changes, weights),
            self._tables.level(passage.shape, crossed),
        )
        deflection, offset = self._layer(last.shell, here, passage, heading, length)

        ahead = direction + mi.Vector3d(deflection)
        away = dr.select(passage.outward, passage.facet, -passage.facet)
        ahead += dr.maximum(GRAZING - dr.dot(ahead, away), 0) * away
        new = Memory(*here, beyond=passage.far, offset=last.offset + offset, along=along)
        kept = tuple(dr.select(crossed, now, then) for now, then in zip(new, last, strict=True))
        return dr.normalize(ahead), mi.Bool(False), kept

    def _layer(
        self,
        before: AtShell,
        here: AtShell,
        passage: Passage,
        heading: dt.Vector3f,
        length: dt.Float,
    ) -> tuple[dt.Vector3f, dt.Vector3f]:
        """Deflection and lateral offset up to a shell."""
        # The mean direction, which a guess tells, is the same for a ray that runs back.
        mean = weighted_mean(
            heading, transverse(before.gradient + here.gradient, heading) * (length / 2)
        )
        ambient = passage.near == self._ambient
        known = tuple(before), tuple(here), heading, mean, length, passage.near
        # Few segments are of the second kind, which takes longer.
        return dr.if_stmt(
            (known, ambient, passage.first, between_shells(before, here, mean, length)),
            passage.crossed & (passage.first | ambient),
            layer_at_rim,
            lambda _known, _ambient, _first, through: through,
        )

    def end(
        self,
        memory: tuple[dt.Array, ...],
        direction: dt.Vector3d,
        length: dt.Float64,
        facet: dt.Vector3d,
        any_shell: dt.Bool,
    ) -> tuple[dt.Vector3d, dt.Vector3d]:
        """Lateral offset of the last segment's end (Vector3d, mm), and the direction there."""
        last = Memory(*memory)
        aside, heading = mi.Vector3d(last.offset), mi.Vector3f(direction)
        length = length + onto_plane(aside, direction, facet) - last.along
        path, contrast = mi.Float(length), mi.Float(dr.abs(last.beyond - last.index))
        air = last.shell, last.beyond == self._ambient, contrast
        guess, _ = open_layer(*air, heading, path)
        found = open_layer(*air, weighted_mean(heading, guess), path)
        deflection, moment = (mi.Vector3d(vector) for vector in found)
        # What leaves the scene is given by a point at its last shell and the direction far away.
        lever = dr.select(dr.isfinite(length), length, 0)
        offset = aside + deflection * lever - moment
        return (
            dr.select(any_shell, offset, 0),
            dr.select(any_shell, dr.normalize(direction + deflection), direction),
        )

    @property
    def _ambient(self) -> dt.Float64:
        return dr.opaque(mi.Float64, self._tables.ambient)
