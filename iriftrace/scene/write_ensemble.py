"""The scene folder of an ensemble: one part, one camera, the shells of every member."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import Factory, evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.part.part import Part
from iriftrace.scene.ensemble import (
    FOLDER,
    INCLUDED,
    MEMBER,
    TABLE,
    FieldMember,
    weights_of,
    write_members,
)
from iriftrace.scene.write import (
    SHELLS_FOLDER,
    included_xml,
    remove_stale_blockers,
    require_pinhole,
    save_air,
    save_bodies,
    scene_xml,
    written_together,
)
from iriftrace.shells.stack import ShellStack
from iriftrace.shells.table import PartOrigin

if TYPE_CHECKING:
    from iriftrace.field.index_field import IndexField
    from iriftrace.shells.report import ShellReport


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
    *,
    name: str = "scene.xml",
    scale: float = 1.0,
    normals: str = "gradient",
    inside_hit: str = "refract",
    notes: Mapping[str, str] | None = None,
    paraview: bool = True,
    second: Camera | None = None,
    second_id: str = "projector",
    blockers: Sequence[Part] = (),
) -> tuple[Path, tuple[FieldMember, ...]]:
    """Write a scene that is rendered once for every member.

    ``-D member=3`` traces the third one alone, in plain Mitsuba too, where member 1 is the default.
    `iriftrace.trace.render.render_scene` traces all of them when no member is chosen.

    Parameters
    ----------
    folder, part, camera, name, scale, normals, inside_hit, notes, paraview, second,
    second_id, blockers
        See `iriftrace.scene.write.write_scene`.
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
    require_pinhole(camera, second)
    scene = Path(folder) / name
    _refuse_files_of_others(scene.parent / FOLDER)
    with written_together(scene.parent) as building:
        (building / FOLDER).mkdir()
        placed = save_bodies(building, part, blockers)
        listed = tuple(
            _write_member(building, number, member, placed, notes, paraview)
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
            scale,
            normals,
            ["", f'    <include filename="{FOLDER}/${MEMBER}/{INCLUDED}"/>'],
            ". ".join((remark, *origins)),
            {MEMBER: "1"},
            inside_hit=inside_hit,
            second=second,
            second_id=second_id,
            blockers=len(blockers),
        )
        (building / name).write_text(text, encoding="utf-8")
        # Members of an earlier, larger ensemble would be read as members of this one.
        shutil.rmtree(scene.parent / FOLDER, ignore_errors=True)
    remove_stale_blockers(scene.parent, len(blockers))
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
    notes: Mapping[str, str] | None,
    paraview: bool,
) -> FieldMember:
    if member.shells.source is None:
        raise InputError(
            f"The shells of member {number} do not state the field they come from, which results "
            "must name; make them from a field."
        )
    shapes = save_air(
        scene / FOLDER / str(number),
        # Files are searched from the scene's folder, also those that an included file names.
        f"{FOLDER}/{number}/{SHELLS_FOLDER}",
        member.shells,
        member.field,
        part=part,
        report=member.report,
        notes={**(notes or {}), **member.notes, "member": f"{number}: {member.label}"},
        paraview=paraview,
    )
    included = scene / FOLDER / str(number) / INCLUDED
    included.write_text(included_xml(shapes), encoding="utf-8")
    return FieldMember(
        number, member.label, member.time, member.shells.source, member.weight, member.covariance
    )
