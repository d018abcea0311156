"""Child process that reads files with VTK, whose readers may end the process on damaged ones.

Run by `iriftrace.field.readers.vtk_process`. It imports VTK once and forks for every request, so
that what one file does to the process is gone with it. Nothing of pyvista is imported here: that
would take longer than to read most files.

A data set goes to the parent as one line of JSON that names its arrays, and the arrays' bytes.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from vtkmodules import vtkCommonDataModel as model
from vtkmodules import vtkIOXML
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringArray, vtkStringOutputWindow

from iriftrace.core.child import limit_process

_XML = {
    ".vtu": "vtkXMLUnstructuredGridReader",
    ".pvtu": "vtkXMLPUnstructuredGridReader",
    ".vtp": "vtkXMLPolyDataReader",
    ".vti": "vtkXMLImageDataReader",
    ".vtr": "vtkXMLRectilinearGridReader",
    ".vts": "vtkXMLStructuredGridReader",
    ".vtm": "vtkXMLMultiBlockDataReader",
}

_LEGACY = ("Scalars", "ColorScalars", "Normals", "TCoords", "Vectors", "Fields", "Tensors")

# VTK's module has no types.
_to_numpy: Callable[[Any], NDArray[Any]] = vtk_to_numpy

Request = dict[str, Any]


Arrays = list[NDArray[Any]]
"""Arrays in the order in which they are sent, each known by its number."""


def _number(array: Any, arrays: Arrays) -> int | None:
    """Number of an array; None for one that is not there."""
    if array is None:
        return None
    arrays.append(np.ascontiguousarray(_to_numpy(array)))
    return len(arrays) - 1


def _read_file(request: Request) -> Any:
    """A file of one of VTK's own formats, as its suffix says."""
    if request["suffix"] == ".vtk":
        from vtkmodules.vtkIOLegacy import vtkDataSetReader

        reader = vtkDataSetReader()
        for kind in _LEGACY:
            getattr(reader, f"ReadAll{kind}On")()
    else:
        reader = getattr(vtkIOXML, _XML[request["suffix"]])()
    reader.SetFileName(request["path"])
    return _output(reader)


def _read_ensight(request: Request) -> Any:
    """One time of an EnSight case; its only state where `time` is empty."""
    from vtkmodules.vtkIOEnSight import vtkGenericEnSightReader

    reader = vtkGenericEnSightReader()
    reader.SetCaseFileName(request["path"])
    reader.ReadAllVariablesOn()
    if request["time"]:
        reader.SetTimeValue(float(request["time"]))
    return _output(reader)


def _read_exodus(request: Request) -> Any:
    """One step of an Exodus file, and its times; only these where `step` is empty."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
    from vtkmodules.vtkIOExodus import vtkExodusIIReader

    reader = vtkExodusIIReader()
    reader.SetFileName(request["path"])
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.UpdateInformation()
    if not reader.GetNumberOfNodes():
        raise ValueError("VTK finds no nodes of Exodus in it")
    times = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS()) or ()
    request["named"] = [repr(float(time)) for time in times]
    if not request["step"]:
        return model.vtkMultiBlockDataSet()
    for kind in (reader.NODAL, reader.ELEM_BLOCK):
        reader.SetAllArrayStatus(kind, 1)
    reader.SetTimeStep(int(request["step"]))
    return _output(reader)


def _read_cgns(request: Request) -> Any:
    """One time of a CGNS file, its only one where `time` is empty, and all times; "none": these."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
    from vtkmodules.vtkIOCGNSReader import vtkCGNSReader

    reader = vtkCGNSReader()
    reader.SetFileName(request["path"])
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.UpdateInformation()
    if not reader.GetNumberOfBaseArrays():
        raise ValueError("VTK finds no base of CGNS in it")
    times = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS()) or ()
    request["named"] = [repr(float(time)) for time in times]
    if request["time"] == "none":
        return model.vtkMultiBlockDataSet()
    reader.EnableAllBases()
    reader.EnableAllPointArrays()
    reader.EnableAllCellArrays()
    if request["time"]:
        reader.UpdateTimeStep(float(request["time"]))
    return _output(reader)


