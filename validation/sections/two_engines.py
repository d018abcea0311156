"""Agreement of the two engines on simulated fields: what shells leave of the same cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iriftrace.image.aov_image import AovImage, Status
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.part.part import Part
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.write import write_scene
from scenes.generators.components import COMPONENTS
from validation.curves import draw_convergence
from validation.inputs.solved_fields import SOLVED, VIEWS, Position, camera_at, in_tetrahedra
from validation.line import Line, Section

LAYERS = (5, 9, 13, 20, 40)
USUAL_SHELLS = 13
NORMALS = ("gradient", "facet")
LIMITS = {"gradient": "recovered gradient", "facet": "constant gradient"}
PICTURE = "engines.png"
PLUME = ("corner", "45 degrees above", "oblique")
"""Views of the wishbone from above, through its plume."""

FIELDS: dict[str, dict[str, Position]] = {
    "cylinder": {"corner": VIEWS["corner"]},
    **{name: {"own pose": component.origin_mm} for name, component in COMPONENTS.items()},
}
FIELDS["wishbone"] |= {f"plume, {view}": VIEWS[view] for view in PLUME}

FloatArray = NDArray[np.float64]
Images = dict[tuple[int | str, str], AovImage]
"""By number of shells, or ``"cells"``, and normals."""


def pictures(
    folder: Path,
    field: IndexField,
    part: Part,
    views: Mapping[str, Position],
    layers: Sequence[int],
    *,
    source: IndexField | None = None,
    normals: str = "gradient",
    limits: Sequence[str] = NORMALS,
) -> dict[str, Images]:
    """Images of each view by shells and by the field, from which the shells are cut by default.

    `normals` are those of the shells, `limits` the engine's gradients.
    """
    cameras = {view: camera_at(position) for view, position in views.items()}
    found: dict[str, Images] = {view: {} for view in views}
    for count in layers:
        first = count == layers[0]
        xml = write_scene(
            folder / str(count),
            part,
            AirState(field if first else None, ready=contour_shells(source or field, count)),
            next(iter(cameras.values())),
            paraview=False,
        )
        engines = [("shells", count, normals)]
        engines += [("cells", "cells", limit) for limit in limits if first]
        # One scene at a time, because many shells of fine cells take gigabytes.
        for engine, key, kind in engines:
            scene = load_scene(xml, {"normals": kind}, engine=engine)
            for view, camera in cameras.items():
                image = pose_image(scene, camera=camera)
                found[view][key, kind] = image
    return found


def displacements(images: Images) -> tuple[dict[tuple[int | str, str], FloatArray], int]:
    """Displacements of the n rays that are good in all images, (n, 3), um; and how many in some."""
    good = np.all([image.status == Status.GOOD for image in images.values()], axis=0)
    some = np.any([image.status == Status.GOOD for image in images.values()], axis=0)
    vectors = {key: image.vector("displacement", good) * 1e3 for key, image in images.items()}
    return vectors, int(some.sum() - good.sum())


def ratios_of_quantiles(found: FloatArray, exact: FloatArray) -> FloatArray:
    """Median and p95 of the differences over those of the displacements, per cent."""
    off, size = np.linalg.norm(found - exact, axis=1), np.linalg.norm(exact, axis=1)
    return 100 * np.quantile(off, (0.5, 0.95)) / np.quantile(size, (0.5, 0.95))


def ray_by_ray(found: FloatArray, exact: FloatArray) -> FloatArray:
    """Median and p95 of each ray's difference over its own displacement, per cent."""
    off, size = np.linalg.norm(found - exact, axis=1), np.linalg.norm(exact, axis=1)
    return 100 * np.quantile(off[size > 0] / size[size > 0], (0.5, 0.95))


def in_short(shares: FloatArray) -> str:
    """Median and p95 as they are printed."""
    return " / ".join(f"{share:.3g} %" for share in shares)


