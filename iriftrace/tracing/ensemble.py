"""The members of an ensemble's scene: their fields and the places of their files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import write_json
from iriftrace.core.plain import structured
from iriftrace.io.refusals import damaged
from iriftrace.tracing.file import parameters_of, read_xml
from iriftrace.tracing.hot_air import FieldMember, weights_of

MEMBER = "member"
"""Parameter of an ensemble's scene: number of the member that is traced alone, from 1."""

FOLDER = "members"
"""Folder next to the scene's XML, with a folder for each member, named by its number."""

TABLE = "members.json"
INCLUDED = "shells.xml"
SCHEMA = "iriftrace.members/1"


def member_folder(scene: Path, number: int | str) -> Path:
    """Folder of one member's shells and field, next to the scene's XML file."""
    return scene.parent / FOLDER / str(number)


def is_ensemble(scene: Path) -> bool:
    """True if a scene's XML file has the parameter ``member``; InputError if it is no scene."""
    return MEMBER in parameters_of(read_xml(scene))


def read_members(scene: Path) -> tuple[FieldMember, ...]:
    """Members of an ensemble's scene, as its table lists them.

    Raises InputError if the table is missing or damaged, or names members without shells.
    """
    path = scene.parent / FOLDER / TABLE
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
        if table["schema"] != SCHEMA:
            raise ValueError(f"schema {table['schema']!r}")
        members = structured(table["members"], tuple[FieldMember, ...])
        weights_of(members)
        if [member.number for member in members] != list(range(1, len(members) + 1)):
            raise ValueError("its numbers are not 1, 2 ...")
    except (OSError, ValueError, KeyError, TypeError) as error:
        remedy = f"write the scene of the ensemble again, or choose one member ({MEMBER}=1)"
        raise damaged(path, error, remedy, argument="define") from error
    if len(members) < 2:
        raise InputError(
            f"{path} lists {len(members)} members, but scatter needs at least two.",
            code="scene.one_field",
        )
    for member in members:
        shells = member_folder(scene, member.number) / INCLUDED
        if not shells.is_file():
            raise InputError(
                f"{path} lists the member {member.number}, but {shells} is missing; write the "
                "scene again.",
                code="file.missing",
            )
    return members


def write_members(folder: Path, members: tuple[FieldMember, ...]) -> None:
    """Write the table that `read_members` reads into the folder of the members."""
    table = {"schema": SCHEMA, "members": [member.as_dict() for member in members]}
    write_json(folder / TABLE, table)


def members_of(scene: Path, values: Mapping[str, str]) -> tuple[FieldMember, ...]:
    """Members to trace together; none if one was chosen or the scene has one field.

    Raises InputError as `read_members`, and if the chosen member does not exist.
    """
    if not is_ensemble(scene):
        return ()
    if MEMBER not in values:
        return read_members(scene)
    number = str(values[MEMBER])
    # Another path to the same folder, ./1, would have results name a member that is not listed.
    if not (number.isdecimal() and (member_folder(scene, number) / INCLUDED).is_file()):
        raise InputError(
            f'{scene} has no member "{number}"; give {MEMBER}=1 to '
            f"{MEMBER}={len(read_members(scene))}, or leave it out to trace them all.",
            code="scene.unknown_member",
            argument="define",
        )
    return ()


def member_files(scene: Path) -> tuple[Path, ...]:
    """The table, and the files that the scene includes for each member."""
    folder = scene.parent / FOLDER
    included = [member_folder(scene, m.number) / INCLUDED for m in read_members(scene)]
    return (folder / TABLE, *included)
