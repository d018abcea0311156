"""Writes ``docs/parts.md``: ``python -m validation.statements [SCENE ...] [-o FILE]``."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from iriftrace.core.runtime.variant import ensure
from scenes.generators.bevel_gear import TOOTH
from scenes.generators.components import TOOTH_NUMBER, TOOTH_SCENE
from validation.statements import gear, hybrid, wishbone
from validation.statements.orbit import sweep_around
from validation.statements.page import Section, page_text, picture_name, write
from validation.statements.picture import draw_best_pose, draw_faces

PAGE = Path(__file__).parents[2] / "docs" / "parts.md"

SECTIONS = (
    Section(
        "hybrid_cylinder",
        "Hybrid cylinder",
        "27 mm x 170 mm along x; 450 °C at x < 0, 1100 °C at x > 0, changing over about 10 mm.",
        hybrid.findings,
        stand_off_mm=200.0,
    ),
    Section(
        "bevel_gear",
        "Bevel gear",
        "20 teeth, 62 mm, axis upright, hub below, bore open, 1100 °C.",
        gear.findings,
        stand_off_mm=150.0,
    ),
    Section(
        "wishbone",
        "Wishbone",
        "180 mm x 120 mm x 28 mm in the xy plane, ball hub at +y, 1100 °C.",
        wishbone.findings,
        stand_off_mm=250.0,
    ),
    Section(
        TOOTH_SCENE,
        "One tooth of the gear",
        f"The gear's air; tooth {TOOTH_NUMBER}, towards +x, is what is looked at and ranked.",
        gear.tooth_findings,
        stand_off_mm=110.0,
        region=TOOTH,
        picture="what the best pose sees",
    ),
)


def main() -> None:
    """Sweep, judge, draw and write."""
    parser = argparse.ArgumentParser(prog="python -m validation.statements", description=__doc__)
    names = [section.scene for section in SECTIONS]
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(names))
    parser.add_argument("-o", "--output", type=Path, help="by default docs/parts.md, if whole")
    parser.add_argument("--sweeps", type=Path, help="folder in which sweeps are kept and reused")
    parser.add_argument("--variant")
    given = parser.parse_args()
    if unknown := set(given.scenes) - set(names):
        parser.error(f"there is no scene {', '.join(sorted(unknown))}; choose of {names}")
    chosen = [s for s in SECTIONS if not given.scenes or s.scene in given.scenes]
    page = given.output or (PAGE.with_name("parts-part.md") if given.scenes else PAGE)
    variant = ensure(given.variant)
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = given.sweeps or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        for section in chosen:
            target = gear.target() if section.region == TOOTH else None
            swept = sweep_around(
                section.scene, folder, stand_off_mm=section.stand_off_mm, target=target
            )
            found.append((section, section.findings(swept)))
            picture = page.with_name(picture_name(section))
            if section.region == TOOTH:
                draw_best_pose(swept, picture, TOOTH)
            else:
                draw_faces(swept, picture)
            for finding in found[-1][1]:
                print(f"{section.title}: {finding.statement}: {finding.holds}")
    write(page, page_text(found, variant))
    print(page)


if __name__ == "__main__":
    main()
