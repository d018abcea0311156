"""Write scene folders: the XML file for Mitsuba and for editing by hand, part, shells, field."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.field.path_data import FIELD_FILE, save_field_file
from iriftrace.part.part import Part, save_part
from iriftrace.scene.objects import lookat
from iriftrace.shells.files import remove_stale, save_shells
from iriftrace.shells.stack import ShellStack
from iriftrace.shells.table import PartOrigin

if TYPE_CHECKING:
    from iriftrace.field.index_field import IndexField
    from iriftrace.shells.report import ShellReport


PART_FILE = "part.ply"
BLOCKER_FILE = "blocker_{}.ply"
"""Names of the files of bodies that only block the view, by their number from 1."""

SHELLS_FOLDER = "shells"

SCALE = 0.5
"""Default factor on a scene's resolution."""

_SEAL = "<!-- No command replaces this file once it is changed. SHA-256 of the rest: "
"""Start of the line that shows whether a file was edited."""


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
    second: Camera | None = None,
    second_id: str = "projector",
    blockers: Sequence[Part] = (),
) -> Path:
    """Write a complete scene folder: XML, part, shells and the data of the cells engine.

    Parameters
    ----------
    folder : path
        Created if missing; files of the same names are replaced.
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
        Facts about the field, such as ``{"time": "snapshot"}``; stored next to the shells.
    paraview : bool
        Also write ``shells.vtm``.
    field : IndexField, optional
        Also written, as `field.npz`, for the cells engine.
    second : Camera, optional
        The device with which points are triangulated, at its full resolution.
    second_id : str
        Its id: ``"projector"``, ``"camera_2"`` or ``"laser"``.
    blockers : sequence of Part
        Bodies that only block the view.

    Returns
    -------
    Path
        The XML file.

    Raises
    ------
    InputError
        If the folder cannot be written or a camera is not a pinhole camera.
    """
    require_pinhole(camera, second)
    target = Path(folder)
    with written_together(target) as building:
        shapes = save_air(
            building,
            SHELLS_FOLDER,
            shells,
            field,
            part=save_bodies(building, part, blockers),
            report=report,
            notes=notes,
            paraview=paraview,
        )
        origin = shells.source.origin if shells.source else ""
        text = scene_xml(
            camera,
            scale,
            normals,
            shapes,
            f"Field: {origin}" if origin else "",
            inside_hit=inside_hit,
            second=second,
            second_id=second_id,
            blockers=len(blockers),
        )
        (building / name).write_text(text, encoding="utf-8")
    remove_stale(target / SHELLS_FOLDER, shells, paraview)
    remove_stale_blockers(target, len(blockers))
    return target / name


def save_bodies(folder: Path, part: Part, blockers: Sequence[Part]) -> PartOrigin:
    """Write the part and the bodies that block the view; returns the part's file."""
    save_part(part, folder / PART_FILE)
    for number, blocker in enumerate(blockers, start=1):
        save_part(blocker, folder / BLOCKER_FILE.format(number))
    file = folder / PART_FILE
    return PartOrigin(str(file), sha256_of(file), Path(part.path).name)


def remove_stale_blockers(folder: Path, count: int) -> None:
    """Remove blockers of an earlier scene from a folder whose scene now has `count` of them."""
    while (stale := folder / BLOCKER_FILE.format(count := count + 1)).is_file():
        stale.unlink()


