"""The formats that commands read: small valid files of each, and its reader."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pyvista as pv
import trimesh
from attrs import frozen

from iriftrace.camera.calibration import read_calibration
from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_files import read_poses, write_poses
from iriftrace.camera.pose_set import PoseSet
from iriftrace.camera.stereo import read_stereo_calibration
from iriftrace.cli import main
from iriftrace.clouds.read import read_cloud
from iriftrace.clouds.write import save_cloud
from iriftrace.field.path_data import FIELD_FILE, load_field_file
from iriftrace.field.read import read_field
from iriftrace.image.aov_image import read_exr
from iriftrace.image.measured_shift import read_measured_shift
from iriftrace.part.part import read_part, save_part
from iriftrace.scene.build import build_scene
from iriftrace.scene.load import load_scene
from iriftrace.scene.xml import SceneSettings
from iriftrace.shells.files import load_shells
from iriftrace.shells.imported import import_shells
from iriftrace.studies.study import SCHEMA as STUDY_SCHEMA
from iriftrace.studies.study import read_study
from iriftrace.sweep.journal import Piece, Work, journal_of, open_journal
from iriftrace.sweep.store import read_sweep
from validation.field_files import cgns, comsol, ensight, exodus
from validation.field_files.openfoam import write_case
from validation.field_files.openfoam_mesh import Patch
from validation.inputs import hot_block, stereo_files
from validation.inputs.calibration_files import COEFFICIENTS, PLAIN, written_by_opencv

_CELLS = 6
"""Cells along an edge of the small field, enough for every branch of each reader."""


@frozen
class Door:
    """One format and its reader.

    Attributes
    ----------
    name : str
        Row of the table.
    make : callable
        Writes the valid files into a folder.
    read : callable
        Reads them from there; InputError where they are damaged.
    damaged : tuple of str
        Patterns of the files that may be damaged.
    """

    name: str
    make: Callable[[Path], object]
    read: Callable[[Path], object]
    damaged: tuple[str, ...] = ("*",)


def _saved(name: str, **options: Any) -> Callable[[Path], object]:
    """Writes the small field under a name; its suffix sets the format."""

    def make(folder: Path) -> None:
        hot_block.air(_CELLS).save(folder / name, **options)

    return make


def _xml(mode: str, encoded: bool, compressed: bool) -> Callable[[Path], object]:
    """Writes the small field as .vtu with the data inline, encoded or appended."""

    def make(folder: Path) -> None:
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

        writer = vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(folder / "air.vtu"))
        writer.SetInputData(hot_block.air(_CELLS))
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.SetEncodeAppendedData(encoded)
        if not compressed:
            writer.SetCompressorTypeToNone()
        writer.Write()

    return make


def _image(folder: Path) -> None:
    grid = pv.ImageData(dimensions=(7, 7, 7), spacing=(6.0,) * 3, origin=(-18.0,) * 3)
    grid["T"] = 300.0 + np.linalg.norm(grid.points, axis=1)
    grid.save(folder / "air.vti")


def _surfaces(folder: Path) -> None:
    spheres = [pv.Sphere(radius=r, theta_resolution=8, phi_resolution=8) for r in (7.0, 9.0)]
    for sphere, kelvins in zip(spheres, (900.0, 600.0), strict=True):
        sphere["T"] = np.full(sphere.n_points, kelvins)
    pv.merge(spheres).save(folder / "shells.vtp")


def _series(folder: Path) -> None:
    _saved("one.vtu")(folder)
    _saved("two.vtu")(folder)
    named = "".join(
        f'<DataSet timestep="{k}" part="0" file="{name}.vtu"/>'
        for k, name in enumerate(("one", "two"))
    )
    (folder / "air.pvd").write_text(
        f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>{named}'
        "</Collection></VTKFile>\n"
    )


def _blocks(folder: Path) -> None:
    pv.MultiBlock([hot_block.air(_CELLS)]).save(folder / "air.vtm")


def _case(folder: Path) -> None:
    grid = hot_block.air(_CELLS)
    grid.points = np.asarray(grid.points, dtype=np.float64) * 1e-3
    kelvins = np.asarray(grid.point_data_to_cell_data()["T"])
    patches = [
        Patch("block", "wall", lambda c: (np.abs(c) < 1.1e-3 * hot_block.HALF).all(axis=1), 1200.0),
        Patch("outside", "patch", lambda c: np.ones(len(c), dtype=bool), None),
    ]
    write_case(folder / "case", grid, {"1": {"T": kelvins}}, patches)


def _ensight(binary: bool) -> Callable[[Path], object]:
    """Writes the small field as EnSight Gold."""

    def make(folder: Path) -> None:
        grid = hot_block.air(_CELLS)
        ensight.write(folder / "air.case", grid, [np.asarray(grid["T"])], binary=binary)

    return make


def _comsol(name: str, separator: str) -> Callable[[Path], object]:
    def make(folder: Path) -> None:
        grid = hot_block.air(_CELLS)
        points = np.asarray(grid.points, dtype=np.float64)
        comsol.spreadsheet(
            folder / name, points, {"T (K)": np.asarray(grid["T"])}, separator=separator
        )
        hot_block.block().export(folder / "block.stl")

    return make


def _mesh(name: str) -> Callable[[Path], object]:
    """Writes a part and the air around it."""

    def make(folder: Path) -> None:
        hot_block.air(_CELLS).save(folder / "air.vtu")
        if name.endswith(".ply"):
            hot_block.block().export(folder / "block.stl")
            save_part(read_part(folder / "block.stl"), folder / name)
            (folder / "block.stl").unlink()
        else:
            hot_block.block().subdivide().export(folder / name)

    return make


def _camera() -> Camera:
    return Camera(
        focal_length_mm=20.0,
        sensor_mm=(6.0, 5.0),
        resolution=(12, 10),
        focus_mm=(50.0, 250.0),
        matrix=look_at((60.0, -45.0, 70.0), (0.0, 0.0, 0.0)),
    )


def _scene_of(name: str) -> Callable[[Path], object]:
    """Reads field and part and writes their scene."""

    def read(folder: Path) -> None:
        part = read_part(folder / name)
        build_scene(
            read_field(folder / "air.vtu"), part, _camera(), folder / "out/scene.xml", layers=2
        )

    return read


def _scene(folder: Path) -> None:
    field, part = hot_block.save(folder)
    hot_block.air(_CELLS).save(field)
    build_scene(
        read_field(field),
        read_part(part),
        _camera(),
        folder / "scene/scene.xml",
        SceneSettings(scale=1.0),
        layers=2,
    )
    field.unlink()
    part.unlink()


def _image_of_pose(folder: Path) -> None:
    _scene(folder)
    _run("render", folder / "scene/scene.xml", "-o", folder / "out.exr", "--no-figures")
    for name in ("scene/field.npz", "scene/scene.xml"):
        (folder / name).unlink(missing_ok=True)


def _metrics(folder: Path) -> object:
    image = read_exr(folder / "out.exr")
    return image.camera, image.part_from(folder / "scene/part.ply")


def _sweep(folder: Path) -> None:
    _scene(folder)
    poses = PoseSet(np.stack([_camera().matrix] * 2))
    write_poses(folder / "poses.csv", poses)
    scene = folder / "scene/scene.xml"
    _run("sweep", scene, "-o", folder / "sweep.nc", "--poses", folder / "poses.csv")
    shutil.rmtree(folder / "scene")


def _study(folder: Path) -> None:
    import xarray as xr

    values = ("layers", np.linspace(0.0, 1.0, 4))
    content = xr.Dataset({"displacement_mean": values}, attrs={"schema": STUDY_SCHEMA})
    content.to_netcdf(folder / "study.nc", engine="h5netcdf")


def _run(*words: object) -> None:
    if main([str(word) for word in words]) != 0:
        raise RuntimeError(f"{' '.join(map(str, words))} failed")


def _work(folder: Path) -> Work:
    return Work("sweep", "poses", folder / "sweep.nc", "request", 3)


def _journal(folder: Path) -> None:
    with open_journal(_work(folder)) as journal:
        for number in range(3):
            journal.add(Piece(number, {"pose": number}, np.arange(20.0)))


def _read_journal(folder: Path) -> None:
    with open_journal(_work(folder)) as journal:
        for number in journal:
            journal.entry(number)
            journal.rows(number)


def _poses(name: str) -> Callable[[Path], object]:
    poses = PoseSet(np.stack([_camera().matrix] * 3))
    return lambda folder: write_poses(folder / name, poses)


def _calibration(folder: Path) -> None:
    matrix = "!!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: {}\n"
    numbers = np.asarray(PLAIN["camera_matrix"]).ravel().tolist()
    (folder / "camera.yaml").write_text(
        "%YAML:1.0\n---\nimage_width: 2448\nimage_height: 2048\n"
        f"camera_matrix: {matrix.format(3, 3, numbers)}"
        f"distortion_coefficients: {matrix.format(5, 1, COEFFICIENTS.tolist())}"
    )


def _plain_calibration(folder: Path) -> None:
    (folder / "camera.json").write_text(json.dumps(PLAIN))


def _calibrated(name: str) -> Callable[[Path], object]:
    return lambda folder: read_calibration(folder / name).camera(pixel_size_mm=0.003)


def _cloud(name: str) -> Callable[[Path], object]:
    """Writes 60 points under a name; its suffix sets the format."""
    points = 10.0 * np.random.default_rng(4).normal(size=(60, 3))
    faces = np.arange(60).reshape(-1, 3)

    def make(folder: Path) -> None:
        if name.endswith(".e57"):
            import pye57

            with pye57.E57(str(folder / name), mode="w") as file:
                columns = zip("XYZ", points.T / 1e3, strict=True)
                file.write_scan_raw({f"cartesian{axis}": values for axis, values in columns})
        elif name.endswith(".asc"):
            np.savetxt(folder / name, points)
        elif name.endswith(".stl"):
            trimesh.Trimesh(points, faces, process=False).export(folder / name)
        else:
            values = {"schema": "", "assumptions": {"field_origin": ""}}
            save_cloud(folder / name, points, {"status": np.zeros(60, np.int32)}, values)
            (folder / name).with_suffix(".json").unlink()

    return make


def _cloud_door(ending: str) -> Door:
    name = f"cloud.{ending}"
    return Door(f"cloud, {ending}", _cloud(name), lambda folder: read_cloud(folder / name))


def _shift_map(folder: Path) -> None:
    planes = {axis: np.full((10, 12), 0.5, np.float32) for axis in "xy"}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(str(folder / "shift.exr"))


def _shift_array(folder: Path) -> None:
    np.save(folder / "shift.npy", np.full((10, 12, 2), 0.5))


def _markers(folder: Path) -> None:
    table = np.random.default_rng(5).random((20, 4))
    np.savetxt(folder / "shift.csv", table, delimiter=",", header="u,v,du,dv", comments="")


def _shift(name: str) -> Callable[[Path], object]:
    return lambda folder: read_measured_shift(folder / name)


def _field(name: str) -> Callable[[Path], object]:
    return lambda folder: read_field(folder / name)


def _scattered(name: str) -> Callable[[Path], object]:
    return lambda folder: read_field(folder / name, part=read_part(folder / "block.stl"))


DOORS = (
    Door(".vtu, raw", _xml("Appended", False, False), _field("air.vtu")),
    Door(".vtu, compressed", _xml("Appended", True, True), _field("air.vtu")),
    Door(".vtu, inline text", _xml("Ascii", False, False), _field("air.vtu")),
    Door(".vtu, inline base64", _xml("Binary", False, True), _field("air.vtu")),
    Door(".vtk, binary", _saved("air.vtk"), _field("air.vtk")),
    Door(".vtk, text", _saved("air.vtk", binary=False), _field("air.vtk")),
    Door(".vti", _image, _field("air.vti")),
    Door(".vtp", _surfaces, lambda folder: import_shells(folder / "shells.vtp")),
    Door(".vtm", _blocks, _field("air.vtm")),
    Door(".pvd", _series, _field("air.pvd")),
    Door("EnSight, text", _ensight(False), _field("air.case")),
    Door("EnSight, binary", _ensight(True), _field("air.case")),
    Door(
        "Exodus",
        lambda folder: exodus.write(folder / "air.e", hot_block.air(_CELLS)),
        _field("air.e"),
    ),
    Door(
        "CGNS",
        lambda folder: cgns.write(folder / "air.cgns", hot_block.air(_CELLS)),
        _field("air.cgns"),
    ),
    Door("OpenFOAM case", _case, _field("case")),
    Door("COMSOL text", _comsol("air.txt", " "), _scattered("air.txt"), ("air.txt",)),
    Door("COMSOL csv", _comsol("air.csv", ","), _scattered("air.csv"), ("air.csv",)),
    Door("part, STL", _mesh("part.stl"), _scene_of("part.stl"), ("part.stl",)),
    Door("part, PLY", _mesh("part.ply"), _scene_of("part.ply"), ("part.ply",)),
    Door("part, OBJ", _mesh("part.obj"), _scene_of("part.obj"), ("part.obj",)),
    Door(
        "field.npz",
        _scene,
        lambda folder: load_field_file(folder / "scene" / FIELD_FILE),
        (f"*/{FIELD_FILE}",),
    ),
    Door(
        "scene folder",
        _scene,
        lambda folder: load_scene(folder / "scene/scene.xml"),
        ("*/*.ply", "*/shells.json", "*/scene.xml"),
    ),
    Door(
        "scene folder, cells engine",
        _scene,
        lambda folder: load_scene(folder / "scene/scene.xml", engine="cells"),
        ("*/*.npz", "*/part.ply"),
    ),
    Door(
        "shells.json and shell PLY",
        _scene,
        lambda folder: load_shells(folder / "scene"),
        ("*/shells/*",),
    ),
    Door("AOV EXR", _image_of_pose, _metrics, ("out.exr",)),
    Door("calibration, OpenCV YAML", _calibration, _calibrated("camera.yaml")),
    Door("calibration, JSON", _plain_calibration, _calibrated("camera.json")),
    Door(
        "calibration, OpenCV XML",
        lambda folder: written_by_opencv(folder / "camera.xml"),
        _calibrated("camera.xml"),
    ),
    Door(
        "stereo calibration, OpenCV YAML",
        lambda folder: stereo_files.opencv(folder / "stereo.yaml"),
        lambda folder: read_stereo_calibration(folder / "stereo.yaml"),
    ),
    Door(
        "stereo calibration, MATLAB JSON",
        lambda folder: stereo_files.matlab(folder / "stereo.json", old=True),
        lambda folder: read_stereo_calibration(folder / "stereo.json"),
    ),
    *(
        Door(
            f"poses, {ending}",
            _poses(f"poses.{ending}"),
            lambda folder, ending=ending: read_poses(folder / f"poses.{ending}"),
        )
        for ending in ("npy", "csv", "json", "txt")
    ),
    Door("sweep netCDF", _sweep, lambda folder: read_sweep(folder / "sweep.nc").load(), ("*.nc",)),
    Door("study netCDF", _study, lambda folder: read_study(folder / "study.nc")),
    *(_cloud_door(ending) for ending in ("ply", "stl", "asc", "vtp", "e57")),
    Door("measured shift, EXR", _shift_map, _shift("shift.exr")),
    Door("measured shift, npy", _shift_array, _shift("shift.npy")),
    Door("measured shift, csv", _markers, _shift("shift.csv")),
    Door("journal", _journal, _read_journal, (journal_of(Path("sweep.nc")).name,)),
)


def files_of(door: Door, folder: Path) -> dict[str, bytes]:
    """Valid files of a door by their names in the folder, where they are written."""
    folder.mkdir()
    door.make(folder)
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def damageable(door: Door, names: Iterable[str]) -> list[str]:
    """Those of a door's files that may be damaged."""
    return [name for name in names if any(fnmatch(name, p) for p in door.damaged)]
