"""Status of every ray in every bundled scene."""

from __future__ import annotations

from pathlib import Path

from iriftrace.image.aov_image import Status
from iriftrace.scenes import folder_of, names
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from validation.line import Line, Section

MOST_MISCOUNTED_PERCENT = 0.01

THROUGH_CELLS = ("hot_plate",)
"""Rays along its wall enter its shells at their open ends, where none tells the layer."""


def _lines(folder: Path) -> list[Line]:
    lines = []
    for name in names():
        engine = "cells" if name in THROUGH_CELLS else "shells"
        scene = load_scene(folder_of(name) / "scene.xml", engine=engine)
        image = pose_image(scene)
        counts = {status.key: int((image.status == status).sum()) for status in Status}
        launched, hit = image.status.size, int((image.channels["part.face"] > 0).sum())
        ending = ", ".join(f"{count:,} {key}" for key, count in counts.items())
        lines.append(
            Line(
                f"{name}: rays without a status",
                f"{launched:,} launched",
                ending,
                launched - sum(counts.values()),
                0,
                "rays",
            )
        )
        share = 100 * (counts["gave_up"] + counts["index_mismatch"]) / hit
        lines.append(
            Line(
                f"{name}: hits given up, or with index steps that do not add up",
                "0",
                f"{share:.4f} %",
                share,
                MOST_MISCOUNTED_PERCENT,
            )
        )
    return lines


SECTION = Section(
    "ledger",
    "Every ray has an end",
    "The bundled scenes as they are, the hot plate through its cells, as `render` chooses; what "
    "becomes of each ray is in channel `status.code`.",
    _lines,
)
