"""How rays are bent between a scene's shells: at each of them, or all along the layers.

Both rules are told of every shell that a ray crosses, and of the end of its way. They hold what
they need to remember of a ray in a tuple of Dr.Jit arrays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from iriftrace.plugins.kernels.snell import (
    GRAZING,
    Triangle,
    between_corners,
    corner_weights,
    cross_surface,
    interpolated_normal,
)
from iriftrace.plugins.kernels.tables import SceneTables
from iriftrace.shells.hessian import FASTEST, SLOWEST

# MERGE plugins.layer_turn: By how much a ray turns in the air between two shells, from the gradie

LEAN = 0.3
"""Cosine between ray and gradient below which a layer's turn follows the gradient's length.

Above it the index's known change decides. Real fields are noisy: in straight rays through the
wishbone's field, 0.15 and 0.6 make the 95th percentile of the errors of 13 layers 1.4 and 1.2 times
as large as 0.3 does.
"""

ALIKE = 8
"""Power of the likeness of the gradients' directions at a layer's two ends, by which the layer's
step of the index is trusted to tell the gradient's length.

In straight rays through the bevel gear's and the wishbone's fields, at their scenes' poses, 4 makes
the 95th percentile of the errors of 13 layers 1.07 and 1.1 times as large as 8 does, 16 makes it
0.96 and 0.97 times; in the wishbone's plume 4 makes it 0.99 to 1.12 times, on the cylinders it
hardly matters."""

MOST_CHANGE = 2.0
"""By how many times the larger gradient of both ends the gradient may change within half a layer;
what says more is noise of the cells, seen over a way much longer than they are."""

LITTLE_CHANGE = 0.2
"""Most change of the gradient, in its own lengths, in the layer at the part."""

TURNING_STEPS = 3.0
"""A ray that comes back to a shell may have met air this many half steps beyond it; where the
gradients say more, the air is even in between, as in the gap between two boundary layers."""

LEAST_COSINE = 0.02
"""Cosine with which the air beyond the last shell is left at least, for rays that graze it.

Straight down a plume (hybrid, 13 shells) 0.07 takes 38 % off the median displacement, 0.02 nothing.
"""

MOST_SLOPE = 1000.0
"""A ray that grazes a plane is not brought back onto it from further away than this, times how far
it lies beside."""

MOST_TILT = 0.3
"""Most turn of the gradient's direction on the way out to the ambient, in radians."""

NOT_NOISE = 0.25
"""Share of a tilt's part along the ray by which the gradient is taken to be shorter."""

ELSEWHERE = 4.0
"""A way that is longer than this times the one over which a layer fades is not all in the layer."""


def onto_plane(aside: Any, direction: Any, facet: Any) -> Any:
    """Way along a ray (Float64, mm) that brings a point beside it back onto a plane.

    Parameters
    ----------
    aside : Vector3d, mm
        From a point of the plane.
    direction, facet : Vector3d
        Unit direction of the ray and unit normal of the plane.
    """
    import drjit as dr

    cosine = dr.dot(direction, facet)
    # Where there is no plane, its normal is NaN.
    exists = dr.abs(cosine) > 0
    slope = dr.clip(1 / cosine, -MOST_SLOPE, MOST_SLOPE)
    return dr.select(exists, -dr.dot(aside, facet) * slope, 0)


def telescoping(cosine: Any) -> Any:
    """Share of what the index's change along a ray lacks by which its gradient is made longer.

    From 1 for rays along the gradient to 0 for those across it, times 1 / cosine.
    """
    squared = cosine * cosine
    return cosine / (squared + LEAN * LEAN * (1 - squared))


def _across(vector: Any, direction: Any) -> Any:
    """The part of a vector at right angles to a unit direction."""
    import drjit as dr

    return vector - direction * dr.dot(vector, direction)


def _over(vector: Any, length: Any) -> Any:
    """A vector or number divided by a length; zero where that is."""
    import drjit as dr

    return dr.select(length > 0, vector / length, 0)


