"""Files that are read with a field's file, so that a change of theirs is one of the field."""

from pathlib import Path

import pytest

from iriftrace.io.named_files import named_files

PVD = '<VTKFile><Collection><DataSet timestep="0" file="{}"/></Collection></VTKFile>'
PVTU = "<VTKFile><PUnstructuredGrid><Piece Source='{}'/></PUnstructuredGrid></VTKFile>"
XDMF = '<Xdmf><DataItem Dimensions="8" Format="HDF">\n  {}:/T\n</DataItem></Xdmf>'
CASE = (
    'FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: "{}"\nVARIABLE\nscalar per node: 1 T air.T***\n'
)


def made(folder: Path, *names: str) -> set[Path]:
    files = {folder / name for name in names}
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    return files


@pytest.mark.parametrize(
    ("index", "text", "names"),
    [
        ("air.pvd", PVD.format("steps/air 1.vtu"), ["steps/air 1.vtu"]),
        ("air.pvd", PVD.format("steps\\air.vtu"), ["steps/air.vtu"]),
        ("air.vtu.series", '{"files" : [{"name": "air.vtu", "time": 0}]}', ["air.vtu"]),
        ("air.xdmf", XDMF.format("air.h5"), ["air.h5"]),
        ("air.encas", CASE.format("air.geo"), ["air.geo", "air.T001", "air.T002"]),
        ("part.gltf", '{"buffers": [{"uri": "part.bin", "byteLength": 8}]}', ["part.bin"]),
        ("air.vtu", PVD.format("air.vtk"), []),
    ],
)
def test_an_index_is_read_with_the_files_that_it_names(
    tmp_path: Path, index: str, text: str, names: list[str]
) -> None:
    made(tmp_path, "other.vtu", "air.vtk", "build/scene.xml")
    expected = made(tmp_path, *names)
    (tmp_path / index).write_text(text)
    assert named_files(tmp_path / index) == tuple(sorted(expected))


def test_an_index_of_indices_is_read_with_theirs(tmp_path: Path) -> None:
    expected = made(tmp_path, "0/air.pvtu", "0/air_0.vtu")
    (tmp_path / "0/air.pvtu").write_text(PVTU.format("air_0.vtu"))
    (tmp_path / "air.pvd").write_text(PVD.format("0/air.pvtu") + PVD.format("air.pvd"))
    assert named_files(tmp_path / "air.pvd") == tuple(sorted(expected))


def test_a_case_is_read_with_its_meshes_and_times(tmp_path: Path) -> None:
    """From its folder, an empty .foam file, controlDict, or the folder of a region."""
    made(tmp_path, "log.solver", "build/scene.xml", "postProcessing/0/heat.dat", "air.foam")
    made(tmp_path, "system/controlDict")
    expected = made(
        tmp_path,
        *("constant/air/polyMesh/points", "2.5/air/T", "0/air/T"),
        *("processor0/constant/air/polyMesh/points", "processor0/2.5/air/T"),
    )
    for name in (".", "air.foam", "system/controlDict", "constant/air"):
        assert named_files(tmp_path / name) == tuple(sorted(expected))
