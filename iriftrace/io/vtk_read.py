"""Child process that reads files with VTK, whose readers can crash on damaged files.

`iriftrace.io.vtk_check` calls its readers through `iriftrace.core.isolated`. The child
does not import pyvista, which would take longer than reading most files. A data set is sent to the
parent as plain values and arrays.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from typing import Any, Protocol, Required, TypedDict
from xml.etree import ElementTree

import numpy as np
from vtkmodules import vtkCommonDataModel as model
from vtkmodules import vtkIOXML
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import (
    vtkDataArray,
    vtkOutputWindow,
    vtkStringArray,
    vtkStringOutputWindow,
)
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkStreamingDemandDrivenPipeline

from iriftrace.core.arrays import AnyArray

_XML = {
    ".vtu": "vtkXMLUnstructuredGridReader",
    ".pvtu": "vtkXMLPUnstructuredGridReader",
    ".vtp": "vtkXMLPolyDataReader",
    ".vti": "vtkXMLImageDataReader",
    ".vtr": "vtkXMLRectilinearGridReader",
    ".vts": "vtkXMLStructuredGridReader",
    ".vtm": "vtkXMLMultiBlockDataReader",
}

_TEXT = re.compile(rb"[^\n]*\n[^\n]*\n\s*ascii\b", re.IGNORECASE)
_END = b"\n\nFIELD end 0\n"
"""Empty entry behind text in VTK's old format: numbers that end before it are an error. Where the
file ends instead, VTK leaves in the array whatever the memory held."""

_LEGACY = ("Scalars", "ColorScalars", "Normals", "TCoords", "Vectors", "Fields", "Tensors")


Arrays = dict[str, AnyArray | list[str]]
"""Arrays of numbers, and as lists arrays of texts, by name."""

Cells = list[AnyArray]
"""Offsets and connectivity."""


class Described(TypedDict, total=False):
    """A data set, or a tree of blocks, as plain values and arrays."""

    kind: Required[str]  # determines which of the other entries there are
    names: list[str | None]  # of blocks
    blocks: list[Described | None]
    field: Arrays
    point: Arrays
    cell: Arrays
    points: AnyArray
    cells: list[Cells]  # of surfaces: vertices, lines, polygons and strips
    types: AnyArray  # of cells
    faces: Cells  # of polyhedra
    face_places: Cells
    dimensions: Sequence[int]
    axes: list[AnyArray]
    extent: Sequence[int]
    spacing: Sequence[float]
    origin: Sequence[float]
    directions: Sequence[float]  # row by row


Answer = tuple[Described | None, list[str]]
"""The data, and names of what the file contains: times, or fields of an OpenFOAM case."""


class _Reader(Protocol):
    def Update(self) -> object: ...
    def UpdateTimeStep(self, time: float) -> object: ...
    def GetOutput(self) -> model.vtkDataObject | None: ...


# VTK's module has no types.
_to_numpy: Callable[[vtkDataArray], AnyArray] = vtk_to_numpy


def _array(array: vtkDataArray | None) -> AnyArray:
    return np.zeros(0) if array is None else _to_numpy(array)


def read_file(path: str, suffix: str) -> Answer:
    """A file in one of VTK's own formats, chosen by its suffix."""
    if suffix == ".vtk":
        from vtkmodules.vtkIOLegacy import vtkDataSetReader

        reader = vtkDataSetReader()
        for kind in _LEGACY:
            getattr(reader, f"ReadAll{kind}On")()
        with open(path, "rb") as file:
            content = file.read()
        if _TEXT.match(content):
            text: Any = content + _END  # VTK's types say str
            reader.ReadFromInputStringOn()
            reader.SetBinaryInputString(text, len(text))
    else:
        reader = getattr(vtkIOXML, _XML[suffix])()
    reader.SetFileName(path)
    return _output(reader), []


def read_ensight(path: str, time: str) -> Answer:
    """One time of an EnSight case; its only state if `time` is empty."""
    from vtkmodules.vtkIOEnSight import vtkGenericEnSightReader

    reader = vtkGenericEnSightReader()
    reader.SetCaseFileName(path)
    reader.ReadAllVariablesOn()
    if time:
        reader.SetTimeValue(float(time))
    return _output(reader), []


def read_exodus(path: str, step: int | None) -> Answer:
    """One step of an Exodus file, and its times; only the times if `step` is None."""
    from vtkmodules.vtkIOExodus import vtkExodusIIReader

    reader = vtkExodusIIReader()
    reader.SetFileName(path)
    names = _times(reader)
    if not reader.GetNumberOfNodes():
        raise ValueError("VTK finds no nodes of Exodus in it")
    if step is None:
        return None, names
    for kind in (reader.NODAL, reader.ELEM_BLOCK):
        reader.SetAllArrayStatus(kind, 1)
    reader.SetTimeStep(step)
    return _output(reader), names


def read_cgns(path: str, time: str | None) -> Answer:
    """One time of a CGNS file ("" for its only one), and all times; None for the times alone."""
    from vtkmodules.vtkIOCGNSReader import vtkCGNSReader

    reader = vtkCGNSReader()
    reader.SetFileName(path)
    names = _times(reader)
    if not reader.GetNumberOfBaseArrays():
        raise ValueError("VTK finds no base of CGNS in it")
    if time is None:
        return None, names
    reader.EnableAllBases()
    reader.EnableAllPointArrays()
    reader.EnableAllCellArrays()
    return _output(reader, time), names


def read_xdmf(path: str, step: int | None) -> Answer:
    """One step of an XDMF file, and its times; only the times if `step` is None."""
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    reader = vtkXdmfReader()
    reader.SetFileName(path)
    names = _times(reader)
    if not reader.GetNumberOfGrids():
        raise ValueError("VTK finds no grid of XDMF in it")
    if (count := _most_states(path)) > max(1, len(names)):
        raise ValueError(
            f"it has {count} states at {len(names)} times, and VTK reads one state of each time: "
            "write a Time into each"
        )
    if step is None:
        return None, names
    return _output(reader, names[step] if names else ""), names