class Slope(NamedTuple):
    """Gradient of the index at a shell, and how it changes along the ray."""

    pull: Any  # vector, 1/mm
    change: Any  # vector, 1/mm^2: per way along the ray
    steep: Any  # number, 1/mm: length of the gradient
    unit: Any  # vector: its direction


def slope_of(pull: Any, change: Any) -> Slope:
    """A gradient (vector, 1/mm) and its change (vector, 1/mm^2) with length and direction."""
    import drjit as dr

    steep = dr.norm(pull)
    return Slope(pull, change, steep, _over(pull, steep))


def _at_most(vector: Any, length: Any) -> Any:
    """A vector, made as short as a length where it is longer."""
    import drjit as dr

    return vector * dr.minimum(1, _over(length, dr.norm(vector)))


def outside(
    slope: Slope, level: Any, layer: Any, ambient: Any, direction: Any, length: Any, sense: int
) -> tuple[Any, Any]:
    """Turn in the air between a shell and what has no shell: the ambient, the part, the camera.

    Parameters
    ----------
    slope : Slope
        At the shell.
    level, layer, ambient : Float64
        Index at the shell, of the layer and of the air outside.
    direction : vector
        Unit direction of the ray.
    length : number, mm
        Of its way in the layer.
    sense : int
        1 for rays that leave the shell, -1 for those that come to it.

    Returns
    -------
    turn : vector
    aside : vector, mm
        The turn times the mean way from the shell.
    """
    import drjit as dr

    lean = dr.dot(slope.unit, direction)
    cosine = dr.abs(lean)
    number = type(cosine)
    half_step = number(dr.abs(layer - level))
    shallow = number(dr.abs(layer - ambient)) < 1e-3 * half_step
    index = number(level)
    # Towards the ambient n fades as exp(-a s - b s^2); b tells how the shells curve away from the
    # ray. The integral's approximation is exact for a = 0 and for b = 0.
    bending = dr.dot(slope.unit, slope.change)
    turning = slope.change - slope.unit * bending
    curving = dr.maximum(dr.dot(turning, direction), 0)
    a, b = slope.steep * cosine, 0.5 * half_step * curving
    faded = _over(2 * half_step, a + dr.sqrt(a * a + (16 / dr.pi) * b))
    # Rays across the layer at the part end at its index, those along it get as far as the next
    # shell's (at a round wall the way grows from one to the other about so); and a way much longer
    # than that began elsewhere, where the data have an open end.
    fading = _over(half_step, slope.steep * dr.maximum(cosine, LEAST_COSINE))
    fading = dr.select(shallow, faded, fading)
    widest = fading * dr.select(shallow, 1, 2 - cosine**3)
    way = dr.select(length > ELSEWHERE * fading, fading, dr.minimum(length, widest))
    mean = dr.minimum(0.5 * length, fading)

    # What the outermost shell's derivatives say of all the air outside; see `iriftrace.outer_air`.
    share = dr.select(shallow, cosine * telescoping(cosine), 0)
    tilt = _at_most(turning * (sense * mean), MOST_TILT * slope.steep) * share
    # A tilt along the ray adds to what the index changes by, which is known.
    gained = _over(dr.dot(turning, direction) * mean, slope.steep) * telescoping(cosine)
    strength = 1 - dr.clip(gained, -MOST_TILT, MOST_TILT) * (share * NOT_NOISE)
    straight = _over(a * faded, half_step)
    mean *= 1 + dr.select(shallow, (2 / dr.pi - 1) * (1 - straight * straight), 0)
    bending = dr.select(lean < 0, half_step, -half_step) * bending
    slowness = dr.clip(_over(bending, a * slope.steep), FASTEST, SLOWEST)
    mean *= 1 + share * (1 / (2 - slowness) - 1)
    # Near the part the gradient changes linearly; far outside the cells' noise would do harm.
    change = _at_most(_across(slope.change * (0.5 * way), direction), LITTLE_CHANGE * slope.steep)
    changed = dr.select(shallow, 0, sense * change)
    pull, tilted = _across(slope.pull, direction) * strength, _across(tilt, direction)
    way /= index
    turn = (pull + tilted + changed) * way
    return turn, (pull + 2 * tilted + (4 / 3) * changed) * (way * mean)


