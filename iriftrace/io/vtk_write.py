"""Meshes and points written as VTK's XML files, which ParaView opens."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from iriftrace.core.arrays import AnyArray
from iriftrace.core.blocks import CloudBlocks, blocks
from iriftrace.core.files import whole_file

if TYPE_CHECKING:
    import pyvista as pv


def write_vtk(
    path: str | Path, data: pv.PolyData | pv.UnstructuredGrid, *, fast: bool = False
) -> None:
    """Write a .vtp or .vtu, as the data are of one or the other kind, as in `whole_file`.

    The file is made in memory, because VTK's writers crash when the disk gets full. The `fast` kind
    is written in an eighth of the time, is up to twice as large, and is not plain XML.
    """
    import pyvista as pv
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    flat = isinstance(data, pv.PolyData)
    writer = (vtkXMLPolyDataWriter if flat else vtkXMLUnstructuredGridWriter)()
    writer.SetInputData(data)
    if fast:
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToLZ4()
    else:
        writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    made: str | bytes = writer.GetOutputString()
    with whole_file(path) as temporary:
        temporary.write_bytes(made if isinstance(made, bytes) else made.encode())


def write_vtp_blocks(path: Path, cloud: CloudBlocks, texts: Mapping[str, str]) -> None:
    """Write the rows of a cloud as a .vtp.

    Each array is compressed by itself, so that no more than one is in memory. Coordinates that are
    not finite, which ParaView and this program take for damage, are 0. `texts` are field data.
    """
    count, of = cloud.count, cloud.of
    names = list(of(slice(0, 0))[1])

    def places(rows: slice) -> AnyArray:
        points = of(rows)[0]
        return np.where(np.isfinite(points), points, 0.0)

    def column(name: str, rows: slice) -> AnyArray:
        return of(rows)[1][name]

    # Each point is a cell of its own, so that programs draw it.
    corners = {
        "connectivity": lambda rows: np.arange(rows.start, rows.stop),
        "offsets": lambda rows: np.arange(rows.start, rows.stop) + 1,
    }
    with whole_file(path) as temporary, temporary.open("wb") as file:
        file.write(
            b'<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
            b'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<PolyData>\n<FieldData>\n'
        )
        for name, text in texts.items():
            letters = " ".join(map(str, (*text.encode(), 0)))
            head = f'type="String" Name={quoteattr(name)} NumberOfTuples="1" format="ascii"'
            file.write(f"<Array {head}>{letters}</Array>\n".encode())
        file.write(
            f'</FieldData>\n<Piece NumberOfPoints="{count}" NumberOfVerts="{count}">\n'
            "<PointData>\n".encode()
        )
        for name in names:
            _write_array(file, name, count, partial(column, name))
        file.write(b"</PointData>\n<Points>\n")
        _write_array(file, "Points", count, places)
        file.write(b"</Points>\n<Verts>\n")
        for name, values in corners.items():
            _write_array(file, name, count, values)
        file.write(b"</Verts>\n</Piece>\n</PolyData>\n</VTKFile>\n")


def _write_array(file: IO[bytes], name: str, count: int, of: Callable[[slice], AnyArray]) -> None:
    """Write an array as base64 of zlib's blocks, after base64 of their number and sizes."""
    none = of(slice(0, 0))
    kind = np.dtype(np.uint8) if none.dtype == bool else none.dtype.newbyteorder("<")
    packed, lengths = [], []
    for rows in blocks(count):
        raw = np.ascontiguousarray(of(rows), dtype=kind).tobytes()
        packed.append(zlib.compress(raw, 1))
        lengths.append(len(raw))
    # The last size is 0 if the last block is as large as the others.
    sizes = [len(packed), lengths[0], lengths[-1] % lengths[0], *map(len, packed)]
    word = {"f": "Float", "i": "Int", "u": "UInt"}[kind.kind] + str(8 * kind.itemsize)
    width = f' NumberOfComponents="{none.shape[1]}"' if none.ndim == 2 else ""
    file.write(f'<DataArray type="{word}" Name={quoteattr(name)}{width} format="binary">'.encode())
    file.write(base64.b64encode(np.array(sizes, dtype="<u8").tobytes()))
    rest = b""
    for block in packed:
        # Three bytes are four characters.
        whole = rest + block
        cut = len(whole) - len(whole) % 3
        file.write(base64.b64encode(whole[:cut]))
        rest = whole[cut:]
    file.write(base64.b64encode(rest) + b"</DataArray>\n")
