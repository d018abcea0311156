"""Small valid files of every format that commands read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pyvista as pv
import trimesh
from PIL import Image

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose_set import PoseSet
from iriftrace.cli import main
from iriftrace.image.lost_rays import LostRay, LostRays
from iriftrace.io.cloud_write import save_cloud
from iriftrace.io.field import read_field
from iriftrace.io.lost_rays import write_lost_rays
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.poses import write_poses
from iriftrace.part.board import Board
from iriftrace.sweep.journal import Piece, Work, open_journal
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from validation.field_files import comsol, ensight
from validation.field_files.openfoam import write_case
from validation.field_files.openfoam_mesh import Patch
from validation.inputs import hot_block
from validation.inputs.calibration_files import COEFFICIENTS, PLAIN
from validation.inputs.cameras import camera_at

CELLS = 6
"""Cells along an edge of the small field, enough for every branch of each reader."""


def saved(name: str, **options: Any) -> Callable[[Path], object]:
    """Writes the small field under a name; its suffix sets the format."""

    def make(folder: Path) -> None:
        hot_block.air(CELLS).save(folder / name, **options)

    return make


def xml(mode: str, encoded: bool, compressed: bool) -> Callable[[Path], object]:
    """Writes the small field as .vtu with the data inline, encoded or appended."""

    def make(folder: Path) -> None:
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

        writer = vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(folder / "air.vtu"))
        writer.SetInputData(hot_block.air(CELLS))
        getattr(writer, f"SetDataModeTo{mode}")()
        writer.SetEncodeAppendedData(encoded)
        if not compressed:
            writer.SetCompressorTypeToNone()
        writer.Write()

    return make


def image(folder: Path) -> None:
    grid = pv.ImageData(dimensions=(7, 7, 7), spacing=(6.0,) * 3, origin=(-18.0,) * 3)
    grid["T"] = 300.0 + np.linalg.norm(grid.points, axis=1)
    grid.save(folder / "air.vti")


def surfaces(folder: Path) -> None:
    spheres = [pv.Sphere(radius=r, theta_resolution=8, phi_resolution=8) for r in (7.0, 9.0)]
    for sphere, kelvins in zip(spheres, (900.0, 600.0), strict=True):
        sphere["T"] = np.full(sphere.n_points, kelvins)
    pv.merge(spheres).save(folder / "shells.vtp")


def series(folder: Path) -> None:
    saved("one.vtu")(folder)
    saved("two.vtu")(folder)
    named = "".join(
        f'<DataSet timestep="{k}" part="0" file="{name}.vtu"/>'
        for k, name in enumerate(("one", "two"))
    )
    (folder / "air.pvd").write_text(
        f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>{named}'
        "</Collection></VTKFile>\n"
    )


def blocks(folder: Path) -> None:
    pv.MultiBlock([hot_block.air(CELLS)]).save(folder / "air.vtm")


def case(folder: Path) -> None:
    grid = hot_block.air(CELLS)
    grid.points = np.asarray(grid.points, dtype=np.float64) * 1e-3
    kelvins = np.asarray(grid.point_data_to_cell_data()["T"])
    patches = [
        Patch("block", "wall", lambda c: (np.abs(c) < 1.1e-3 * hot_block.HALF).all(axis=1), 1200.0),
        Patch("outside", "patch", lambda c: np.ones(len(c), dtype=bool), None),
    ]
    write_case(folder / "case", grid, {"1": {"T": kelvins}}, patches)


def ensight_gold(binary: bool) -> Callable[[Path], object]:
    """Writes the small field as EnSight Gold."""

    def make(folder: Path) -> None:
        grid = hot_block.air(CELLS)
        ensight.write(folder / "air.case", grid, [np.asarray(grid["T"])], binary=binary)

    return make


def comsol_text(name: str, separator: str) -> Callable[[Path], object]:
    def make(folder: Path) -> None:
        grid = hot_block.air(CELLS)
        points = np.asarray(grid.points, dtype=np.float64)
        comsol.spreadsheet(
            folder / name, points, {"T (K)": np.asarray(grid["T"])}, separator=separator
        )
        hot_block.block().export(folder / "block.stl")

    return make


def mesh(name: str) -> Callable[[Path], object]:
    """Writes a part and the air around it."""

    def make(folder: Path) -> None:
        hot_block.air(CELLS).save(folder / "air.vtu")
        if name.endswith(".ply"):
            hot_block.block().export(folder / "block.stl")
            save_part(read_part(folder / "block.stl"), folder / name)
            (folder / "block.stl").unlink()
        else:
            hot_block.block().subdivide().export(folder / name)

    return make


def camera() -> Camera:
    return camera_at(
        (60.0, -45.0, 70.0), focal_length_mm=20.0, resolution=(12, 10), focus_mm=(50.0, 250.0)
    )


def scene(folder: Path) -> None:
    field, part = hot_block.save(folder)
    hot_block.air(CELLS).save(field)
    air = HotAir(read_field(field), layers=2)
    Scene(read_part(part), air, camera()).save(folder / "scene/scene.xml", scale=1.0)
    field.unlink()
    part.unlink()


def image_of_pose(folder: Path) -> None:
    scene(folder)
    run("render", folder / "scene/scene.xml", "-o", folder / "out.exr", "--no-figures")
    for name in ("scene/field.npz", "scene/scene.xml"):
        (folder / name).unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    scene(folder)
    write_poses(folder / "poses.csv", PoseSet(np.stack([camera().matrix] * 2)))
    places = ("--poses", folder / "poses.csv")
    run("sweep", folder / "scene/scene.xml", "-o", folder / "sweep.nc", *places)
    shutil.rmtree(folder / "scene")


def run(*words: object) -> None:
    if main([str(word) for word in words]) != 0:
        raise RuntimeError(f"{' '.join(map(str, words))} failed")


def work(folder: Path) -> Work:
    return Work("sweep", "poses", folder / "sweep.nc", "request", 3)


def journal(folder: Path) -> None:
    with open_journal(work(folder)) as journal:
        for number in range(3):
            journal.add(Piece(number, {"pose": number}, np.arange(20.0)))


def poses(name: str) -> Callable[[Path], object]:
    poses = PoseSet(np.stack([camera().matrix] * 3))
    return lambda folder: write_poses(folder / name, poses)


def calibration(folder: Path) -> None:
    matrix = "!!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: {}\n"
    numbers = np.asarray(PLAIN["camera_matrix"]).ravel().tolist()
    (folder / "camera.yaml").write_text(
        "%YAML:1.0\n---\nimage_width: 2448\nimage_height: 2048\n"
        f"camera_matrix: {matrix.format(3, 3, numbers)}"
        f"distortion_coefficients: {matrix.format(5, 1, COEFFICIENTS.tolist())}"
    )


def plain_calibration(folder: Path) -> None:
    (folder / "camera.json").write_text(json.dumps(PLAIN))


def cloud(name: str) -> Callable[[Path], object]:
    """Writes 60 points under a name; its suffix sets the format."""
    points = 10.0 * np.random.default_rng(4).normal(size=(60, 3))
    faces = np.arange(60).reshape(-1, 3)

    def make(folder: Path) -> None:
        if name.endswith(".e57"):
            import pye57

            with pye57.E57(str(folder / name), mode="w") as file:
                columns = zip("XYZ", points.T / 1e3, strict=True)
                file.write_scan_raw({f"cartesian{axis}": values for axis, values in columns})
        elif name.endswith(".pcd"):
            head = "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nWIDTH 60\nDATA binary\n"
            (folder / name).write_bytes(head.encode() + points.tobytes())
        elif name.endswith(".asc"):
            np.savetxt(folder / name, points)
        elif name.endswith(".stl"):
            trimesh.Trimesh(points, faces, process=False).export(folder / name)
        else:
            values = {"schema": "", "assumptions": {"field_origin": ""}}
            save_cloud(folder / name, points, {"status": np.zeros(60, np.int32)}, values)
            (folder / name).with_suffix(".json").unlink()

    return make


def shift_map(folder: Path) -> None:
    planes = {axis: np.full((10, 12), 0.5, np.float32) for axis in "xy"}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, planes).write(str(folder / "shift.exr"))


def shift_array(folder: Path) -> None:
    np.save(folder / "shift.npy", np.full((10, 12, 2), 0.5))


def markers(folder: Path) -> None:
    table = np.random.default_rng(5).random((20, 4))
    np.savetxt(folder / "shift.csv", table, delimiter=",", header="u,v,du,dv", comments="")


def rays(folder: Path) -> None:
    where = {"path": "scene.xml", "sha256": None, "variables": {"scale": "0.1"}}
    facts = {"engine": "shells", "bending": "layers", "variant": "any", "wavelength_nm": 450.0}
    ray = LostRay(0, "camera", (3.0, 4.0), (0.0, 0.0, 9.0), (0.0, 0.6, -0.8), 6)
    found = LostRays.of([ray] * 2, 2, {"version": "1", "scene": where, **facts})
    write_lost_rays(folder / "out.rays.json", found)


def printed(folder: Path) -> None:
    """Dots of a board and a picture to print."""
    Board((60.0, 50.0), 8.0).save_centres(folder / "board.csv")
    Image.fromarray(np.arange(96, dtype=np.uint8).reshape(8, 12)).save(folder / "print.png")