class Layer(NamedTuple):
    """The air between two crossings of shells."""

    before: Slope
    here: Slope
    level_before: Any  # Float64: index at the shell before
    level_here: Any  # Float64
    layer: Any  # Float64: index of the layer in between
    ambient: Any  # Float64

    def coming(self, direction: Any, length: Any) -> tuple[Any, Any]:
        """Turn before the shell, as :func:`outside`."""
        return outside(self.here, self.level_here, self.layer, self.ambient, direction, length, -1)

    def leaving(self, direction: Any, length: Any) -> tuple[Any, Any]:
        """Turn behind the shell before, as :func:`outside`."""
        before, level = self.before, self.level_before
        return outside(before, level, self.layer, self.ambient, direction, length, 1)

    def through(self, direction: Any, length: Any) -> tuple[Any, Any, Any]:
        """Turn (vector), how far the way ends aside (mm), and by how much the index rises.

        By Hermite's cubic through the gradients and their changes at both ends, whose integral is
        that of Simpson's rule with its middle. The rise is that of the index in the middle over the
        mean of both ends, by Hermite's quintic.
        """
        import drjit as dr

        before, here = self.before, self.here
        squared = length * length
        most = dr.maximum(before.steep, here.steep) * (2 * MOST_CHANGE)
        first = _at_most(before.change * length, most)
        second = _at_most(here.change * length, most)
        middle = 0.5 * (before.pull + here.pull) + 0.125 * (first - second)
        total = (before.pull + 4 * middle + here.pull) * (length / 6)

        steep = dr.norm(middle)
        mean = _over(middle, steep)
        likeness = 0.5 * dr.norm(before.unit + here.unit)
        cosine = dr.dot(mean, direction)
        share = telescoping(cosine) * likeness**ALIKE
        step = type(cosine)(self.level_here - self.level_before)
        missing = mean * (share * (step - dr.dot(total, direction)))
        index = type(cosine)(0.5 * (self.level_here + self.level_before))
        turn = _across(total + missing, direction) / index
        arm = (7 * before.pull + 3 * here.pull) * (squared / 20)
        arm += (3 * first - 2 * second) * (squared / 60) + missing * (0.5 * length)
        rise = (5 / 32) * dr.dot(before.pull - here.pull, direction) * length
        rise += (1 / 64) * dr.dot(first + second, direction) * length
        return turn, _across(arm, direction) / index, rise

    def turn(self, direction: Any, length: Any, first: Any) -> tuple[Any, Any]:
        """Turn (vector) on the way to the shell, and how far the way ends aside (mm)."""
        import drjit as dr

        turn, aside, rise = self.through(direction, length)
        # The gap between two boundary layers: each of them fades for itself. Nothing but that is
        # known of the air outside the outermost shell.
        half = 0.5 * length
        behind = self.leaving(direction, half)
        ahead = self.coming(direction, dr.select(first, length, half))
        gap = self.level_here == self.level_before
        half_step = dr.abs(self.layer - self.level_here)
        ambient = dr.abs(self.layer - self.ambient) < 1e-3 * half_step
        gap &= ambient | (dr.abs(rise) > TURNING_STEPS * type(rise)(half_step))
        turn = dr.select(gap, behind[0] + ahead[0], turn)
        aside = dr.select(gap, behind[0] * length - behind[1] + ahead[1], aside)
        return dr.select(first, ahead[0], turn), dr.select(first, ahead[1], aside)


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
    outermost shell's derivatives say (`iriftrace.shells.hessian`). In other layers, such as that
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
