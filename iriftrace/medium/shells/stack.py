"""Shells and stacks of shells: surfaces of equal refractive index between layers of air."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from attrs import field, frozen
from attrs.converters import optional
from numpy.typing import ArrayLike

from iriftrace.core.arrays import AnyIntArray, Float32Array, FloatArray
from iriftrace.core.errors import InputError
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.hessian import DERIVATIVES
from iriftrace.medium.shells.levels import RULES
from iriftrace.medium.shells.table import AirStatement, ShellRow, SmallComponents
from iriftrace.medium.source import FieldSource

KINDS = (*RULES, "custom", "imported")


def _float32(values: ArrayLike) -> Float32Array:
    return np.ascontiguousarray(values, dtype=np.float32).reshape(-1, 3)


def _rows(values: ArrayLike) -> Float32Array:
    return np.ascontiguousarray(values, dtype=np.float32)


def _shells(values: Iterable[Shell]) -> tuple[Shell, ...]:
    return tuple(values)


def _components(values: Iterable[SmallComponents]) -> tuple[SmallComponents, ...]:
    return tuple(values)


def _int32(values: ArrayLike) -> AnyIntArray:
    return np.ascontiguousarray(values, dtype=np.int32).reshape(-1, 3)


@frozen(eq=False)
class Shell:
    """One surface between two layers of air.

    Parameters
    ----------
    layer : int
        Number of the level, 1 = outermost.
    refractivity : float
        n - 1 of the air at the surface.
    ext, int_ : float
        n - 1 of the layers outside and inside (the side of the hotter air).
    vertices : (n, 3) array of float32, mm, world
    faces : (m, 3) array of int32
        Counter-clockwise seen from outside, so facet normals point to the ``ext`` side.
    normals : (n, 3) array of float32 or None, world
        Unit vectors at the vertices along +grad(n), that is outward. None: only facet normals.
    derivatives : (n, 7) array of float32 or None, 1/mm and 1/mm^2, world
        Magnitude of grad(n) at the vertices and the Hessian of n (xx, yy, zz, yz, xz, xy), all over
        the shell's step ``ext - int_``, by which rays are bent all along the layers. None: rays are
        bent at this shell alone.

    Raises
    ------
    InputError
        If the surface is empty, a face names no vertex, or a coordinate is not finite.
    """

    layer: int
    refractivity: float
    ext: float
    int_: float
    vertices: Float32Array = field(converter=_float32, repr=False)
    faces: AnyIntArray = field(converter=_int32, repr=False)
    normals: Float32Array | None = field(default=None, converter=optional(_float32), repr=False)
    derivatives: Float32Array | None = field(default=None, converter=optional(_rows), repr=False)

    def __attrs_post_init__(self) -> None:
        vertices, faces, normals = self.vertices, self.faces, self.normals
        if not np.isfinite(vertices).all():
            raise InputError(
                f"Shell {self.layer} has a vertex that is not finite, so no ray can cross it; "
                "check the field's points.",
                code="shells.not_finite",
            )
        if len(faces) == 0:
            raise InputError(
                f"Shell {self.layer} has no triangle; leave it out of the stack.",
                code="shells.no_triangles",
            )
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise InputError(
                f"Shell {self.layer} has a triangle with vertex number {faces.max()}, but only "
                f"{len(vertices)} vertices; the mesh is damaged.",
                code="shells.vertex_number",
            )
        if normals is not None and len(normals) != len(vertices):
            raise InputError(
                f"Shell {self.layer} has {len(normals)} normals for {len(vertices)} vertices; give "
                "one each or none.",
                code="shells.normal_count",
            )
        derivatives, expected = self.derivatives, (len(vertices), DERIVATIVES)
        if derivatives is not None and (normals is None or derivatives.shape != expected):
            raise InputError(
                f"Shell {self.layer} has derivatives of shape {derivatives.shape} for "
                f"{len(vertices)} vertices, or no normals; give {DERIVATIVES} numbers and a normal "
                "for each vertex, or no derivatives.",
                code="shells.derivative_count",
            )

    @property
    def off_the_middle(self) -> bool:
        """True if the air on the surface is not that midway between its two sides."""
        middle = 0.5 * (self.ext + self.int_)
        return abs(self.refractivity - middle) > 1e-9 * abs(self.ext - self.int_)


@frozen(eq=False)
class ShellStack:
    """Shells of one field, outermost first.

    Parameters
    ----------
    shells : tuple of Shell
    air : Air
        Relates refractivity and temperature.
    rule : str
        How surfaces and layers were chosen: one of `iriftrace.medium.shells.levels.RULES`,
        ``"custom"`` or ``"imported"``.
    source : FieldSource or None
        The file of the shells, if there is one.
    small_components : tuple of SmallComponents
        Components that were removed for their size.
    """

    shells: tuple[Shell, ...] = field(converter=_shells)
    air: Air
    rule: str
    source: FieldSource | None = None
    small_components: tuple[SmallComponents, ...] = field(default=(), converter=_components)

    def __attrs_post_init__(self) -> None:
        if not self.shells:
            raise InputError(
                "A shell stack without shells bends no ray; give at least one level.",
                code="shells.none",
            )
        if self.rule not in KINDS:
            raise InputError(
                f"Unknown index rule '{self.rule}'; use one of {', '.join(KINDS)}.",
                code="shells.unknown_rule",
            )

    def __repr__(self) -> str:
        kelvin = self.temperature_k
        return (
            f"ShellStack({len(self.shells)} shells, {self.triangles:,} triangles, "
            f"{kelvin.min():.5g} to {kelvin.max():.5g} K, rule {self.rule})"
        )

    @property
    def triangles(self) -> int:
        """Number of triangles of all shells."""
        return sum(len(shell.faces) for shell in self.shells)

    @property
    def temperature_k(self) -> FloatArray:
        """(shells,) array, K: temperature of the air at each surface."""
        values = np.array([shell.refractivity for shell in self.shells])
        return np.asarray(self.air.temperature(values), dtype=np.float64)

    @property
    def has_normals(self) -> bool:
        """True if every shell has the direction of grad(n) at its vertices."""
        return all(shell.normals is not None for shell in self.shells)

    def stated(self, notes: Mapping[str, str]) -> AirStatement:
        """Content of the table next to the shells' files, except the files."""
        rows = tuple(
            ShellRow(s.layer, s.refractivity, s.ext, s.int_, kelvin, len(s.faces))
            for s, kelvin in zip(self.shells, self.temperature_k.tolist(), strict=True)
        )
        return AirStatement(
            rule=self.rule,
            air=self.air,
            source=self.source,
            notes=dict(notes),
            small_components=self.small_components,
            shells=rows,
        )
