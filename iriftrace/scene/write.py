"""Write scene folders: XML, part, and the shells and the field of one state of the air or several.

The folder of an ensemble has one part, one camera, and the shells of every member.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import Factory, evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.field.path_data import FIELD_FILE, save_field_file
from iriftrace.part.part import Part, save_part
from iriftrace.scene.ensemble import (
    FOLDER,
    INCLUDED,
    MEMBER,
    TABLE,
    FieldMember,
    weights_of,
    write_members,
)
from iriftrace.scene.xml import (
    BLOCKER_FILE,
    PART_FILE,
    SceneSettings,
    included_xml,
    scene_xml,
    shell_shapes,
)
from iriftrace.shells.files import remove_stale, save_shells
from iriftrace.shells.stack import ShellStack
from iriftrace.shells.table import PartOrigin

if TYPE_CHECKING:
    from iriftrace.field.index_field import IndexField
    from iriftrace.shells.report import ShellReport

SHELLS_FOLDER = "shells"


def write_scene(
    folder: str | Path,
    part: Part,
    shells: ShellStack,
    camera: Camera,
    settings: SceneSettings = SceneSettings(scale=1.0),
    *,
    name: str = "scene.xml",
    report: Sequence[ShellReport] | None = None,
    paraview: bool = True,
    field: IndexField | None = None,
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
    settings : SceneSettings
        By default those of one camera at full resolution.
    name : str
        Name of the XML file.
    report : sequence of ShellReport, optional
        Added to the shells' table.
    paraview : bool
        Also write ``shells.vtm``.
    field : IndexField, optional
        Also written, as `field.npz`, for the cells engine.

    Returns
    -------
    Path
        The XML file.

    Raises
    ------
    InputError
        If the folder cannot be written or a camera is not a pinhole camera.
    """
    _require_pinhole(camera, settings.second)
    target = Path(folder)
    with written_together(target) as building:
        shapes = _save_air(
            building,
            SHELLS_FOLDER,
            shells,
            field,
            part=_save_bodies(building, part, settings.blockers),
            report=report,
            notes=settings.notes,
            paraview=paraview,
        )
        origin = shells.source.origin if shells.source else ""
        text = scene_xml(camera, settings, shapes, f"Field: {origin}" if origin else "")
        (building / name).write_text(text, encoding="utf-8")
    remove_stale(target / SHELLS_FOLDER, shells, paraview)
    remove_stale_blockers(target, len(settings.blockers))
    return target / name


@frozen(eq=False)
class MemberAir:
    """The air of one member, for writing.

    Attributes
    ----------
    label : str
        Distinguishes it from the others.
    time : float or None
        In the file's unit.
    shells : ShellStack
        With the field's source.
    field : IndexField or None
        For the cells engine.
    report : sequence of ShellReport or None
        Added to the shells' table; `iriftrace.build_ensemble` creates it.
    notes : mapping of str
        Stated in every result, in addition to the scene's.
    weight : float
        Weight relative to those of the other members; equal by default.
    covariance : list of float or None
        Row of the covariance of fitted weights.
    """

    label: str
    time: float | None
    shells: ShellStack
    field: IndexField | None = None
    report: Sequence[ShellReport] | None = None
    notes: Mapping[str, str] = Factory(dict)
    weight: float = 1.0
    covariance: list[float] | None = None


