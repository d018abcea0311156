"""Bundled scenes: one folder each with ``scene.xml``, its meshes and a README line."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def names() -> tuple[str, ...]:
    """Names of the bundled scenes."""
    root = Path(__file__).parent
    return tuple(sorted(path.parent.name for path in root.glob("*/scene.xml")))


def folder_of(name: str) -> Path:
    """Folder of a bundled scene; InputError if there is none of this name."""
    from iriftrace.core.errors import InputError

    if name not in names():
        raise InputError(
            f"There is no bundled scene '{name}'; there are {', '.join(names())}.",
            code="scenes.unknown_name",
        )
    return Path(__file__).parent / name


def shells_of(name: str) -> Path:
    """Folder of the shells that a bundled scene uses: its own, or those of another scene."""
    from iriftrace.tracing.outline import outermost_surface

    return outermost_surface(folder_of(name) / "scene.xml").parent.resolve()


@contextmanager
def scene_copied(name: str, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Copy a bundled scene to a folder of the user's; removed again if the block fails.

    Yields the copy's XML file and the folder of its shells. A copy that was not changed since is
    replaced, one that was raises InputError. Shells of another scene, which some use, go beside it.
    """
    from iriftrace.tracing.xml import refuse_edited

    bundled, bundled_shells = folder_of(name).resolve(), shells_of(name)
    xml = folder / "scene.xml"
    refuse_edited(xml)
    home = (
        folder if bundled_shells.parent == bundled else folder.parent / bundled_shells.parent.name
    )
    shells = home / bundled_shells.name
    places = (folder, *folder.parents, shells, *shells.parents)
    missing = [path for path in places if not path.exists()]
    try:
        for source, target in ((bundled, folder), (bundled_shells, shells)):
            shutil.copytree(source, target, dirs_exist_ok=True, copy_function=shutil.copyfile)
        yield xml, shells
    except BaseException:
        for path in missing:
            shutil.rmtree(path, ignore_errors=True)
        raise