@contextmanager
def written_together(folder: Path) -> Iterator[Path]:
    """Folder to write to, whose files are moved to `folder` when the block ends without an error.

    A block that fails, as on a full disk, leaves nothing behind: neither files nor folders that
    did not exist before. Errors of the file system are raised as InputError.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    building = folder / f".scene.{os.getpid()}"
    try:
        building.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {folder}: {error.strerror}.") from error
    try:
        yield building
        for path in sorted(building.rglob("*")):
            place = folder / path.relative_to(building)
            if path.is_dir():
                place.mkdir(exist_ok=True)
            else:
                path.replace(place)
        missing = []
    except OSError as error:
        raise InputError(f"cannot write {folder}: {error.strerror or error}.") from error
    finally:
        shutil.rmtree(building, ignore_errors=True)
        for path in missing:
            with suppress(OSError):
                path.rmdir()


def save_air(
    folder: Path,
    shown: str,
    shells: ShellStack,
    field: IndexField | None,
    *,
    part: PartOrigin,
    report: Sequence[ShellReport] | None,
    notes: Mapping[str, str] | None,
    paraview: bool,
) -> list[str]:
    """Write the shells, and the field for the cells engine, of one state of the air.

    `shown` is the shells' folder, relative to the scene's file. Returns the lines of its
    shells.
    """
    files = save_shells(
        shells, folder / SHELLS_FOLDER, report, notes=notes, paraview=paraview, part=part
    )
    if field is not None:
        save_field_file(field, folder / FIELD_FILE)
    return shell_shapes(shells, [path for path in files if path.suffix == ".ply"], shown)


def refuse_edited(xml: Path) -> None:
    """Refuse to replace a scene's file that was written or edited by hand."""
    if xml.is_file() and not _is_as_written(xml.read_text(encoding="utf-8", errors="replace")):
        raise InputError(
            f"{xml} was edited by hand, so it is not replaced; render it as it "
            "is, name another output, or remove it."
        )


def _is_as_written(text: str) -> bool:
    """True if a scene's XML has the check sum that `scene_xml` gave it."""
    head, found, rest = text.partition(_SEAL)
    return bool(found) and sealed(head, rest.partition("\n")[2]) == text


def sealed(head: str, rest: str) -> str:
    """Both pieces of a scene's XML with the check sum between them, which reveals edits."""
    return f"{head}{_SEAL}{sha256((head + rest).encode()).hexdigest()} -->\n{rest}"


def require_pinhole(*cameras: Camera | None) -> None:
    """Refuse cameras that ``calibrated_camera`` cannot represent."""
    if any(camera is not None and camera.projection != "pinhole" for camera in cameras):
        raise InputError(
            "calibrated_camera is a pinhole camera; put an orthographic sensor into the XML by "
            "hand."
        )


def scene_xml(
    camera: Camera,
    scale: float,
    normals: str,
    shapes: Sequence[str],
    remark: str = "",
    parameters: Mapping[str, str] | None = None,
    *,
    inside_hit: str = "refract",
    second: Camera | None = None,
    second_id: str = "projector",
    blockers: int = 0,
) -> str:
    """XML of a scene: integrator, camera, part and the shapes that bend the light.

    `shapes` are the lines after the part: shells, or their include; `parameters` are further
    parameters of the shapes, with defaults; `remark` is a comment at the top; `blockers` is the
    number of bodies that only block the view. The rest is as for `write_scene`.
    """
    head = [
        '<?xml version="1.0" encoding="utf-8"?>',
        "<!-- Lengths in mm. Move the camera, drop a shell or set -D scale=..., then run",
        "     iriftrace render on this file again. -->",
        *([f"<!-- {remark.replace('--', '-').rstrip('-')} -->"] if remark else []),
    ]
    lines = [
        '<scene version="3.0.0">',
        f'    <default name="scale" value="{scale!r}"/>',
        f'    <default name="normals" value={quoteattr(normals)}/>',
        '    <default name="bending" value="layers"/>',
        *(
            f'    <default name="{name}" value={quoteattr(value)}/>'
            for name, value in (parameters or {}).items()
        ),
        '    <boolean name="embree_use_robust_intersections" value="true"/>',
        "",
        '    <integrator type="first_hit">',
        '        <string name="normals" value="$normals"/>',
        '        <string name="bending" value="$bending"/>',
        *(
            [f'        <string name="inside_hit" value={quoteattr(inside_hit)}/>']
            if inside_hit != "refract"
            else []
        ),
        "    </integrator>",
        "",
        *sensor_lines(camera, "camera"),
        *(sensor_lines(second, second_id) if second is not None else []),
        *_body_lines("part", PART_FILE),
        *(
            line
            for number in range(1, blockers + 1)
            for line in _body_lines(f"blocker_{number}", BLOCKER_FILE.format(number))
        ),
    ]
    return sealed("\n".join([*head, ""]), "\n".join([*lines, *shapes, "</scene>", ""]))