def convergence(folder: Path) -> list[Line]:
    """Each kind of normals against its own limit, with more and more shells of one field."""
    field, part = SOLVED["cylinder_A"].field(folder), SOLVED["cylinder_A"].part
    # The engine splits the solver's hexahedra, in whose own surfaces facets have other slopes.
    cut = {"gradient": field, "facet": in_tetrahedra(field)}
    shares: dict[str, dict[str, list[FloatArray]]] = {normals: {} for normals in NORMALS}
    for normals, source in cut.items():
        images = pictures(
            folder / normals,
            field,
            part,
            VIEWS,
            LAYERS,
            source=source,
            normals=normals,
            limits=(normals,),
        )
        for view, by_layers in images.items():
            vectors, _ = displacements(by_layers)
            exact = vectors["cells", normals]
            shares[normals][view] = [
                ratios_of_quantiles(vectors[layers, normals], exact) for layers in LAYERS
            ]
    panels = {
        f"{normals} normals, to the {LIMITS[normals]}": {
            view: (LAYERS, [float(median) for median, _ in found])
            for view, found in shares[normals].items()
        }
        for normals in NORMALS
    }
    across, up = "number of shells", "median difference over median displacement / %"
    draw_convergence(folder / PICTURE, panels, across, up, 1)
    return [
        Line(
            f"cylinder A, {view}: {', '.join(map(str, LAYERS))} shells, {normals} normals, to the "
            f"{LIMITS[normals]}, ratios of quantiles",
            "0",
            ", ".join(in_short(share) for share in shares[normals][view]),
        )
        for normals in NORMALS
        for view in VIEWS
    ]


def of_one_view(case: str, images: Images) -> list[Line]:
    """Distances of shells from the engine, and of its two readings of the cells."""
    vectors, unmatched = displacements(images)
    exact, shells = vectors["cells", "gradient"], vectors[USUAL_SHELLS, "gradient"]
    size = np.quantile(np.linalg.norm(exact, axis=1), (0.5, 0.95))
    left_open = ratios_of_quantiles(vectors["cells", "facet"], exact)
    share = ratios_of_quantiles(shells, exact)
    what = f"{case}: {USUAL_SHELLS} shells"
    return [
        Line(
            f"{case}: displacement, median / p95, of the rays good in all pictures (in some only)",
            "",
            f"{size[0]:.3g} / {size[1]:.3g} µm, {len(exact):,} ({unmatched})",
        ),
        Line(f"{case}: the engine's two gradients, ratios of quantiles", "", in_short(left_open)),
        Line(f"{what}, ray by ray", "0", in_short(ray_by_ray(shells, exact))),
        Line(
            f"{what}, ratios of quantiles; the larger over the two gradients'",
            "0",
            in_short(share),
            float(100 * (share / left_open).max()),
            100.0,
        ),
    ]


def _lines(folder: Path) -> list[Line]:
    lines = convergence(folder)
    for name, views in FIELDS.items():
        place = folder / name
        place.mkdir()
        solved = SOLVED[name]
        found = pictures(place, solved.field(place), solved.part, views, (USUAL_SHELLS,))
        for view, images in found.items():
            lines += of_one_view(f"{name.replace('_', ' ')}, {view}", images)
    return lines


SECTION = Section(
    "engines",
    "Two engines, one field",
    "Shells against the ray equation solved from cell to cell (`--engine cells`), both from "
    "the same cells: what shells leave, and no accuracy, since both take their gradients from "
    "these cells. Ratios of quantiles are the median (and the 95th percentile) of the differences "
    "over the median (95th percentile) of the displacements; ray by ray each difference is "
    "divided by the ray's own displacement, so that rays that hardly move count as much as "
    "others. Shells with gradient normals converge to the solution along the recovered direction "
    "of the gradient. Faceted shells converge to that of the field that is linear in each of the "
    "engine's tetrahedra, slowly, and only if they are cut from these, as for the picture. By how "
    "much these two differ is what the mesh leaves open; shells must leave less, in every view. "
    "Most of what they leave arises outside the outermost shell and where a ray turns round "
    "within a layer ([design.md](design.md)). Straight down a plume it is more "
    "([parameters.md](parameters.md#when-to-leave-the-defaults)).",
    _lines,
    picture=PICTURE,
    minutes=5.0,
)
