"""Writes the bundled scenes again: ``python -m scenes.generators.bundled FOLDER``.

It runs in a checkout; the installed package has the scenes alone. With ``--hybrid_cylinder``,
``--bevel_gear`` or ``--wishbone`` and the file of a flow solution it writes these scenes too.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Mapping
from pathlib import Path

from attrs import evolve

from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.report import report_shells
from iriftrace.scenes import folder_of
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.write import write_scene
from iriftrace.tracing.xml import PART_FILE, SceneSettings
from scenes.generators.components import (
    COMPONENTS,
    scene_camera,
    write_beside,
    write_component,
    write_tooth,
)
from scenes.generators.plate import PlateAir, hot_plate

FIELD = "field.vtu"
FIELD_ORIGIN = "OpenFOAM, coarse solution"
SCALE = 0.5
HOT_PLATE_K = 1373.15
PAPER_SCENE = "cylinder_paper"
PAPER_CAMERA_MM = (150.0, -100.0, 120.0)
"""The paper's camera, which has 3.5 % of the visible surface outside its picture."""
FRINGE_SCENE = "fringe_cylinder"
FRINGE_DEVICES_MM = ((-55.0, -275.0, 60.0), (55.0, -275.0, 60.0))
"""Camera and projector, 110 mm apart along the cylinder's axis; both pictures hold all of it."""


def write_bundled(folder: str | Path) -> list[Path]:
    """Write every bundled scene into a folder; returns the XML files."""
    field = read_field(folder_of("cylinder") / FIELD)
    cylinder = read_part(folder_of("cylinder") / "part.ply")
    # Named as it lies beside the scene, and not where this machine has it.
    field = evolve(field, source=evolve(field.source, path=FIELD, origin=FIELD_ORIGIN))
    shells = contour_shells(field)
    around = AirState(field, ready=shells, report=report_shells(shells, field, cylinder))
    tubes = concentric_cylinders()
    scenes = (
        (
            *("cylinder", cylinder, around),
            *((170.0, -150.0, 140.0), 450.0, "a quarter was solved and mirrored"),
        ),
        ("slab", *slab(size_mm=160.0), (120.0, 0.0, 90.0), 250.0, "analytic, plane layers"),
        ("concentric_cylinders", *tubes, (60.0, -110.0, 60.0), 250.0, "analytic, axial symmetry"),
    )
    return [
        write_scene(
            Path(folder) / name,
            part,
            air,
            scene_camera(origin, (0.0, 0.0, 0.0), (50.0, far)),
            SceneSettings(scale=SCALE, notes={"time": "steady", "symmetry": symmetry}),
            paraview=False,
        )
        for name, part, air, origin, far, symmetry in scenes
    ]


def write_plate(folder: Path, wall_k: float = HOT_PLATE_K) -> Path:
    """Write the scene of a board seen past a hot plate, of any wall temperature, K."""
    board, plate, field = hot_plate(PlateAir(wall_k))
    return write_scene(
        folder / "hot_plate",
        board,
        AirState(field),
        scene_camera((200.0, 6.0, 50.0), (0.0, 6.0, 50.0), (50.0, 450.0)),
        SceneSettings(
            scale=SCALE,
            notes={"time": "steady", "symmetry": "similarity solution"},
            blockers=(plate,),
        ),
        paraview=False,
    )


def write_paper(folder: Path, cylinder: Path) -> Path:
    """Write the cylinder's scene with the paper's camera; parameters as of `write_fringe`."""
    camera = scene_camera(PAPER_CAMERA_MM, (0.0, 0.0, 0.0), (50.0, 250.0))
    part = read_part(cylinder / PART_FILE)
    return write_beside(folder / PAPER_SCENE, cylinder, part, camera, SceneSettings(scale=SCALE))


def paper_copied(folder: Path) -> Path:
    """Copy the paper's scene with its shells and its field into a new folder; returns the XML."""
    shutil.copytree(folder_of("cylinder"), folder)
    text = (folder_of(PAPER_SCENE) / "scene.xml").read_text(encoding="utf-8")
    xml = folder / "scene.xml"
    xml.write_text(text.replace("../cylinder/", ""), encoding="utf-8")
    return xml


def write_fringe(folder: Path, cylinder: Path) -> Path:
    """Write the cylinder's scene with a camera and a projector, in the shells of the scene beside.

    `folder` is that of the scenes; the name of `cylinder`, the cylinder's scene, is what the new
    scene refers to.
    """
    camera, projector = (
        scene_camera(origin, (0.0, 0.0, 0.0), (50.0, 450.0)) for origin in FRINGE_DEVICES_MM
    )
    part = read_part(cylinder / PART_FILE)
    settings = SceneSettings(scale=SCALE, second=projector)
    return write_beside(folder / FRINGE_SCENE, cylinder, part, camera, settings)


def write_components(folder: str | Path, fields: Mapping[str, Path]) -> list[Path]:
    """Write the scenes of those of `COMPONENTS` whose fields are given; returns the XML files."""
    written = [write_component(Path(folder), name, path) for name, path in fields.items()]
    if "bevel_gear" in fields:
        written.append(write_tooth(Path(folder), Path(folder) / "bevel_gear"))
    return written


def main() -> None:
    """Write what the command line asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m scenes.generators.bundled", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    for name in COMPONENTS:
        parser.add_argument(f"--{name}", type=Path, metavar="FIELD")
    given = vars(parser.parse_args())
    fields = {name: given[name] for name in COMPONENTS if given[name] is not None}
    written = write_bundled(given["folder"])
    for write in (write_paper, write_fringe):
        written.append(write(given["folder"], given["folder"] / "cylinder"))
    written.append(write_plate(given["folder"]))
    for path in [*written, *write_components(given["folder"], fields)]:
        print(path)


if __name__ == "__main__":
    main()
