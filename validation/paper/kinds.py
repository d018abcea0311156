"""The studies: the varied quantity of each, and its reference.

Each gets what its cases have in common: a scene whose air is replaced, the fields and the modes.

Against a stack of 20 shells with facet normals, the difference has a local maximum at six shells,
which is not a property of six. By the outer rule shell k of N lies at the fraction k / N of the
index range, so all shells of 4, 5 or 10 are also shells of the 20, with the same facets and the
same errors of these, which cancel. Six is the first number after a dip. Against 24 shells the dips
are at 6, 8 and 12, and against the cells engine, or with gradient normals, there are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.decimate import FEWEST, decimate
from iriftrace.medium.shells.stack import ShellStack
from validation.paper.mode import Mode, check_modes, shells_of
from validation.paper.shell_edits import smooth_taubin, subdivide_midpoint
from validation.paper.split_cells import as_tetrahedra, split_tetrahedra
from validation.paper.study import BY_CELLS, SAME_MODE, Axis, Setup, Study

THE_PAPERS = "20"
"""Shells of the reference of Kern et al. (2025)."""

TETRAHEDRA = " as tetrahedra"
SPLIT = "+"


def layers_study(
    setup: Setup, *, layers: Sequence[int], references: Sequence[str] | None = None
) -> Study:
    """Compare numbers of shells with references.

    By default 20 shells in the case's own mode, as in the paper, and the cells engine.
    Raises InputError if a number of shells is below 1.
    """
    if any(count < 1 for count in layers):
        raise InputError(
            f"{min(layers)} shells refract no ray; give numbers of at least 1.",
            code="validation.no_shell",
        )
    (field,) = setup.fields.values()
    return Study(
        "layers",
        Axis("layers", layers, "number of shells"),
        setup,
        lambda mode, n: shells_of(field, layers[n], mode),
        references=references or (THE_PAPERS, BY_CELLS),
    )


def smoothing_study(
    setup: Setup,
    *,
    iterations: Sequence[int],
    layers: int = 13,
    references: Sequence[str] | None = None,
) -> Study:
    """Compare shells of the first field, smoothed by Taubin's method, with the second field.

    Gradient normals and their derivatives do not change at their vertices, because they belong to
    the field and not to the facets.

    By default the references are the finest field in the case's own mode, as in the paper, and the
    cells engine.
    """
    coarse, _ = setup.fields.values()

    @lru_cache(maxsize=len(setup.modes))
    def unsmoothed(mode: Mode) -> ShellStack | None:
        return setup.shells(coarse, layers, mode, 0)

    def varied(mode: Mode, position: int) -> ShellStack | None:
        stack = unsmoothed(mode)
        return None if stack is None else smoothed(stack, iterations[position])

    return Study(
        "smoothing",
        Axis("iterations", iterations, "Taubin smoothing iterations"),
        setup,
        varied,
        layers=layers,
        references=references or (SAME_MODE, BY_CELLS),
    )


def mesh_study(
    setup: Setup,
    *,
    layers: int = 13,
    split: Sequence[str] = (),
    references: Sequence[str] | None = None,
) -> Study:
    """Compare fields of several resolutions with the last of them, cut at the same levels.

    Fields named in `split` are also contoured after their cells were divided into tetrahedra
    (`TETRAHEDRA` is added to the name), and after these were split into eight (`SPLIT`). Between
    the last two only coplanar triangles are added.

    Raises InputError if there is only one field, or a name to split that is not a field's.
    """
    names, given = list(setup.fields), list(setup.fields.values())
    if len(names) < 2:
        raise InputError(
            "A study of resolutions needs at least two fields, coarse to fine; give another one.",
            code="validation.one_field",
        )
    for name in split:
        if name not in names:
            raise InputError(
                f"There is no field {name} to split; the study has {', '.join(names)}.",
                code="validation.unknown_field",
            )
    cases = [
        (number, suffix)
        for number, name in enumerate(names)
        for suffix in (("", TETRAHEDRA, SPLIT) if name in split else ("",))
    ]

    # A split field can need gigabytes.
    @lru_cache(maxsize=1)
    def cut(position: int) -> IndexField:
        number, suffix = cases[position]
        if not suffix:
            return given[number]
        tetrahedra = as_tetrahedra(given[number])
        return tetrahedra if suffix == TETRAHEDRA else split_tetrahedra(tetrahedra)

    return Study(
        "mesh",
        Axis("field", [names[n] + suffix for n, suffix in cases], "field, coarse to fine"),
        setup,
        lambda mode, n: setup.shells(cut(n), layers, mode, cases[n][0]),
        layers=layers,
        references=references or (SAME_MODE, BY_CELLS),
    )


def rays_study(setup: Setup, *, scales: Sequence[float], layers: int = 13) -> Study:
    """Time the stages of one picture at several factors on the camera's resolution.

    Raises InputError if two scales give the same number of rays.
    """
    (field,) = setup.fields.values()
    cameras = tuple(setup.scene.camera.scaled(scale) for scale in scales)
    rays = [camera.resolution[0] * camera.resolution[1] for camera in cameras]
    if not rays or len(set(rays)) < len(rays):
        raise InputError(
            f"The scales {', '.join(f'{scale:g}' for scale in scales) or 'none'} give "
            f"{', '.join(map(str, rays)) or 'no'} rays; give at least one, each different.",
            code="validation.not_each_once",
        )
    return Study(
        "rays",
        Axis("launched", rays, "rays launched"),
        setup,
        lambda mode, _: shells_of(field, layers, mode),
        layers=layers,
        cameras=cameras,
    )


def polygons_study(
    setup: Setup, *, layers: int = 13, smallest: int = 4_700, largest: int = 320_000
) -> Study:
    """Time the stages of one picture at several numbers of triangles.

    Midpoint subdivision does not move the surfaces, so all but the first step trace the
    same rays through the same air.

    Shells begin with a mean of `smallest` triangles, by default as Kern et al. (2025), for which
    they are reduced, and are divided while they have no more than `largest` (4.8 million in
    Kern et al.). Raises InputError if the limits are not in order.
    """
    if not FEWEST <= smallest <= largest:
        raise InputError(
            f"Triangles of a shell from {smallest} to {largest} are not a range; give at least "
            f"{FEWEST} and then more.",
            code="validation.no_range",
        )
    check_modes(setup.modes, 1, layers)
    (field,) = setup.fields.values()

    @lru_cache(maxsize=len(setup.modes))
    def start(mode: Mode) -> ShellStack | None:
        stack = shells_of(field, layers, mode)
        return None if stack is None else decimate(stack, smallest * len(stack.shells))

    def divided(mode: Mode, position: int) -> ShellStack | None:
        stack = start(mode)
        return None if stack is None else subdivide_midpoint(stack, position)

    first, steps = start(setup.modes[0]), 0.0
    if first is not None:
        steps = np.log(largest * len(first.shells) / first.triangles) / np.log(4) + 1e-9
    return Study(
        "polygons",
        Axis("subdivisions", range(max(0, int(steps)) + 1), "midpoint subdivisions"),
        setup,
        divided,
        layers=layers,
        more={"smallest": smallest},
    )


def smoothed(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth the surfaces; each vertex keeps the gradient that it had."""
    changed = smooth_taubin(stack, iterations)
    shells = [
        evolve(after, normals=before.normals, derivatives=before.derivatives)
        for before, after in zip(stack.shells, changed.shells, strict=True)
    ]
    return evolve(changed, shells=shells)
