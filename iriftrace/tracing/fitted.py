"""The scene folder of members with fitted weights, made from the folder of their scene."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of, write_json
from iriftrace.core.plain import JsonObject
from iriftrace.io.shells import TABLE as SHELLS_TABLE
from iriftrace.tracing.ensemble import (
    FOLDER,
    INCLUDED,
    is_ensemble,
    member_folder,
    read_members,
    write_members,
)
from iriftrace.tracing.file import read_xml
from iriftrace.tracing.hot_air import OUTSIDE, FieldMember
from iriftrace.tracing.write import remove_stale_blockers, written_together
from iriftrace.tracing.xml import BLOCKER_FILE, PART_FILE, refuse_edited, sealed


def write_fitted_scene(
    scene: Path,
    members: Sequence[FieldMember],
    output: Path,
    *,
    of_board: bool,
    outside: str = "",
) -> tuple[FieldMember, ...]:
    """Write the scene of fitted members, without those that have no effect.

    Copies the ensemble's scene with the members to keep, which have weights and rows of their
    covariance, into another folder, where they are numbered from 1; returns them as listed there.
    `of_board`: the part is a board that is seen past the first blocker, which becomes the part.
    `outside`: a sentence that every result states if the measured air is outside the members.

    Raises InputError if the output lies in the scene's own folder or was edited, a member is not
    one of the scene's, or the folder cannot be written.
    """
    check_fitted_scene(scene)
    check_fitted_output(scene, output)
    theirs = _numbers_in(scene, members)
    columns = [member.number - 1 for member in members]
    listed = tuple(
        evolve(
            member,
            number=number,
            covariance=None
            if member.covariance is None
            else [member.covariance[column] for column in columns],
        )
        for number, member in enumerate(members, start=1)
    )
    with written_together(output.parent) as building:
        text, blockers = _copy_bodies(scene, building, of_board)
        (building / output.name).write_text(text, encoding="utf-8")
        for number, member in zip(theirs, listed, strict=True):
            _copy_member(scene, number, building, member, outside)
        write_members(building / FOLDER, listed)
        shutil.rmtree(output.parent / FOLDER, ignore_errors=True)
    remove_stale_blockers(output.parent, blockers)
    return listed


def check_fitted_scene(scene: Path) -> None:
    """Refuse a scene that cannot be weighted."""
    if not is_ensemble(scene):
        raise InputError(
            f"{scene} has one field, but a fit gives the weights of several; write it with several "
            "states of the air.",
            code="scene.one_field",
            argument="member",
        )


def check_fitted_output(scene: Path, output: Path) -> None:
    """Refuse an output that cannot be written from a scene."""
    if output.parent.resolve() == scene.parent.resolve():
        raise InputError(
            f"The output {output} would replace files of {scene}; give the fitted scene a folder "
            f"of its own, such as {scene.parent / 'fitted' / output.name}.",
            code="output.replaces",
            argument="output",
        )
    refuse_edited(output)


def _numbers_in(scene: Path, members: Sequence[FieldMember]) -> list[int]:
    """Numbers of the members' fields in a scene, which may be another one."""
    listed = read_members(scene)
    own = {m.state: m.number for m in listed}
    alike = [m.label for m in listed if own[m.state] != m.number]
    if alike:
        raise InputError(
            f'{scene} has "{alike[0]}" and another member of the same file and state, so their '
            "weights cannot be told apart; write it with each field once.",
            code="scene.same_members",
            argument="member",
        )
    missing = [m.label for m in members if m.state not in own]
    if missing:
        raise InputError(
            f"{scene} has no member with the field {missing[0]}, whose weight was fitted; write it "
            "with the same fields as the board's scene.",
            code="scene.other_members",
            argument="member",
        )
    return [own[m.state] for m in members]


def _copy_bodies(scene: Path, building: Path, of_board: bool) -> tuple[str, int]:
    """Copy the meshes of part and blockers; returns the new XML and the number of blockers."""
    root = read_xml(scene)
    shapes = {str(shape.get("id")): shape for shape in root.findall("shape")}
    blockers = [name for name in shapes if name.startswith("blocker_")]
    kept = blockers if of_board else ["part", *blockers]
    if kept[0] != "part":
        root.remove(shapes["part"])
    for number, name in enumerate(kept):
        file = PART_FILE if number == 0 else BLOCKER_FILE.format(number)
        named = next(s for s in shapes[name].findall("string") if s.get("name") == "filename")
        shutil.copyfile(scene.parent / str(named.get("value")), building / file)
        named.set("value", file)
        shapes[name].set("id", "part" if number == 0 else f"blocker_{number}")
    head = '<?xml version="1.0" encoding="utf-8"?>\n<!-- Members weighted by iriftrace fit -->\n'
    return sealed(head, ElementTree.tostring(root, encoding="unicode") + "\n"), len(kept) - 1


def _copy_member(
    scene: Path, number: int, building: Path, member: FieldMember, outside: str
) -> None:
    """Copy a member's shells and field, with their new number and the new part."""
    target = building / FOLDER / str(member.number)
    shutil.copytree(member_folder(scene, number), target)
    included = read_xml(target / INCLUDED)
    for name in included.iterfind(".//string[@name='filename']"):
        mesh = str(name.get("value"))
        if mesh.startswith(own := f"{FOLDER}/{number}/"):
            name.set("value", f"{FOLDER}/{member.number}/{mesh.removeprefix(own)}")
    ElementTree.ElementTree(included).write(target / INCLUDED, "utf-8", xml_declaration=True)
    for file in target.rglob(SHELLS_TABLE):
        table: JsonObject = json.loads(file.read_text(encoding="utf-8"))
        table["notes"] = {
            **{name: note for name, note in (table.get("notes") or {}).items() if name != OUTSIDE},
            "member": f"{member.number}: {member.label}",
            **({OUTSIDE: outside} if outside else {}),
        }
        sha256 = sha256_of(building / PART_FILE)
        if table.get("part") and table["part"]["sha256"] != sha256:
            table["part"] |= {"sha256": sha256, "source": PART_FILE}
        write_json(file, table)
