"""Bodies around which a field was solved, from the files next to it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import warn
from iriftrace.io.named_files import BODIES
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part


def bodies_beside(
    field: IndexField, given: Collection[str] = (), transform: FloatArray | None = None
) -> list[Part]:
    """Bodies around which a field was solved, without those with `given` names; warns of missing.

    Their files lie next to the field's; `transform` (4, 4) is that of the field to the world.
    """
    names = (name for name in field.source.facts.bodies if name not in given)
    files = {name: Path(field.source.path).parent / BODIES / f"{name}.stl" for name in names}
    if missing := [str(file) for file in files.values() if not file.is_file()]:
        warn(
            f"The field {field.source.path} was solved around bodies that are missing next to it "
            f"({', '.join(missing)}): they do not block the view, and their walls count as gaps of "
            "the part; copy the folder along with the field."
        )
    present = (file for file in files.values() if file.is_file())
    return [read_part(file, ReadPart(length_unit="mm", transform=transform)) for file in present]