def _body_lines(name: str, file: str) -> list[str]:
    """Lines of an opaque body with an id and a file."""
    return [
        f'    <shape type="ply" id="{name}">',
        f'        <string name="filename" value={quoteattr(file)}/>',
        '        <boolean name="face_normals" value="true"/>',
        '        <bsdf type="diffuse"/>',
        "    </shape>",
    ]


def sensor_lines(camera: Camera, name: str) -> list[str]:
    """Lines of a camera with the id `name`, followed by an empty one."""
    near, far = camera.focus_mm
    pose = {key: ", ".join(map(repr, vector)) for key, vector in lookat(camera).items()}
    return [
        f'    <sensor type="calibrated_camera" id="{name}">',
        f'        <float name="focal_length" value="{camera.focal_length_mm!r}"/>',
        f'        <float name="sensor_width" value="{camera.sensor_mm[0]!r}"/>',
        f'        <float name="sensor_height" value="{camera.sensor_mm[1]!r}"/>',
        f'        <float name="principal_point_x" value="{camera.principal_point_px[0] + 0.5!r}"/>',
        f'        <float name="principal_point_y" value="{camera.principal_point_px[1] + 0.5!r}"/>',
        *(
            f'        <float name="{key}" value="{value!r}"/>'
            for key, value in (camera.distortion.as_dict() if camera.distortion else {}).items()
            if value
        ),
        f'        <float name="focus_near" value="{near!r}"/>',
        *([f'        <float name="focus_far" value="{far!r}"/>'] if np.isfinite(far) else []),
        '        <float name="scale" value="$scale"/>',
        '        <transform name="to_world">',
        f'            <lookat origin="{pose["origin"]}"',
        f'                    target="{pose["target"]}"',
        f'                    up="{pose["up"]}"/>',
        "        </transform>",
        '        <film type="hdrfilm">',
        f'            <integer name="width" value="{camera.resolution[0]}"/>',
        f'            <integer name="height" value="{camera.resolution[1]}"/>',
        '            <string name="pixel_format" value="luminance"/>',
        '            <string name="component_format" value="float32"/>',
        '            <rfilter type="box"/>',
        "        </film>",
        "    </sensor>",
        "",
    ]


def shell_shapes(stack: ShellStack, meshes: Sequence[Path], folder: str) -> list[str]:
    """Lines of the shells, whose meshes lie in a folder relative to the scene's file."""
    lines = []
    for shell, mesh in zip(stack.shells, meshes, strict=True):
        lines += [
            "",
            f'    <shape type="ply" id="{mesh.stem}">',
            f'        <string name="filename" value={quoteattr(f"{folder}/{mesh.name}")}/>',
            *(
                ['        <boolean name="face_normals" value="true"/>']
                if shell.normals is None
                else []
            ),
            '        <bsdf type="iso_shell">',
            f'            <float name="ext_ior" value="{float(1 + shell.ext)!r}"/>',
            f'            <float name="int_ior" value="{float(1 + shell.int_)!r}"/>',
            *(
                [f'            <float name="iso_ior" value="{float(1 + shell.refractivity)!r}"/>']
                if shell.off_the_middle
                else []
            ),
            f'            <string name="layer" value="{shell.layer}"/>',
            "        </bsdf>",
            "    </shape>",
        ]
    return lines


def included_xml(shapes: Sequence[str]) -> str:
    """XML of a file that scenes include."""
    head = ['<?xml version="1.0" encoding="utf-8"?>', '<scene version="3.0.0">']
    return "\n".join([*head, *shapes, "</scene>", ""])
