"""The hot block as the inputs of a study: field, part and a small picture of it."""

from __future__ import annotations

from pathlib import Path

from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.index_field import IndexField
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from validation.inputs import hot_block
from validation.inputs.cameras import camera_at


def field_and_scene(folder: Path, variant: str, cells: int = 18) -> tuple[IndexField, Scene]:
    """The block of ``hot_block``, its air with ``cells`` cells along each edge, 60 x 50 pixels."""
    _, part = hot_block.save(folder)
    air = folder / f"air_{cells}.vtu"
    hot_block.air(cells).save(air)
    camera = camera_at(
        (60.0, -45.0, 70.0), focal_length_mm=20.0, resolution=(60, 50), focus_mm=(50.0, 250.0)
    )
    field = read_field(air)
    return field, Scene(read_part(part), HotAir(field), camera, variant=variant)
