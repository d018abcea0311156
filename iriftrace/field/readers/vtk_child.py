"""Child process that reads files with VTK, whose readers may end the process on damaged ones.

`iriftrace.field.readers.vtk_process` calls its readers through `iriftrace.core.child`. They import
nothing of pyvista: that would take longer than to read most files. A data set goes to the parent
as plain values and arrays.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules import vtkCommonDataModel as model
from vtkmodules import vtkIOXML
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringArray, vtkStringOutputWindow

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


def _array(array: Any) -> NDArray[Any]:
    return np.zeros(0) if array is None else _to_numpy(array)


def read_file(path: str, suffix: str) -> Any:
    """A file of one of VTK's own formats, as its suffix says."""
    if suffix == ".vtk":
        from vtkmodules.vtkIOLegacy import vtkDataSetReader

        reader = vtkDataSetReader()
        for kind in _LEGACY:
            getattr(reader, f"ReadAll{kind}On")()
    else:
        reader = getattr(vtkIOXML, _XML[suffix])()
    reader.SetFileName(path)
    return _output(reader)


def read_ensight(path: str, time: str) -> Any:
    """One time of an EnSight case; its only state where `time` is empty."""
    from vtkmodules.vtkIOEnSight import vtkGenericEnSightReader

    reader = vtkGenericEnSightReader()
    reader.SetCaseFileName(path)
    reader.ReadAllVariablesOn()
    if time:
        reader.SetTimeValue(float(time))
    return _output(reader)


def read_exodus(path: str, step: int | None) -> Any:
    """One step of an Exodus file, and its times; only these where `step` is None."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
    from vtkmodules.vtkIOExodus import vtkExodusIIReader

    reader = vtkExodusIIReader()
    reader.SetFileName(path)
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.UpdateInformation()
    if not reader.GetNumberOfNodes():
        raise ValueError("VTK finds no nodes of Exodus in it")
    times = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS()) or ()
    names = [repr(float(time)) for time in times]
    if step is None:
        return _described(model.vtkMultiBlockDataSet()), names
    for kind in (reader.NODAL, reader.ELEM_BLOCK):
        reader.SetAllArrayStatus(kind, 1)
    reader.SetTimeStep(step)
    return _output(reader), names


def read_cgns(path: str, time: str | None) -> Any:
    """One time of a CGNS file, its only one where `time` is "", and all times; None: only these."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline
    from vtkmodules.vtkIOCGNSReader import vtkCGNSReader

    reader = vtkCGNSReader()
    reader.SetFileName(path)
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.UpdateInformation()
    if not reader.GetNumberOfBaseArrays():
        raise ValueError("VTK finds no base of CGNS in it")
    times = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS()) or ()
    names = [repr(float(moment)) for moment in times]
    if time is None:
        return _described(model.vtkMultiBlockDataSet()), names
    reader.EnableAllBases()
    reader.EnableAllPointArrays()
    reader.EnableAllCellArrays()
    if time:
        reader.UpdateTimeStep(float(time))
    return _output(reader), names


