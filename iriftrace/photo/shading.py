r"""Radiance that a camera receives from the hits of its rays, bent or straight.

With the emissivity :math:`\varepsilon` of an opaque, diffuse surface at the hit X

.. math:: L = \varepsilon B(\lambda, T) + \frac{1 - \varepsilon}{\pi}
              \left(E_a + E_0 \, p(u) \frac{z_0^2 \, n \cdot (o - X)}{z^3} v\right)

B is Planck's radiance at the wall's temperature, :math:`E_a` the diffuse irradiance of the room.
The device at o lights X along the bent ray that `lines_of_sight` finds, which leaves it at the
place u of its picture with the pattern p; :math:`v` is 0 where something is in the way. z is the
depth of X in the device's frame: a plane that faces it is lit evenly. Light that reaches X from
other surfaces is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray, IntArray, as_float64
from iriftrace.measuring.two_devices.correct import ON_THE_PART_MM
from iriftrace.measuring.two_devices.two_points import LinesOfSight, lines_of_sight
from iriftrace.photo.appearance import Appearance, planck
from iriftrace.photo.light import Pattern
from iriftrace.tracing.rays import RayEnds, refracted_hits
from iriftrace.tracing.scene import Scene

Temperatures = Callable[[FloatArray], FloatArray]
"""From points (n, 3), mm, to temperatures (n,), K."""

EVERY = 8
"""Neighbouring points of which one is solved; offsets differ little over some pixels."""

GRAZING = 1e-3
"""Least cosine by which footprints are stretched."""


@frozen(eq=False)
class Shading:
    """How one state of a scene is lit and seen."""

    scene: Scene  # of one field
    bent: bool  # rays run through hot air
    wavelength_nm: float
    part: Appearance
    blockers: Appearance
    part_k: Temperatures | None  # None if it does not glow
    blockers_k: Temperatures | None
    ambient: float  # W/(m^2 nm)
    irradiance: float  # W/(m^2 nm): of the second device, in a plane at the part's middle
    patterns: Sequence[Pattern]  # one for each picture; none if the second device is dark

    def hits(self, camera: Camera, pixels: FloatArray | None = None) -> RayEnds:
        """Ends of the rays through places (n, 2), px, by default the pixels' centres."""
        return refracted_hits(self.scene, camera.origin, camera.rays(pixels)[1], bent=self.bent)

    def radiance(self, camera: Camera, pixels: FloatArray, size_px: float) -> FloatArray:
        """Radiance, W/(m^2 sr nm), of places (n, 2), px, in each picture: (pictures, n) array.

        Each place stands for a square of the picture, px, over which edges of a print are blurred.
        """
        ends = self.hits(camera, pixels)
        found = np.zeros((max(len(self.patterns), 1), len(pixels)))
        rows = np.flatnonzero(ends.blocked)
        if len(rows):
            places, ahead = ends.point[rows], np.ones(len(rows))
            # Bodies that only block the view have no normals here, and so no print.
            flat = np.zeros((len(rows), 3))
            emitted = self.blockers.emissivities(places, flat, ahead, np.ones((2, len(rows), 3)))
            found[:, rows] = self._own(emitted, self.blockers_k, places)
        rows = np.flatnonzero((ends.face >= 0) & ~ends.lost)
        if not len(rows):
            return found
        points, normals = ends.point[rows], self._normals(ends, rows)
        cosine = -np.einsum("ij,ij->i", normals, ends.direction[rows])
        footprint = _footprint(camera, points, normals, ends.direction[rows]) * size_px
        emitted = self.part.emissivities(points, normals, cosine, footprint)
        found[:, rows] = self._own(emitted, self.part_k, points)
        if self.patterns:
            places, lit = self.lit(points, normals)
            reflected = (1.0 - emitted) / np.pi * lit
            for picture, pattern in zip(found, self.patterns, strict=True):
                picture[rows] += reflected * pattern(places)
        return found

    def _own(
        self, emissivity: FloatArray, kelvin: Temperatures | None, points: FloatArray
    ) -> FloatArray:
        """Radiance (n,) of points without the second device."""
        own = (1.0 - emissivity) / np.pi * self.ambient
        if kelvin is not None:
            own += emissivity * planck(self.wavelength_nm, kelvin(points))
        return own

    def _normals(self, ends: RayEnds, rows: IntArray) -> FloatArray:
        """Unit normals (m, 3) of the hits of rays (m,), on the camera's side."""
        normals = self.scene.part.face_normals[ends.face[rows]]
        seen_from_behind = np.einsum("ij,ij->i", normals, ends.direction[rows]) > 0.0
        return as_float64(np.where(seen_from_behind[:, None], -normals, normals))

    def places(self, ends: RayEnds) -> FloatArray:
        """Places in the second device's picture, (n, 2), px, that light where rays end.

        -1 where nothing is lit.
        """
        rows = np.flatnonzero(ends.face >= 0)
        found = np.full((len(ends.face), 2), -1.0)
        places, lit = self.lit(ends.point[rows], self._normals(ends, rows))
        found[rows[lit > 0.0]] = places[lit > 0.0]
        return found

    def lit(self, points: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places (n, 2), px, of the second device that light points (n, 3), and irradiances (n,).

        Irradiances, W/(m^2 nm), are those of a white picture; 0, and the place -1, in the shadow.
        """
        device = self.scene.second
        assert device is not None
        places, irradiance = np.full((len(points), 2), -1.0), np.zeros(len(points))
        facing = np.einsum("ij,ij->i", normals, device.origin - points)
        rows = np.flatnonzero(facing > 0.0)
        direction, clear = self._lines(device, points[rows])
        rows, direction = rows[clear], direction[clear]
        seen = device.project(device.origin + direction)
        inside = device.holds(seen)
        rows = rows[inside]
        places[rows] = seen[inside]
        depth = device.to_camera(points[rows])[:, 2]
        middle = device.to_camera(self.scene.part.centre[None])[0, 2]
        irradiance[rows] = self.irradiance * middle**2 * facing[rows] / depth**3
        return places, irradiance

    def _lines(self, device: Camera, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Directions (n, 3) in which a device lights points (n, 3), mm, and the mask of the lit.

        Neighbours are in a row. One in `EVERY` is solved; the others are aimed first where its line
        passes it, which a single trace corrects by what differs. Where that does not end at the
        point, as in shadows and on outlines, it is solved, too.
        """

        def solved(rows: slice | IntArray) -> LinesOfSight:
            return lines_of_sight(self.scene, device.origin, points[rows], bent=self.bent)

        few = solved(slice(None, None, EVERY))
        guess = np.where(few.found[:, None], few.offset, 0.0)
        near = np.repeat(guess, EVERY, axis=0)[: len(points)]
        lines = lines_of_sight(self.scene, device.origin, points, near, rounds=1, bent=self.bent)
        clear = ~lines.lost & (np.abs(lines.residual) <= ON_THE_PART_MM)
        rest = np.flatnonzero(~clear)
        again = solved(rest)
        clear[rest] = again.found & (np.abs(again.residual) <= ON_THE_PART_MM)
        lines.direction[rest] = again.direction
        return lines.direction, clear


def _footprint(
    camera: Camera, points: FloatArray, normals: FloatArray, directions: FloatArray
) -> FloatArray:
    """How far points (n, 3) on faces move over a pixel to the right and down, (2, n, 3), mm."""
    depth = camera.to_camera(points)[:, 2]
    slope = np.minimum(np.einsum("ij,ij->i", normals, directions), -GRAZING)
    moves = []
    for axis, focal in zip(camera.matrix[:3, :2].T, camera.focal_px, strict=True):
        along = np.einsum("ij,j->i", normals, axis) / slope
        moves.append((axis - along[:, None] * directions) * (depth / focal)[:, None])
    return np.array(moves)
