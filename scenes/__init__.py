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
    from iriftrace.core.errors import InputError

    if name not in names():
        raise InputError(f"There is no bundled scene '{name}'; there are {', '.join(names())}.")
    return Path(__file__).parent / name


def shells_of(name: str) -> Path:
    """Folder of the shells that a bundled scene uses: its own, or those of another scene."""
    import re

    folder = folder_of(name)
    text = (folder / "scene.xml").read_text(encoding="utf-8")
    first = re.search(r'value="([^"]*)/shell_\d+\.ply"', text)
    return (folder / (first[1] if first else "shells")).resolve()