def _output(reader: Any) -> Any:
    """Description of what a reader has read; a ValueError with its first complaint."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.Update()
    _, error, text = window.GetOutput().partition("ERROR: ")
    if error:
        # Without the places in VTK's source and the reader's address.
        lines = [line.partition("): ")[2] or line for line in text.splitlines()[1:]]
        raise ValueError(next(filter(None, map(str.strip, lines)), "VTK says no more"))
    return _described(reader.GetOutput())


def read_case(path: str, time: str) -> Any:
    """One time of an OpenFOAM case, and the names of the fields that VTK found there.

    VTK complains of much that a case may well have; whoever asks checks what is there.
    """
    from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

    vtkOutputWindow.SetInstance(vtkStringOutputWindow())
    reader = vtkOpenFOAMReader()
    # Any name in the case's folder will do; the file itself is not looked for.
    reader.SetFileName(os.path.join(path, "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.SetCreateCellToPoint(False)
    reader.UpdateInformation()
    reader.EnableAllPatchArrays()
    reader.EnableAllCellArrays()
    reader.SetTimeValue(float(time))
    reader.Update()
    count = reader.GetNumberOfCellArrays()
    return _described(reader.GetOutput()), [reader.GetCellArrayName(k) for k in range(count)]


def _described(data: Any) -> dict[str, Any] | None:
    """A data set as plain values and arrays."""
    if data is None:
        return None
    if isinstance(data, model.vtkMultiBlockDataSet):
        count = range(data.GetNumberOfBlocks())
        known = [data.HasMetaData(k) and data.GetMetaData(k) for k in count]
        key = model.vtkCompositeDataSet.NAME()
        return {
            "kind": "blocks",
            "names": [m.Get(key) if m and m.Has(key) else None for m in known],
            "blocks": [_described(data.GetBlock(k)) for k in count],
            "field": _data_of(data.GetFieldData()),
        }
    if isinstance(data, model.vtkPartitionedDataSet | model.vtkMultiPieceDataSet):
        count = range(data.GetNumberOfPartitions())
        pieces = [_described(data.GetPartitionAsDataObject(k)) for k in count]
        return {"kind": "blocks", "names": [None] * len(pieces), "blocks": pieces, "field": {}}
    for kind, (name, describe) in _KINDS.items():
        if isinstance(data, kind):
            return {
                "kind": name,
                **describe(data),
                "point": _data_of(data.GetPointData()),
                "cell": _data_of(data.GetCellData()),
                "field": _data_of(data.GetFieldData()),
            }
    raise ValueError(f"it holds a {data.GetClassName()}, which is no mesh")


def _data_of(attributes: Any) -> dict[str, Any]:
    """Arrays of numbers, and as lists arrays of texts, by name."""
    found: dict[str, Any] = {}
    for k in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(k)
        name = array.GetName() or f"Unnamed_{k}"
        if isinstance(array, vtkStringArray):
            found[name] = [array.GetValue(i) for i in range(array.GetNumberOfValues())]
        elif attributes.GetArray(k) is not None:
            found[name] = _array(array)
    return found


def _points(data: Any) -> NDArray[Any]:
    points = data.GetPoints()
    return np.zeros((0, 3)) if points is None else _array(points.GetData())


def _cells(cells: Any) -> list[NDArray[Any]]:
    """Offsets and connectivity."""
    if cells is None:
        return [np.zeros(0), np.zeros(0)]
    return [_array(cells.GetOffsetsArray()), _array(cells.GetConnectivityArray())]


def _image(data: Any) -> dict[str, Any]:
    directions = data.GetDirectionMatrix()
    return {
        "extent": data.GetExtent(),
        "spacing": data.GetSpacing(),
        "origin": data.GetOrigin(),
        "directions": [directions.GetElement(i, j) for i in range(3) for j in range(3)],
    }


def _rectilinear(data: Any) -> dict[str, Any]:
    axes = (data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates())
    return {"dimensions": data.GetDimensions(), "axes": [_array(axis) for axis in axes]}


def _structured(data: Any) -> dict[str, Any]:
    dimensions = [0, 0, 0]
    data.GetDimensions(dimensions)
    return {"dimensions": dimensions, "points": _points(data)}


def _unstructured(data: Any) -> dict[str, Any]:
    described = {
        "points": _points(data),
        "cells": _cells(data.GetCells()),
        "types": _array(data.GetCellTypesArray()),
    }
    if data.GetPolyhedronFaces() is not None:
        described["faces"] = _cells(data.GetPolyhedronFaces())
        described["face_places"] = _cells(data.GetPolyhedronFaceLocations())
    return described


def _poly(data: Any) -> dict[str, Any]:
    cells = (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips())
    return {"points": _points(data), "cells": [_cells(c) for c in cells]}


_KINDS: dict[Any, tuple[str, Callable[[Any], dict[str, Any]]]] = {
    model.vtkImageData: ("image", _image),
    model.vtkRectilinearGrid: ("rectilinear", _rectilinear),
    model.vtkStructuredGrid: ("structured", _structured),
    model.vtkUnstructuredGrid: ("unstructured", _unstructured),
    model.vtkPolyData: ("poly", _poly),
}
