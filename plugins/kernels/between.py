"""Bending between two shells, and between a shell and the part."""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from iriftrace.plugins.kernels import types as dt

DIRECTION_ERROR = 0.3
"""Error of a recovered gradient's direction (rad, about each axis) over that of its length
(relative).

Recovery from cells gives directions better than lengths, which cells that grow along the gradient
spoil. For a temperature known by formula at the points of the cylinder's meshes A, C and D the
ratio is 0.1 to 0.6 on the shells of the outer layers; see the accuracy page.
"""


LEAST_COSINE = 1e-3
"""A ray at a smaller angle to a plane than this (rad) is not moved back onto it: if it is off the
plane by a micrometre, it would be moved along by more than a millimetre."""


def transverse(vector: dt.Vector, direction: dt.Vector) -> dt.Vector:
    """The part of a vector at right angles to a unit direction."""
    return vector - direction * dr.dot(vector, direction)


def onto_plane(offset: dt.Vector3d, direction: dt.Vector3d, facet: dt.Vector3d) -> dt.Float64:
    """Distance along a ray (Float64, mm) that moves a point near a plane back onto it.

    The offset (Vector3d, mm) is from a point of the plane; direction and facet are unit vectors.
    """
    cosine = dr.dot(direction, facet)
    # Where there is no plane, its normal is NaN.
    crosses = dr.abs(cosine) > LEAST_COSINE
    return dr.select(crosses, -dr.dot(offset, facet) / cosine, 0)


def length_gain(cosine: dt.Real) -> dt.Real:
    r"""Factor for the error of a gradient's length, given that of its component along a ray.

    Let a recovered gradient have independent errors: :math:`\sigma` along itself (of its length)
    and :math:`\varepsilon\sigma` along each axis across itself (of its direction). If its component
    along the ray is too small by r, the best linear unbiased estimate of the error of its length is
    r times (Gauss and Markov; Plackett, Biometrika 36 (1949) 458)

    .. math:: \frac{c}{c^2 + \varepsilon^2 (1 - c^2)}

    with the cosine c between ray and gradient.
    """
    squared = cosine * cosine
    return cosine / (squared + DIRECTION_ERROR * DIRECTION_ERROR * (1 - squared))


def fading_length(
    gradient: dt.Vector, change: dt.Vector, contrast: dt.Real, direction: dt.Vector
) -> dt.Real:
    r"""Way over which the air outside the shells turns a ray as much as at the last of them, mm.

    Along the ray the index approaches that of the layer outside as
    :math:`u(s) = u_0 \exp(-a s - b s^2)`, with the slope of n along the ray,
    :math:`a u_0 = |g \cdot t|`, and with b from how the layer curves away from the ray,
    :math:`2 b u_0 = t \cdot (g')_{\perp g}`. The length is

    .. math:: \int_0^\infty e^{-a s - b s^2} ds \approx
              \frac{2}{a + \sqrt{a^2 + 16 b / \pi}}

    which is exact for a = 0 and for b = 0 (Abramowitz and Stegun 7.1.13). Given are g, 1/mm, and
    g', its change per length along the ray, 1/mm^2, the contrast :math:`u_0` between the index at
    the shell and that of the layer, and the unit direction t.
    """
    steep = dr.dot(gradient, direction)
    along = dr.dot(gradient, change) / dr.squared_norm(gradient)
    curving = dr.maximum(dr.dot(change - gradient * along, direction), 0)
    sharp = dr.abs(steep) + dr.sqrt(steep * steep + (8 / dr.pi) * contrast * curving)
    return dr.select(sharp > 0, 2 * contrast / sharp, 0)


class AtShell(NamedTuple):
    """The air at a shell, as a ray sees it."""

    gradient: dt.Vector  # g, 1/mm
    change: dt.Vector  # g' = H t, 1/mm^2
    index: dt.Float64  # n


def between_shells(
    before: AtShell, here: AtShell, direction: dt.Vector, length: dt.Real
) -> tuple[dt.Vector, dt.Vector]:
    """Deflection (vector, rad) between two shells, and lateral offset (mm) at the second one.

    The offset is that of the same cubic; the correction counts as if it lay in the middle. The
    length, mm, is that of the segment from one to the other along the unit direction.
    """
    squared = length * length
    total = (before.gradient + here.gradient) * (0.5 * length)
    total += (before.change - here.change) * (squared / 12)
    moment = (7 * before.gradient + 3 * here.gradient) * (squared / 20)
    moment += (3 * before.change - 2 * here.change) * (squared * length / 60)

    size = dr.norm(total)
    axis = dr.select(size > 0, total / size, 0)
    lacking = type(length)(here.index - before.index) - dr.dot(total, direction)
    correction = axis * (lacking * length_gain(dr.dot(axis, direction)))
    index = type(length)(0.5 * (here.index + before.index))
    deflection = transverse(total + correction, direction) / index
    offset = transverse(moment + correction * (0.5 * length), direction) / index
    return deflection, offset


