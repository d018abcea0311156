"""Scenes whose answer is known in closed form: a layered slab and a hot cylinder.

Both use the law of ideal gas (n - 1 falls as 1/T) between ambient air and a wall at 1100 degC.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from attrs import evolve

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.hessian import radial_derivatives
from iriftrace.medium.shells.levels import index_levels
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.scenes.closed_forms import OUTER_MM as HOT_AIR_RADIUS_MM
from iriftrace.scenes.closed_forms import RADIUS_MM as CYLINDER_RADIUS_MM
from iriftrace.scenes.closed_forms import SLAB_MM, WALL_K


def slab_heights(refractivity: FloatArray, air: Air) -> FloatArray:
    """Heights above the wall at which n - 1 has given values, mm; temperature linear in height."""
    temperature = air.temperature(refractivity)
    return np.asarray((WALL_K - temperature) / (WALL_K - air.temperature_k) * SLAB_MM)


def cylinder_radii(refractivity: FloatArray, air: Air) -> FloatArray:
    """Radii at which n - 1 has given values, mm; temperature linear in the radius' logarithm."""
    share = (WALL_K - air.temperature(refractivity)) / (WALL_K - air.temperature_k)
    ratio = HOT_AIR_RADIUS_MM / CYLINDER_RADIUS_MM
    return np.asarray(CYLINDER_RADIUS_MM * ratio**share)


def slab(
    layers: int = 13, *, air: Air | None = None, size_mm: float = 100.0, rule: str = "rim"
) -> tuple[Part, ShellStack]:
    """A plate under plane layers of hot air: a box below z = 0, and shells parallel to its top.

    Plate and shells are squares of `size_mm`; the rule is that of
    :func:`iriftrace.medium.shells.levels.index_levels`.
    """
    air = air or Air()
    half = size_mm / 2
    square = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
    faces, upwards = np.array([[0, 1, 2], [0, 2, 3]]), np.tile((0.0, 0.0, 1.0), (4, 1))
    surfaces, indices = _levels(layers, air, rule)
    meshes = [
        (np.column_stack((square, np.full(4, height))), faces, upwards)
        for height in slab_heights(surfaces, air)
    ]
    gradients = [((WALL_K - air.temperature_k) / SLAB_MM, np.inf)] * len(meshes)
    box = trimesh.creation.box((size_mm, size_mm, 5.0))
    box.apply_translation((0, 0, -2.5))
    return _part(box), _stack(surfaces, indices, meshes, gradients, air, rule)


def concentric_cylinders(
    layers: int = 13,
    *,
    air: Air | None = None,
    sections: int = 360,
    part_sections: int | None = None,
    length_mm: float = 60.0,
    rule: str = "rim",
) -> tuple[Part, ShellStack]:
    """A hot cylinder in coaxial layers of hot air, both of `length_mm` along x.

    The shells are tubes, open at both ends, with `sections` facets around; the part has
    `part_sections`, by default as many. The rule is that of
    :func:`iriftrace.medium.shells.levels.index_levels`.
    """
    air = air or Air()
    surfaces, indices = _levels(layers, air, rule)
    radii = cylinder_radii(surfaces, air).tolist()
    meshes = [tube(radius, length_mm, sections) for radius in radii]
    rise = (WALL_K - air.temperature_k) / np.log(HOT_AIR_RADIUS_MM / CYLINDER_RADIUS_MM)
    gradients = [(rise / radius, radius) for radius in radii]
    solid = trimesh.creation.cylinder(
        CYLINDER_RADIUS_MM, length_mm, sections=part_sections or sections
    )
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    return _part(solid), _stack(surfaces, indices, meshes, gradients, air, rule)


def _levels(layers: int, air: Air, rule: str) -> tuple[FloatArray, FloatArray]:
    hottest = float(air.refractivity(WALL_K))
    return index_levels(air.ambient_refractivity, hottest, layers, rule)


_Mesh = tuple[FloatArray, IntArray, FloatArray]
"""Vertices, faces and normals at the vertices."""


def _stack(
    surfaces: FloatArray,
    indices: FloatArray,
    meshes: Sequence[_Mesh],
    gradients: Sequence[tuple[float, float]],
    air: Air,
    rule: str,
) -> ShellStack:
    """Shells with the derivatives of the index, from those of the temperature.

    `gradients` are that of the temperature at each shell, K/mm, and the radius there, mm: n - 1 is
    C / T, and T linear in z or in log(r).
    """
    shells = []
    for k, (mesh, (kelvin_per_mm, radius_mm)) in enumerate(zip(meshes, gradients, strict=True)):
        level, ext, inside = float(surfaces[k]), float(indices[k]), float(indices[k + 1])
        shell = Shell(k + 1, level, ext, inside, *mesh)
        if rule != "outer" and shell.normals is not None:
            slope = level / float(air.temperature(level)) * kelvin_per_mm
            bend = 2.0 * slope**2 / level - slope / radius_mm
            found = radial_derivatives(shell.normals, slope, bend, radius_mm, ext - inside)
            shell = evolve(shell, derivatives=found)
        shells.append(shell)
    return ShellStack(shells, air, rule)


def tube(radius: float, length: float, sections: int) -> tuple[FloatArray, IntArray, FloatArray]:
    """A tube along x around the origin, mm, open at both ends, with `sections` facets around.

    Vertices (n, 3), faces (m, 3), which face outward, and the radial unit normals (n, 3).
    """
    angle = 2 * np.pi * np.arange(sections) / sections
    radial = np.column_stack((np.zeros(sections), np.cos(angle), np.sin(angle)))
    end = np.array((length / 2, 0.0, 0.0))
    vertices = np.concatenate((radius * radial - end, radius * radial + end))
    near = np.arange(sections)
    following = (near + 1) % sections
    faces = np.concatenate(
        (
            np.column_stack((following, near + sections, near)),
            np.column_stack((following + sections, near + sections, following)),
        )
    )
    return vertices, faces, np.concatenate((radial, radial))


def _part(mesh: trimesh.Trimesh) -> Part:
    return part_of_mesh(mesh.vertices, mesh.faces, name="iriftrace.scenes.analytic")
