"""Write scene folders: XML, part, and the shells and the field of one state of the air or several.

The folder of an ensemble has one part, one camera, and the shells of every member.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.io.field_npz import FIELD_FILE, save_field_file
from iriftrace.io.part_files import save_part
from iriftrace.io.shells import remove_stale, save_shells
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.shells.table import PartOrigin
from iriftrace.part.part import Part
from iriftrace.tracing.ensemble import (
    FOLDER,
    INCLUDED,
    MEMBER,
    TABLE,
    write_members,
)
from iriftrace.tracing.hot_air import AirState, FieldMember, check_variations, weights_of
from iriftrace.tracing.xml import (
    BLOCKER_FILE,
    PART_FILE,
    SceneSettings,
    included_xml,
    scene_xml,
    shell_shapes,
)

SHELLS_FOLDER = "shells"


def write_scene(
    folder: str | Path,
    part: Part,
    air: AirState | ShellStack,
    camera: Camera,
    settings: SceneSettings = SceneSettings(scale=1.0),
    *,
    name: str = "scene.xml",
    paraview: bool = True,
) -> Path:
    """Write a complete scene folder: XML, part, shells and the data of the cells engine.

    Parameters
    ----------
    folder : path
        Created if missing; files of the same names are replaced.
    part : Part
    air : AirState or ShellStack
        Shells alone have no field for the cells engine.
    camera : Camera
        At its full resolution.
    settings : SceneSettings
        By default those of one camera at full resolution.
    name : str
        Name of the XML file.
    paraview : bool
        Also write ``shells.vtm``.

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
    state = air if isinstance(air, AirState) else AirState(None, ready=air)
    target = Path(folder)
    with written_together(target) as building:
        placed = _save_bodies(building, part, settings.blockers)
        shapes = _save_air(building, SHELLS_FOLDER, state, placed, settings.notes, paraview)
        source = state.shells.source
        origin = source.origin if source else ""
        text = scene_xml(camera, settings, shapes, f"Field: {origin}" if origin else "")
        (building / name).write_text(text, encoding="utf-8")
    remove_stale(target / SHELLS_FOLDER, state.shells, paraview)
    remove_stale_blockers(target, len(settings.blockers))
    return target / name


def write_ensemble_scene(
    folder: str | Path,
    part: Part,
    states: Iterable[AirState],
    camera: Camera,
    settings: SceneSettings = SceneSettings(scale=1.0),
    *,
    name: str = "scene.xml",
) -> tuple[Path, tuple[FieldMember, ...]]:
    """Write a scene that is rendered once for every member.

    ``-D member=3`` traces the third one alone, in plain Mitsuba too, where member 1 is the default.
    `iriftrace.tracing.render.render_scene` traces all of them when no member is chosen.

    Parameters
    ----------
    folder, part, camera, settings, name
        See `write_scene`.
    states : iterable of AirState
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
        members: list[FieldMember] = []
        remaining = iter(states)
        while (state := next(remaining, None)) is not None:
            number = len(members) + 1
            members.append(_write_member(building, number, state, placed, settings.notes))
            del state  # before the next one is made
        listed = tuple(members)
        if len(listed) < 2:
            raise InputError(
                f"An ensemble of {len(listed)} field has no scatter; give at least two.",
                code="scene.one_field",
                argument="member",
            )
        check_variations(listed)
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
            "them; give the scene a folder of its own.",
            code="output.replaces",
            argument="output",
        )


def _write_member(
    scene: Path, number: int, state: AirState, part: PartOrigin, notes: Mapping[str, str]
) -> FieldMember:
    member = FieldMember.of(number, state)
    shapes = _save_air(
        scene / FOLDER / str(number),
        # Files are searched from the scene's folder, also those that an included file names.
        f"{FOLDER}/{number}/{SHELLS_FOLDER}",
        state,
        part,
        {**notes, "member": f"{number}: {state.label}"},
    )
    included = scene / FOLDER / str(number) / INCLUDED
    included.write_text(included_xml(shapes), encoding="utf-8")
    return member


def _require_pinhole(*cameras: Camera | None) -> None:
    """Refuse cameras that ``calibrated_camera`` cannot represent."""
    if any(camera is not None and camera.projection != "pinhole" for camera in cameras):
        raise InputError(
            "calibrated_camera is a pinhole camera; put an orthographic sensor into the XML by "
            "hand.",
            code="camera.not_pinhole",
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
        raise InputError(
            f"cannot make the folder {folder}: {error.strerror}.",
            code="output.unwritable",
            argument="output",
        ) from error
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
        raise InputError(
            f"cannot write {folder}: {error.strerror or error}.",
            code="output.unwritable",
            argument="output",
        ) from error
    finally:
        shutil.rmtree(building, ignore_errors=True)
        for path in missing:
            with suppress(OSError):
                path.rmdir()


def _save_air(
    folder: Path,
    shown: str,
    state: AirState,
    part: PartOrigin,
    notes: Mapping[str, str],
    paraview: bool = True,
) -> list[str]:
    """Write the shells of one state of the air, and the field for the cells engine.

    `shown` is the shells' folder, relative to the scene's file. Returns the lines of its
    shells.
    """
    files = save_shells(
        state.shells,
        folder / SHELLS_FOLDER,
        state.report,
        notes={**notes, **state.notes},
        paraview=paraview,
        part=part,
    )
    if state.field is not None:
        save_field_file(state.field, folder / FIELD_FILE)
    return shell_shapes(state.shells, [path for path in files if path.suffix == ".ply"], shown)
