"""How the two engines agree in the fields of all bundled scenes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.field.index_field import IndexField
from iriftrace.field.read import read_field
from iriftrace.image.aov_image import AovImage
from iriftrace.part.part import Part, read_part
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.scenes import folder_of
from iriftrace.scenes.components import COMPONENTS
from iriftrace.shells.contour import contour_shells
from iriftrace.trace.render import render_scene
from validation.engines import LAYERS, NORMALS, VIEWS, Key, camera_at, differences
from validation.inputs.solved_fields import SOLVED
from validation.line import Line, Section
from validation.sections.agreement import (
    BOUNDED_LAYERS,
    LIMITS,
    MEDIAN_BOUND,
    P95_BOUND,
    Shares,
    draw,
    share,
)

Position = tuple[float, float, float]

CYLINDER = "cylinder"
OWN = "own pose"
THROUGH_THE_PLUME = {
    f"from {', '.join(f'{x:g}' for x in VIEWS[name])} mm": VIEWS[name]
    for name in ("corner", "45 degrees above", "oblique")
}
"""Views of the wishbone from above, through its plume."""

PICTURE = "fields.png"
STATISTICS = ("median", "p95", "trimmed rmse")


@frozen
class Case:
    """A field and the positions that its part is seen from, mm."""

    name: str
    views: Mapping[str, Position]

    @property
    def title(self) -> str:
        """The name as it is printed."""
        return self.name.replace("_", " ")

    @property
    def part(self) -> Part:
        """What stands in the air."""
        if self.name == CYLINDER:
            return read_part(folder_of(CYLINDER) / "part.ply")
        return SOLVED[self.name].part

    def field(self, folder: Path) -> IndexField:
        """The air; the folder is for temporary files."""
        if self.name == CYLINDER:
            return read_field(folder_of(CYLINDER) / "field.vtu")
        return SOLVED[self.name].field(folder)


def cases() -> list[Case]:
    """The bundled cylinder and the components."""
    found = [Case(CYLINDER, {OWN: VIEWS["corner"]})]
    for name, component in COMPONENTS.items():
        more = THROUGH_THE_PLUME if name == "wishbone" else {}
        found.append(Case(name, {OWN: component.origin_mm, **more}))
    return found


def pictures(
    folder: Path, case: Case, layers: Sequence[int] = LAYERS
) -> dict[str, dict[Key, AovImage]]:
    """For each view the pictures of shells, this many, and of the field, with either normals."""
    field, part = case.field(folder), case.part
    cameras = {view: camera_at(position) for view, position in case.views.items()}
    found: dict[str, dict[Key, AovImage]] = {view: {} for view in cameras}
    for count in layers:
        volume = field if count == layers[0] else None
        xml = write_scene(
            folder / str(count),
            part,
            contour_shells(field, count),
            next(iter(cameras.values())),
            paraview=False,
            field=volume,
        )
        # One scene at a time, because 80 shells of fine cells take gigabytes.
        for normals in NORMALS:
            engines = {"shells": count} | ({} if volume is None else {"continuous": "continuous"})
            for engine, key in engines.items():
                scene = load_scene(xml, {"normals": normals}, engine=engine)
                for view, camera in cameras.items():
                    image = render_scene(scene, camera=camera, nearest=False).image
                    found[view][key, normals] = image
    return found


def lines_of(
    case: str, images: dict[Key, AovImage], layers: Sequence[int], bounded: bool
) -> tuple[list[Line], Shares]:
    """Rows of one view, and the shares of each number of shells."""
    vectors, unmatched = differences(images)
    exact = vectors["continuous", "gradient"]
    norm = np.linalg.norm(exact, axis=1)
    median, p95 = np.quantile(norm, (0.5, 0.95))
    other = share(np.linalg.norm(vectors["continuous", "facet"] - exact, axis=1), norm)
    lines = [
        Line(
            f"{case}: rays good in all pictures (in some only)", "", f"{len(norm):,} ({unmatched})"
        ),
        Line(f"{case}: displacement, median and p95", "", f"{median:.3g} and {p95:.3g} µm"),
        Line(
            f"{case}: the engine's two gradients differ by, median and p95",
            "",
            f"{other[0]:.1f} % and {other[1]:.1f} %",
        ),
    ]
    shares: Shares = {}
    for normals, limit in product(NORMALS, NORMALS):
        far = vectors["continuous", limit]
        size = np.linalg.norm(far, axis=1)
        shares[case, normals, limit] = [
            share(np.linalg.norm(vectors[count, normals] - far, axis=1), size) for count in layers
        ]
    shells = ", ".join(map(str, layers))
    for normals in NORMALS:
        columns = zip(*shares[case, normals, normals], strict=True)
        for name, values in zip(STATISTICS, columns, strict=True):
            what = f"{shells} shells, {normals} normals, to the {LIMITS[normals]}: {name}"
            lines.append(Line(f"{case}: {what}", "0", ", ".join(f"{v:.2f} %" for v in values)))
            if len(layers) > 1:
                order = np.log(values[0] / values[-1]) / np.log(layers[-1] / layers[0])
                lines.append(Line(f"{case}: {what}, order observed", "", f"{order:.2f}"))
    thirteen = shares[case, "gradient", "gradient"][list(layers).index(BOUNDED_LAYERS)]
    bounds = (MEDIAN_BOUND, P95_BOUND) if bounded else (None, None)
    for name, value, bound in zip(("median", "p95"), thirteen[:2], bounds, strict=True):
        what = f"{case}: {BOUNDED_LAYERS} shells, gradient normals: {name}"
        lines.append(Line(what, "0", f"{value:.2f} %", value, bound))
    return lines, shares


def lines_of_cases(folder: Path, chosen: Sequence[Case], picture: str) -> list[Line]:
    """Rows of several fields, those from the first view bounded, and the picture of these."""
    lines: list[Line] = []
    drawn: Shares = {}
    first = [f"{case.title}, {next(iter(case.views))}" for case in chosen]
    for case in chosen:
        for view, images in pictures(_made(folder / case.name), case).items():
            title = f"{case.title}, {view}"
            rows, shares = lines_of(title, images, LAYERS, bounded=title in first)
            lines += rows
            drawn |= shares
    draw(folder / picture, drawn, first)
    return lines


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


def _lines(folder: Path) -> list[Line]:
    return lines_of_cases(folder, cases(), PICTURE)


SECTION = Section(
    "fields",
    "Two engines, every scene",
    "The same for the fields of all bundled scenes, with all triangles of their shells; facet "
    "normals on the same shells, cut from the solver's cells. At the scenes' own poses 13 shells "
    "with gradient normals stay within the bounds. In the wishbone's last three views, from above "
    "through its plume, they do not. Most of the difference there arises outside the outermost "
    "shell and where a ray turns round within a layer ([design.md](design.md)). It gets "
    "better with the number of shells. Straight down a plume it is worse "
    "([parameters.md](parameters.md#when-to-leave-the-defaults)). The continuous engine "
    "needs no shells. On the cylinder, whose cells are the coarsest, the difference stays at about "
    "1 %. By how much the engine's two gradients differ tells what the mesh leaves open.",
    _lines,
    picture=PICTURE,
    minutes=10.5,
)
