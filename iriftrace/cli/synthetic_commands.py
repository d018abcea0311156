"""The command ``iriftrace field synthetic``: hot air from formulas around any part."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from attrs import evolve
from cyclopts import Parameter

from iriftrace.cli.checks import check_input, check_output
from iriftrace.cli.console import out, working
from iriftrace.cli.options import optional_quantity, quantity
from iriftrace.cli.part_options import PartOptions

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.synthetic import AirMesh, SyntheticAir


def synthetic(
    part: Path,
    *,
    output: Annotated[Path, Parameter(name=["-o", "--output"])],
    wall_temperature: str = "1100 degC",
    ambient: str = "20 degC",
    boundary_layer: str | None = None,
    plume: float = 0.8,
    cell_size: str | None = None,
    sides: str | None = None,
    height: str | None = None,
    gradient: bool = False,
    part_options: PartOptions = PartOptions(),
) -> None:
    """Write a synthetic boundary layer and plume around a part: formulas, not a simulation.

    For tests, teaching and quick looks: shapes and orders of magnitude are right, numbers are not,
    and every result made from the file says that it is synthetic. The boundary layer falls with
    (1 - d/thickness)^2 from the wall's temperature to ambient, d being the distance to the part;
    the plume is that of a laminar line source (see iriftrace.synthetic). The mesh ends on the part
    and is fine there.

    Example: ``iriftrace field synthetic part.ply -o field.vtu --wall-temperature "900 degC"``

    Parameters
    ----------
    part
        The part's mesh (.ply .stl .obj .glb ...), closed.
    output
        The field's file, .vtu: mm, array T in K.
    wall_temperature
        Temperature of the part.
    ambient
        Temperature of the room.
    boundary_layer
        Thickness of the boundary layer; by default that of laminar convection at the part's size.
    plume
        Excess temperature of the plume above the part's top, as a share of the wall's; 0 for none.
    cell_size
        Size of the cells at the wall; by default a fifth of the boundary layer.
    sides
        Air beside and below the part; by default as far as it is warm.
    height
        Air above the part, beyond which the plume is cut off.
    gradient
        Add the analytic gradient as array grad_T, K/mm.
    """
    from iriftrace.synthetic import synthetic_air, usual_mesh, write_synthetic_field

    check_input(part)
    check_output(output, ".vtu", "field.vtu", make=False)
    wall_k = quantity(wall_temperature, "kelvin", "--wall-temperature")
    ambient_k = quantity(ambient, "kelvin", "--ambient")
    air = synthetic_air(
        part_options.read(part),
        wall_k=wall_k,
        ambient_k=ambient_k,
        boundary_layer_mm=optional_quantity(boundary_layer, "mm", "--boundary-layer"),
        plume=plume,
    )
    size = usual_mesh(air)
    wanted = {
        "cell_mm": optional_quantity(cell_size, "mm", "--cell-size"),
        "sides_mm": optional_quantity(sides, "mm", "--sides"),
        "height_mm": optional_quantity(height, "mm", "--height"),
    }
    size = evolve(size, **{key: value for key, value in wanted.items() if value is not None})
    with working("Meshing the air"):
        grid = write_synthetic_field(output, air, size, gradient=gradient)
    _print_field(air, size, grid)
    out.print(
        f"Field in {output}; now run:  iriftrace scene {output} {part} -o scene/scene.xml "
        f'--ambient "{ambient}"',
        markup=False,
        soft_wrap=True,
    )


def _print_field(air: SyntheticAir, size: AirMesh, grid: pv.UnstructuredGrid) -> None:
    temperature = np.asarray(grid.point_data["T"])
    out.print(air.origin, markup=False, soft_wrap=True)
    out.print(
        f"  {grid.n_points:,} points, {grid.n_cells:,} cells, {size.cell_mm:.3g} mm at the wall; "
        f"air {size.sides_mm:.3g} mm beside and below the part and {size.height_mm:.3g} mm above",
        soft_wrap=True,
    )
    out.print(f"  T from {temperature.min():.6g} K to {temperature.max():.6g} K")
