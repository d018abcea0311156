"""Effect of wavelength and pressure on the displacement."""

from __future__ import annotations

from pathlib import Path

from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.write import write_scene
from validation.line import Line, Section

AIRS = {
    "450 nm": Air(wavelength_nm=450),
    "532 nm": Air(wavelength_nm=532),
    "850 nm": Air(wavelength_nm=850),
    "90 kPa": Air(pressure_pa=90e3),
}
BOUND_PERCENT = 0.1


def median_um(folder: Path, air: Air) -> float:
    """Median displacement in the bundled cylinder's pose, a quarter of the resolution."""
    cylinder = folder_of("cylinder")
    camera = load_scene(folder_of("cylinder_paper") / "scene.xml").camera
    shells = contour_shells(read_field(cylinder / "field.vtu", air=air))
    scene = write_scene(folder, read_part(cylinder / "part.ply"), shells, camera, paraview=False)
    metrics = render_scene(load_scene(scene, {"scale": 0.25})).metrics
    return 1e3 * float(metrics.displacement_mm.median)


def _lines(folder: Path) -> list[Line]:
    usual = Air()
    reference = median_um(folder / "usual", usual)
    lines = [Line("633 nm, 101.325 kPa: median displacement", "", f"{reference:.4f} µm")]
    for number, (name, air) in enumerate(AIRS.items()):
        expected = air.ambient_refractivity / usual.ambient_refractivity
        found = median_um(folder / str(number), air) / reference
        lines.append(
            Line(
                f"{name}: median displacement over that at 633 nm and 101.325 kPa",
                f"{expected:.5f} (ratio of n - 1)",
                f"{found:.5f}",
                100 * (found / expected - 1),
                BOUND_PERCENT,
            )
        )
    return lines


SECTION = Section(
    "air",
    "Wavelength and pressure",
    "The bundled cylinder with other air. Deflection is proportional to n - 1 (Ciddor 1996) as "
    "long as it is small, so the displacements must have the ratio of the refractivities.",
    _lines,
)