def beside_part(
    shell: AtShell, direction: dt.Vector, length: dt.Real
) -> tuple[dt.Vector, dt.Vector]:
    """Deflection (vector, rad) between a shell and the part, and its first moment about the shell.

    By Taylor's series of the gradient, along a unit direction from the shell to the part and a
    length, mm; for a ray from the part to a shell the direction and the shell's `change` are
    reversed. The moment, mm, is the deflection times its mean distance from the shell.
    """
    first, second = shell.gradient * length, shell.change * (length * length)
    index = type(length)(shell.index)
    deflection = transverse(first + second / 2, direction) / index
    return deflection, transverse(first / 2 + second / 3, direction) * (length / index)


def stays_in_layer(
    shell: AtShell, contrast: dt.Real, direction: dt.Vector, length: dt.Real
) -> dt.Bool:
    """True for segments along which Taylor's series neither leaves a layer nor turns over.

    Other segments, of which only the length is known, began outside the data. Parameters as for
    :func:`outside`; a layer reaches to the next shell, twice the contrast away.
    """
    linear = dr.dot(shell.gradient, direction) * length
    square = dr.dot(shell.change, direction) * (length * length / 2)
    within = dr.abs(linear + square) <= 2 * contrast
    return within & (dr.norm(shell.change) * (length / 2) <= dr.norm(shell.gradient))


def outside(
    shell: AtShell, contrast: dt.Real, direction: dt.Vector, length: dt.Real
) -> tuple[dt.Vector, dt.Vector]:
    """Deflection (vector, rad) in air whose other end is not known, and its first moment, mm.

    The moment is the deflection times its mean distance from the shell, and the contrast the index
    at the shell less that of the layer outside. The length, mm, is that of the ray's path in this
    air: to the camera, the part, or half of that to the next crossing.
    """
    fading = fading_length(shell.gradient, shell.change, contrast, direction)
    path = dr.minimum(length, fading)
    deflection = transverse(shell.gradient, direction) * (path / type(length)(shell.index))
    return deflection, deflection * dr.minimum(0.5 * length, fading)


def open_layer(
    shell: AtShell, ambient: dt.Bool, contrast: dt.Real, direction: dt.Vector, length: dt.Real
) -> tuple[dt.Vector, dt.Vector]:
    """Deflection, and its moment, in a layer with one shell, along a ray that leaves that.

    The layer is that of the `ambient` air (Bool) or another.
    """
    inside = ~ambient & stays_in_layer(shell, contrast, direction, length)
    there = beside_part(shell, direction, length)
    beyond = outside(shell, contrast, direction, length)
    return tuple(dr.select(inside, a, b) for a, b in zip(there, beyond, strict=True))


def layer_at_rim(
    known: dt.Struct, ambient: dt.Bool, first: dt.Bool, _through: dt.Struct
) -> tuple[dt.Vector, dt.Vector]:
    """Deflection and lateral offset to a ray's first shell, or from shell to shell outside all."""
    before, here, heading, mean, length, near = known
    before, here = AtShell(*before), AtShell(*here)
    contrast = type(length)(dr.abs(near - here.index))
    reverse = here._replace(change=-here.change)
    guess, _ = open_layer(reverse, ambient, contrast, -heading, length)
    start = open_layer(reverse, ambient, contrast, -weighted_mean(heading, guess), length)
    # Out into the ambient air and back: nothing says what lies between but the two ends.
    coming = outside(here, contrast, mean, 0.5 * length)
    leaving = outside(before, contrast, mean, 0.5 * length)
    gap = leaving[0] + coming[0], leaving[0] * length - leaving[1] + coming[1]
    return tuple(dr.select(first, a, b) for a, b in zip(start, gap, strict=True))


def weighted_mean(heading: dt.Vector, deflection: dt.Vector) -> dt.Vector:
    """Mean direction of a segment that begins with a unit direction and is deflected."""
    return dr.normalize(heading + deflection / 2)