def _output(reader: Any) -> Any:
    """What a reader has read; a ValueError with its first complaint."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.Update()
    _, error, text = window.GetOutput().partition("ERROR: ")
    if error:
        # Without the places in VTK's source and the reader's address.
        lines = [line.partition("): ")[2] or line for line in text.splitlines()[1:]]
        raise ValueError(next(filter(None, map(str.strip, lines)), "VTK says no more"))
    return reader.GetOutput()


def _read_case(request: Request) -> Any:
    """One time of an OpenFOAM case, and the names of the fields that VTK found there.

    VTK complains of much that a case may well have; whoever asks checks what is there.
    """
    from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

    vtkOutputWindow.SetInstance(vtkStringOutputWindow())
    reader = vtkOpenFOAMReader()
    # Any name in the case's folder will do; the file itself is not looked for.
    reader.SetFileName(os.path.join(request["path"], "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.SetCreateCellToPoint(False)
    reader.UpdateInformation()
    reader.EnableAllPatchArrays()
    reader.EnableAllCellArrays()
    reader.SetTimeValue(float(request["time"]))
    reader.Update()
    count = reader.GetNumberOfCellArrays()
    request["named"] = [reader.GetCellArrayName(k) for k in range(count)]
    return reader.GetOutput()


_READERS: dict[str, Callable[[Request], Any]] = {
    "file": _read_file,
    "case": _read_case,
    "cgns": _read_cgns,
    "ensight": _read_ensight,
    "exodus": _read_exodus,
}


def _described(data: Any, arrays: Arrays) -> dict[str, Any] | None:
    """A data set as plain values; its arrays by type and shape."""
    if data is None:
        return None
    if isinstance(data, model.vtkMultiBlockDataSet):
        count = range(data.GetNumberOfBlocks())
        known = [data.HasMetaData(k) and data.GetMetaData(k) for k in count]
        key = model.vtkCompositeDataSet.NAME()
        return {
            "kind": "blocks",
            "names": [m.Get(key) if m and m.Has(key) else None for m in known],
            "blocks": [_described(data.GetBlock(k), arrays) for k in count],
            "field": _data_of(data.GetFieldData(), arrays),
        }
    if isinstance(data, model.vtkPartitionedDataSet | model.vtkMultiPieceDataSet):
        count = range(data.GetNumberOfPartitions())
        pieces = [_described(data.GetPartitionAsDataObject(k), arrays) for k in count]
        return {"kind": "blocks", "names": [None] * len(pieces), "blocks": pieces, "field": {}}
    for kind, (name, describe) in _KINDS.items():
        if isinstance(data, kind):
            return {
                "kind": name,
                **describe(data, arrays),
                "point": _data_of(data.GetPointData(), arrays),
                "cell": _data_of(data.GetCellData(), arrays),
                "field": _data_of(data.GetFieldData(), arrays),
            }
    raise ValueError(f"it holds a {data.GetClassName()}, which is no mesh")


def _data_of(attributes: Any, arrays: Arrays) -> dict[str, Any]:
    """Arrays of numbers, and as lists arrays of texts, by name."""
    found: dict[str, Any] = {}
    for k in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(k)
        name = array.GetName() or f"Unnamed_{k}"
        if isinstance(array, vtkStringArray):
            found[name] = [array.GetValue(i) for i in range(array.GetNumberOfValues())]
        elif attributes.GetArray(k) is not None:
            found[name] = _number(array, arrays)
    return found


def _points(data: Any, arrays: Arrays) -> int | None:
    points = data.GetPoints()
    return None if points is None else _number(points.GetData(), arrays)


def _cells(cells: Any, arrays: Arrays) -> list[Any] | None:
    """Offsets and connectivity."""
    if cells is None:
        return None
    return [_number(cells.GetOffsetsArray(), arrays), _number(cells.GetConnectivityArray(), arrays)]


def _image(data: Any, arrays: Arrays) -> dict[str, Any]:
    directions = data.GetDirectionMatrix()
    return {
        "extent": data.GetExtent(),
        "spacing": data.GetSpacing(),
        "origin": data.GetOrigin(),
        "directions": [directions.GetElement(i, j) for i in range(3) for j in range(3)],
    }


def _rectilinear(data: Any, arrays: Arrays) -> dict[str, Any]:
    axes = (data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates())
    return {"dimensions": data.GetDimensions(), "axes": [_number(axis, arrays) for axis in axes]}


def _structured(data: Any, arrays: Arrays) -> dict[str, Any]:
    dimensions = [0, 0, 0]
    data.GetDimensions(dimensions)
    return {"dimensions": dimensions, "points": _points(data, arrays)}


def _unstructured(data: Any, arrays: Arrays) -> dict[str, Any]:
    described = {
        "points": _points(data, arrays),
        "cells": _cells(data.GetCells(), arrays),
        "types": _number(data.GetCellTypesArray(), arrays),
    }
    if data.GetPolyhedronFaces() is not None:
        described["faces"] = _cells(data.GetPolyhedronFaces(), arrays)
        described["face_places"] = _cells(data.GetPolyhedronFaceLocations(), arrays)
    return described


def _poly(data: Any, arrays: Arrays) -> dict[str, Any]:
    cells = (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips())
    return {"points": _points(data, arrays), "cells": [_cells(c, arrays) for c in cells]}


_KINDS: dict[Any, tuple[str, Callable[[Any, Arrays], dict[str, Any]]]] = {
    model.vtkImageData: ("image", _image),
    model.vtkRectilinearGrid: ("rectilinear", _rectilinear),
    model.vtkStructuredGrid: ("structured", _structured),
    model.vtkUnstructuredGrid: ("unstructured", _unstructured),
    model.vtkPolyData: ("poly", _poly),
}


def _answer(request: Request, out: BinaryIO) -> None:
    arrays: Arrays = []
    try:
        data = _described(_READERS[request["reader"]](request), arrays)
        head: dict[str, Any] = {"data": data, "named": request.get("named", [])}
    except (ValueError, MemoryError) as error:
        arrays, head = [], {"error": str(error) or "it needs more memory than it may take"}
    head["arrays"] = [(array.dtype.str, array.shape) for array in arrays]
    out.write(json.dumps(head).encode("ascii") + b"\n")
    for array in arrays:
        out.write(array.data if array.size else b"")


def serve(channel: socket.socket) -> None:
    """Fork for each request, and say how its process ended."""
    while True:
        line, descriptors, _, _ = socket.recv_fds(channel, 1 << 16, 1)
        if not line:
            return
        child = os.fork()
        if child == 0:
            try:
                request = json.loads(line)
                limit_process(request["memory"], request["seconds"])
                with open(descriptors[0], "wb") as out:
                    _answer(request, out)
                # Without the clean-up of an interpreter that shares its parent's state.
                os._exit(0)
            finally:
                os._exit(1)
        os.close(descriptors[0])
        _, status = os.waitpid(child, 0)
        channel.sendall(status.to_bytes(4, "little"))


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))
