"""Writes scene folders from part, shells and camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from iriftrace.camera import Camera
from iriftrace.checksum import sha256_of
from iriftrace.continuous_field import FIELD_FILE, save_field_file
from iriftrace.errors import InputError
from iriftrace.part import Part, save_part
from iriftrace.scene_xml import PART_FILE, require_pinhole, scene_xml, shell_shapes
from iriftrace.shell_io import PartFile, save_shells
from iriftrace.shell_stack import ShellStack
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    from iriftrace.index_field import IndexField
    from iriftrace.shell_report import ShellReport

SHELLS_FOLDER = "shells"


def write_scene(
    folder: str | Path,
    part: Part,
    shells: ShellStack,
    camera: Camera,
    *,
    name: str = "scene.xml",
    scale: float = 1.0,
    normals: str = "gradient",
    inside_hit: str = "refract",
    report: Sequence[ShellReport] | None = None,
    notes: Mapping[str, str] | None = None,
    paraview: bool = True,
    field: IndexField | None = None,
) -> Path:
    """Write a complete scene folder: XML, part, shells and what the continuous engine needs.

    Parameters
    ----------
    folder : path
        Created when missing; files of the same names are replaced.
    part : Part
    shells : ShellStack
    camera : Camera
        At its full resolution.
    name : str
        Name of the XML file.
    scale : float
        Default of the XML's parameter ``scale``, a factor on the resolution.
    normals : str
        Default of the XML's parameter ``normals``: ``"gradient"`` or ``"facet"``.
    inside_hit : str
        ``"drop"`` gives up rays that meet a shell from its inside; see ``first_hit``.
    report : sequence of ShellReport, optional
        Added to the shells' table.
    notes : mapping of str, optional
        What is known of the field, such as ``{"time": "snapshot"}``; kept beside the shells.
    paraview : bool
        Whether to write ``shells.vtm`` too.
    field : IndexField, optional
        Written too, as `continuous_field.FIELD_FILE`, for the continuous engine.

    Returns
    -------
    Path
        The XML file.

    Raises
    ------
    InputError
        If the folder cannot be written or the camera is not a pinhole camera.
    """
    require_pinhole(camera)
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {target}: {error.strerror}.") from error
    save_part(part, target / PART_FILE)
    shapes = save_air(
        target,
        SHELLS_FOLDER,
        shells,
        field,
        part=PartFile(target / PART_FILE, sha256_of(target / PART_FILE)),
        report=report,
        notes=notes,
        paraview=paraview,
    )
    origin = shells.source.origin if shells.source else ""
    with whole_file(target / name) as temporary:
        temporary.write_text(
            scene_xml(
                camera,
                scale,
                normals,
                shapes,
                f"Field: {origin}" if origin else "",
                inside_hit=inside_hit,
            ),
            encoding="utf-8",
        )
    return target / name


def save_air(
    folder: Path,
    shown: str,
    shells: ShellStack,
    field: IndexField | None,
    *,
    part: PartFile,
    report: Sequence[ShellReport] | None,
    notes: Mapping[str, str] | None,
    paraview: bool,
) -> list[str]:
    """Write the shells, and the field for the continuous engine, of one state of the air.

    Parameters
    ----------
    folder : Path
        Where `SHELLS_FOLDER` and `continuous_field.FIELD_FILE` go.
    shown : str
        The shells' folder, seen from the scene's file.
    part : PartFile
        The scene's part; another one in its place is noticed.
    shells, field, report, notes, paraview
        As for `write_scene`.

    Returns
    -------
    list of str
        Lines of the shells for the scene's XML.
    """
    files = save_shells(
        shells,
        folder / SHELLS_FOLDER,
        report,
        notes=notes,
        paraview=paraview,
        part=part,
    )
    if field is not None:
        save_field_file(field, folder / FIELD_FILE)
    return shell_shapes(shells, [path for path in files if path.suffix == ".ply"], shown)