def _most_states(path: str) -> int:
    """Number of grids in the largest temporal collection of an XDMF file."""
    grids = ElementTree.parse(path).iter("Grid")
    series = (grid for grid in grids if grid.get("CollectionType", "").lower() == "temporal")
    return max((len(grid.findall("Grid")) for grid in series), default=0)


def _times(reader: vtkAlgorithm) -> list[str]:
    """Times that a file states, after its reader has updated its information."""
    vtkOutputWindow.SetInstance(vtkStringOutputWindow())
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()
    return [repr(float(time)) for time in times]


def _output(reader: _Reader, time: str = "") -> Described | None:
    """Data set of a reader, of one time if given; raises ValueError with its first message."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    reader.UpdateTimeStep(float(time)) if time else reader.Update()
    # Missing numbers in VTK's old format are a warning.
    output = window.GetOutput().replace("Generic Warning: In vtkDataReader", "ERROR: ")
    _, error, text = output.partition("ERROR: ")
    if error:
        # Without the location in VTK's source and the reader's address.
        lines = [line.partition("): ")[2] or line for line in text.splitlines()[1:]]
        raise ValueError(next(filter(None, map(str.strip, lines)), "VTK says no more"))
    return _described(reader.GetOutput())


def read_case(path: str, time: str, region: str) -> Answer:
    """One time of an OpenFOAM case, and the names of the fields that VTK found there.

    `region` is the name of a region in ``constant``; "" reads the case's own mesh.

    VTK warns about much that is harmless in a case; the caller checks what was read.
    """
    from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

    vtkOutputWindow.SetInstance(vtkStringOutputWindow())
    reader = vtkOpenFOAMReader()
    # Any name in the case's folder works; the file itself is not opened.
    reader.SetFileName(os.path.join(path, "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.SetCreateCellToPoint(False)
    reader.UpdateInformation()
    for k in range(reader.GetNumberOfPatchArrays()):
        # Such as "patch/wall", or "/air/patch/wall" of a region.
        name = reader.GetPatchArrayName(k)
        of_region = name.split("/")[1] if name.startswith("/") else ""
        reader.SetPatchArrayStatus(name, of_region == region)
    reader.EnableAllCellArrays()
    reader.SetTimeValue(float(time))
    reader.Update()
    count = reader.GetNumberOfCellArrays()
    return _described(reader.GetOutput()), [reader.GetCellArrayName(k) for k in range(count)]


def _described(data: model.vtkDataObject | None) -> Described | None:
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
    if not isinstance(data, model.vtkDataSet) or (mesh := _mesh(data)) is None:
        raise ValueError(f"it holds a {data.GetClassName()}, which is not a mesh")
    mesh["point"] = _data_of(data.GetPointData())
    mesh["cell"] = _data_of(data.GetCellData())
    mesh["field"] = _data_of(data.GetFieldData())
    return mesh


def _data_of(attributes: model.vtkFieldData) -> Arrays:
    found: Arrays = {}
    for k in range(attributes.GetNumberOfArrays()):
        array = attributes.GetAbstractArray(k)
        name = array.GetName() or f"Unnamed_{k}"
        if isinstance(array, vtkStringArray):
            found[name] = [array.GetValue(i) for i in range(array.GetNumberOfValues())]
        elif isinstance(array, vtkDataArray):
            found[name] = _array(array)
    return found


def _mesh(data: model.vtkDataSet) -> Described | None:
    """Points and cells; None for a data set of another kind."""
    if isinstance(data, model.vtkImageData):
        directions = data.GetDirectionMatrix()
        return {
            "kind": "image",
            "extent": data.GetExtent(),
            "spacing": data.GetSpacing(),
            "origin": data.GetOrigin(),
            "directions": [directions.GetElement(i, j) for i in range(3) for j in range(3)],
        }
    if isinstance(data, model.vtkRectilinearGrid):
        axes = (data.GetXCoordinates(), data.GetYCoordinates(), data.GetZCoordinates())
        return {
            "kind": "rectilinear",
            "dimensions": data.GetDimensions(),
            "axes": [_array(axis) for axis in axes],
        }
    if isinstance(data, model.vtkStructuredGrid):
        dimensions = [0, 0, 0]
        data.GetDimensions(dimensions)
        return {"kind": "structured", "dimensions": dimensions, "points": _points(data)}
    if isinstance(data, model.vtkUnstructuredGrid):
        types = data.GetCellTypesArray()
        if types is None:  # in VTK 9.6 and later if all cells have one type
            types = data.GetCellTypes()
        described: Described = {
            "kind": "unstructured",
            "points": _points(data),
            "cells": [_cells(data.GetCells())],
            "types": np.asarray(_array(types)),
        }
        if data.GetPolyhedronFaces() is not None:
            described["faces"] = _cells(data.GetPolyhedronFaces())
            described["face_places"] = _cells(data.GetPolyhedronFaceLocations())
        return described
    if isinstance(data, model.vtkPolyData):
        cells = (data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips())
        return {"kind": "poly", "points": _points(data), "cells": [_cells(c) for c in cells]}
    return None


def _points(data: model.vtkPointSet) -> AnyArray:
    points = data.GetPoints()
    return np.zeros((0, 3)) if points is None else _array(points.GetData())


def _cells(cells: model.vtkCellArray | None) -> Cells:
    if cells is None:
        return [np.zeros(0), np.zeros(0)]
    return [_array(cells.GetOffsetsArray()), _array(cells.GetConnectivityArray())]
