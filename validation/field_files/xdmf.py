"""XDMF files with their arrays in HDF5: one grid, or as FEniCS writes them, mesh and functions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
import pyvista as pv
from numpy.typing import NDArray

_KINDS = {10: "Tetrahedron", 12: "Hexahedron"}
_MESH = (
    '<xi:include xpointer="xpointer(/Xdmf/Domain/Grid[1]/*[self::Topology or self::Geometry])"/>'
)


def write(
    path: Path, grid: pv.UnstructuredGrid, later: Sequence[tuple[float, NDArray[np.float64]]] = ()
) -> Path:
    """Write a grid of one cell type with its point arrays.

    With `later`, the arrays are at t = 0, and `later` has the first array's values at other times;
    the mesh is then a grid of its own and each array a collection, as dolfinx writes them.
    """
    ((kind, cells),) = grid.cells_dict.items()
    heavy = path.with_suffix(".h5")
    with h5py.File(heavy, "w") as file:

        def item(name: str, values: NDArray[np.generic]) -> str:
            file[name] = values
            size = " ".join(map(str, values.shape))
            number = "Float" if values.dtype.kind == "f" else "Int"
            return (
                f'<DataItem Dimensions="{size}" Format="HDF" NumberType="{number}" '
                f'Precision="{values.dtype.itemsize}">{heavy.name}:/{name}</DataItem>'
            )

        def attribute(name: str, step: int, values: NDArray[np.generic]) -> str:
            what = "Scalar" if values.ndim == 1 else "Vector"
            return (
                f'<Attribute Name="{name}" AttributeType="{what}" Center="Node">'
                f"{item(f'{name}/{step}', values)}</Attribute>"
            )

        mesh = (
            f'<Topology TopologyType="{_KINDS[kind]}" NumberOfElements="{len(cells)}">'
            f"{item('cells', cells)}</Topology>"
            f'<Geometry GeometryType="XYZ">{item("points", np.asarray(grid.points))}</Geometry>'
        )
        arrays = {name: np.asarray(values) for name, values in grid.point_data.items()}
        if later:
            grids = f'<Grid Name="mesh" GridType="Uniform">{mesh}</Grid>'
            times = [[(0.0, values)] for values in arrays.values()]
            times[0] += later
            for name, states in zip(arrays, times, strict=True):
                steps = "".join(
                    f'<Grid Name="{name}" GridType="Uniform">{_MESH}<Time Value="{time}"/>'
                    f"{attribute(name, step, values)}</Grid>"
                    for step, (time, values) in enumerate(states)
                )
                grids += f'<Grid GridType="Collection" CollectionType="Temporal">{steps}</Grid>'
        else:
            values = "".join(attribute(name, 0, values) for name, values in arrays.items())
            grids = f'<Grid Name="air" GridType="Uniform">{mesh}{values}</Grid>'
    path.write_text(
        '<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n'
        '<Xdmf Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude">\n'
        f"<Domain>{grids}</Domain>\n</Xdmf>\n",
        encoding="utf-8",
    )
    return path
