"""Bundled scenes: one folder each with ``scene.xml``, its meshes and a README line."""

from __future__ import annotations

from pathlib import Path


def names() -> tuple[str, ...]:
    """Names of the bundled scenes."""
    root = Path(__file__).parent
    return tuple(sorted(path.parent.name for path in root.glob("*/scene.xml")))


def folder_of(name: str) -> Path:
    """Folder of a bundled scene.

    Raises
    ------
    InputError
        If there is no scene of this name.
    """
    from iriftrace.errors import InputError

    if name not in names():
        raise InputError(f"There is no bundled scene '{name}'; there are {', '.join(names())}.")
    return Path(__file__).parent / name