def write_ensemble_scene(
    folder: str | Path,
    part: Part,
    members: Iterable[MemberAir],
    camera: Camera,
    settings: SceneSettings = SceneSettings(scale=1.0),
    *,
    name: str = "scene.xml",
    paraview: bool = True,
) -> tuple[Path, tuple[FieldMember, ...]]:
    """Write a scene that is rendered once for every member.

    ``-D member=3`` traces the third one alone, in plain Mitsuba too, where member 1 is the default.
    `iriftrace.trace.render.render_scene` traces all of them when no member is chosen.

    Parameters
    ----------
    folder, part, camera, settings, name, paraview
        See `write_scene`.
    members : iterable of MemberAir
        At least two; one is in memory at a time.

    Returns
    -------
    path : Path
        The XML file.
    members : tuple of FieldMember

    Raises
    ------
    InputError
        There are fewer than two members, one has no source, or the folder cannot be written or
        other files in the place of the members.
    """
    _require_pinhole(camera, settings.second)
    scene = Path(folder) / name
    _refuse_files_of_others(scene.parent / FOLDER)
    with written_together(scene.parent) as building:
        (building / FOLDER).mkdir()
        placed = _save_bodies(building, part, settings.blockers)
        listed = tuple(
            _write_member(building, number, member, placed, settings.notes, paraview)
            for number, member in enumerate(members, start=1)
        )
        if len(listed) < 2:
            raise InputError(
                f"An ensemble of {len(listed)} field has no scatter; give at least two."
            )
        normalised = weights_of(listed).weights.tolist()
        listed = tuple(evolve(m, weight=w) for m, w in zip(listed, normalised, strict=True))
        write_members(building / FOLDER, listed)
        origins = dict.fromkeys(m.source.origin for m in listed if m.source.origin)
        remark = f"An ensemble of {len(listed)} fields; -D {MEMBER}=2 traces the second one alone"
        text = scene_xml(
            camera,
            settings,
            ["", f'    <include filename="{FOLDER}/${MEMBER}/{INCLUDED}"/>'],
            ". ".join((remark, *origins)),
            {MEMBER: "1"},
        )
        (building / name).write_text(text, encoding="utf-8")
        # Members of an earlier, larger ensemble would be read as members of this one.
        shutil.rmtree(scene.parent / FOLDER, ignore_errors=True)
    remove_stale_blockers(scene.parent, len(settings.blockers))
    return scene, listed


def _refuse_files_of_others(folder: Path) -> None:
    """Refuse a folder with other files, as the folder of the members is replaced as a whole."""
    if not folder.exists():
        return
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else {""}
    if names and (TABLE not in names or not all(n.isdecimal() for n in names - {TABLE})):
        raise InputError(
            f"{folder} holds other files than those of an ensemble's scene, which would replace "
            "them; give the scene a folder of its own."
        )


def _write_member(
    scene: Path,
    number: int,
    member: MemberAir,
    part: PartOrigin,
    notes: Mapping[str, str],
    paraview: bool,
) -> FieldMember:
    if member.shells.source is None:
        raise InputError(
            f"The shells of member {number} do not state the field they come from, which results "
            "must name; make them from a field."
        )
    shapes = _save_air(
        scene / FOLDER / str(number),
        # Files are searched from the scene's folder, also those that an included file names.
        f"{FOLDER}/{number}/{SHELLS_FOLDER}",
        member.shells,
        member.field,
        part=part,
        report=member.report,
        notes={**notes, **member.notes, "member": f"{number}: {member.label}"},
        paraview=paraview,
    )
    included = scene / FOLDER / str(number) / INCLUDED
    included.write_text(included_xml(shapes), encoding="utf-8")
    return FieldMember(
        number, member.label, member.time, member.shells.source, member.weight, member.covariance
    )


def _require_pinhole(*cameras: Camera | None) -> None:
    """Refuse cameras that ``calibrated_camera`` cannot represent."""
    if any(camera is not None and camera.projection != "pinhole" for camera in cameras):
        raise InputError(
            "calibrated_camera is a pinhole camera; put an orthographic sensor into the XML by "
            "hand."
        )


def _save_bodies(folder: Path, part: Part, blockers: Sequence[Part]) -> PartOrigin:
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


def _save_air(
    folder: Path,
    shown: str,
    shells: ShellStack,
    field: IndexField | None,
    *,
    part: PartOrigin,
    report: Sequence[ShellReport] | None,
    notes: Mapping[str, str],
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
