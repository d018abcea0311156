"""Fields, calibrations, poses and clouds in every format."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from internals import (
    calibration_values,
    cloud_values,
    field_values,
    pose_values,
    shell_values,
    stereo_values,
)
from values import HERE, Record

import iriftrace

# 5 --- files


def fields(record: Record) -> None:
    """The small hot block in every format and form that the writers have."""
    import pyvista as pv

    from validation.attack import samples
    from validation.field_files import cgns, comsol, ensight, exodus, openfoam, xdmf
    from validation.inputs import hot_block

    grid = hot_block.air(6)
    points = np.asarray(grid.points, dtype=np.float64)
    kelvin = np.asarray(grid["T"], dtype=np.float64)
    metres = hot_block.air_in_metres(6)
    cells = np.asarray(metres.point_data_to_cell_data()["T"], dtype=np.float64)
    patches = hot_block.patches(outside=hot_block.AMBIENT)
    hot_block.block().export("block.stl")
    block = iriftrace.read_part("block.stl")
    later = [(1.0, kelvin + 5.0), (2.5, kelvin + 10.0)]
    units = np.random.default_rng(3).integers(0, 3, grid.n_cells)

    def tetrahedra() -> tuple[np.ndarray, np.ndarray]:
        split = grid.triangulate()
        kept = np.asarray(split["T"], dtype=np.float64)
        corners = np.asarray(split.cells_dict[pv.CellType.TETRA], dtype=np.int64)
        return np.asarray(split.points, dtype=np.float64), corners, kept

    def sections(**options: Any) -> None:
        places, corners, values = tetrahedra()
        comsol.sectionwise(HERE / "s.txt", places, corners, {"T (K)": values}, **options)

    def cells_of_cgns() -> None:
        averaged = grid.point_data_to_cell_data()
        cgns.write(HERE / "cells.cgns", averaged, location="CellCenter")

    def regular() -> None:
        axes = [np.linspace(-18.0, 18.0, 7)] * 3
        x, y, z = np.meshgrid(*axes, indexing="ij")
        values = 300.0 + np.sqrt(x**2 + y**2 + z**2)
        comsol.grid(HERE / "g.txt", axes, {"T (K)": values.transpose(2, 1, 0)})

    def case(folder: str, **options: Any) -> None:
        times = {time: {"T": cells + float(time)} for time in ("1", "2")}
        openfoam.write_case(HERE / folder, metres, times, patches, **options)

    def polyhedra() -> None:
        # Pairs of neighbours become one cell.
        groups = np.arange(grid.n_cells) // 2
        means = np.bincount(groups, cells) / np.bincount(groups)
        times = {"1": {"T": means}}
        openfoam.write_case(HERE / "poly", metres, times, patches, groups=groups)

    def series(name: str, states: Mapping[float, str]) -> None:
        sets = [f'<DataSet timestep="{time}" file="{file}"/>' for time, file in states.items()]
        Path(name).write_text(
            f'<VTKFile type="Collection"><Collection>{"".join(sets)}</Collection></VTKFile>'
        )

    def with_cells(name: str) -> None:
        grid.point_data_to_cell_data().save(name)

    def units_stated(name: str, values: np.ndarray, array: str) -> None:
        other = pv.UnstructuredGrid()
        other.copy_structure(grid)
        other.point_data[array] = values
        other.save(name)

    table = partial(comsol.spreadsheet, points=points, columns={"T (K)": kelvin})
    degrees = {f"T (degC) @ t={t}": kelvin - 273.15 + t for t in (1, 2)}
    density = 101325.0 / (287.05 * kelvin)
    write: dict[str, tuple[Callable[[], Any], str, dict[str, Any]]] = {
        "vtu, raw": (partial(samples.xml("Appended", False, False), HERE), "air.vtu", {}),
        "vtu, compressed": (partial(samples.xml("Appended", True, True), HERE), "air.vtu", {}),
        "vtu, text": (partial(samples.xml("Ascii", False, False), HERE), "air.vtu", {}),
        "vtu, base64": (partial(samples.xml("Binary", False, True), HERE), "air.vtu", {}),
        "vtu, cells": (partial(with_cells, "cells.vtu"), "cells.vtu", {}),
        "vtu, rotated": (
            partial(grid.save, "air.vtu"),
            "air.vtu",
            {
                "reading": iriftrace.ReadField(
                    length_unit="cm", transform=np.diag((1.0, -1.0, -1.0, 1.0))
                )
            },
        ),
        "vtu, degC": (
            partial(units_stated, "c.vtu", kelvin - 273.15, "temperature"),
            "c.vtu",
            {"reading": iriftrace.ReadField(temperature_unit="degC")},
        ),
        "vtu, density": (
            partial(units_stated, "d.vtu", density, "rho"),
            "d.vtu",
            {"quantity": "density"},
        ),
        "vtu, index": (
            partial(units_stated, "n.vtu", 1.0 + 2.7e-4 * 293.15 / kelvin, "n"),
            "n.vtu",
            {"quantity": "index", "air": iriftrace.Air()},
        ),
        "vtk, binary": (partial(samples.saved("air.vtk"), HERE), "air.vtk", {}),
        "vtk, text": (partial(samples.saved("air.vtk", binary=False), HERE), "air.vtk", {}),
        "vti": (partial(samples.image, HERE), "air.vti", {}),
        "vtm": (partial(samples.blocks, HERE), "air.vtm", {}),
        "pvd": (partial(samples.series, HERE), "air.pvd", {}),
        "pvd, first": (
            partial(series, "two.pvd", {0.0: "one.vtu", 0.5: "two.vtu"}),
            "two.pvd",
            {"member": 0},
        ),
        "EnSight, text": (partial(samples.ensight_gold(False), HERE), "air.case", {}),
        "EnSight, binary": (partial(samples.ensight_gold(True), HERE), "air.case", {}),
        "EnSight, times": (
            partial(
                ensight.write,
                HERE / "times.case",
                grid,
                [kelvin, kelvin + 5.0],
                binary=True,
                times=(0.0, 1.0),
            ),
            "times.case",
            {"member": 0},
        ),
        "Exodus": (partial(exodus.write, HERE / "air.e", grid, later), "air.e", {}),
        "Exodus, first": (lambda: None, "air.e", {"member": 0}),
        "CGNS": (partial(cgns.write, HERE / "air.cgns", grid), "air.cgns", {}),
        "CGNS, cells": (cells_of_cgns, "cells.cgns", {}),
        "CGNS, units": (
            partial(cgns.write, HERE / "si.cgns", grid, later, units=("Centimeter", "Kelvin")),
            "si.cgns",
            {"member": 1},
        ),
        "XDMF": (partial(xdmf.write, HERE / "air.xdmf", grid), "air.xdmf", {}),
        "XDMF, times": (partial(xdmf.write, HERE / "t.xdmf", grid, later), "t.xdmf", {"member": 1}),
        "OpenFOAM, text": (partial(case, "ascii"), "ascii", {}),
        "OpenFOAM, first": (lambda: None, "ascii", {"member": 0}),
        "OpenFOAM, binary": (partial(case, "binary", form="binary"), "binary", {}),
        "OpenFOAM, gz": (partial(case, "gz", form="gz"), "gz", {}),
        "OpenFOAM, decomposed": (partial(case, "parts", processors=units), "parts", {}),
        "OpenFOAM, polyhedra": (polyhedra, "poly", {}),
        "COMSOL, text": (partial(table, HERE / "air.txt"), "air.txt", {"part": block}),
        "COMSOL, csv": (
            partial(table, HERE / "air.csv", separator=","),
            "air.csv",
            {"part": block},
        ),
        "COMSOL, semicolons": (
            partial(table, HERE / "semi.csv", separator=";", decimal=","),
            "semi.csv",
            {"part": block},
        ),
        "COMSOL, m, times": (
            partial(comsol.spreadsheet, HERE / "m.txt", 1e-3 * points, degrees, length_unit="m"),
            "m.txt",
            {"part": block, "member": 0},
        ),
        "COMSOL, sections": (sections, "s.txt", {}),
        "COMSOL, grid": (regular, "g.txt", {}),
    }
    for name, (make, file, options) in write.items():

        def read(
            make: Callable[[], Any] = make, file: str = file, options: Any = options
        ) -> dict[str, Any]:
            make()
            return field_values(iriftrace.read_field(file, **options))

        record(name, read)

    def surfaces(**options: Any) -> Any:
        samples.surfaces(HERE)
        return shell_values(iriftrace.import_shells("shells.vtp", iriftrace.ReadField(**options)))

    record("iso-surfaces", surfaces)
    record("iso-surfaces, declared", lambda: surfaces(quantity="temperature"))


def calibrations(record: Record) -> None:
    """One camera and two, as programs write them."""
    from validation.attack import samples
    from validation.inputs import calibration_files as one
    from validation.inputs import stereo_files as two

    def camera(name: str, text: str | Callable[[], Any]) -> None:
        def read() -> Any:
            Path(name).write_text(text) if isinstance(text, str) else text()
            return calibration_values(iriftrace.read_calibration(name))

        record(f"camera, {name}", read)

    def stereo(what: str, make: Callable[[], Any], *files: str, **options: Any) -> None:
        def read() -> Any:
            make()
            return stereo_values(iriftrace.read_stereo_calibration(*map(Path, files), **options))

        record(f"stereo, {what}", read)

    lens = {"k1": -0.25, "k2": 0.1, "p1": 1e-3, "p2": -2e-3, "k3": -0.02}
    fxy = {"fx": 3653.8, "fy": 3657.25, "cx": 1209.5, "cy": 1030.0}
    size = {"image_width": 2448, "image_height": 2048}
    real = {"width": 1280, "height": 1024, "fx": 3653, "fy": 3657, "ppx": 650, "ppy": 498}
    words = "-0.25 0.1 0.001 -0.002"
    numbers = [-0.25, 0.1, 0.001, -0.002, 0.0]
    rows = [[3653.0, 0.0, 650.0], [0.0, 3657.0, 498.0], [0.0, 0.0, 1.0]]
    flat = [number for row in rows for number in row]
    message = {
        "height": 1024,
        "width": 1280,
        "distortion_model": "plumb_bob",
        "d": numbers,
        "k": flat,
        "r": np.eye(3).ravel().tolist(),
        "p": np.column_stack((rows, np.zeros(3))).ravel().tolist(),
    }
    camera_info = {
        "image_width": 1280,
        "image_height": 1024,
        "camera_name": "one",
        "camera_matrix": {"rows": 3, "cols": 3, "data": flat},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": numbers},
    }
    kalibr = {
        "camera_model": "pinhole",
        "intrinsics": [3653.0, 3657.0, 650.0, 498.0],
        "distortion_model": "radtan",
        "distortion_coeffs": numbers[:4],
        "resolution": [1280, 1024],
    }
    matlab = {
        "RadialDistortion": [-0.25, 0.1],
        "TangentialDistortion": [1e-3, -2e-3],
        "ImageSize": [1024, 1280],
        "IntrinsicMatrix": np.transpose(rows).tolist(),
        "WorldUnits": "mm",
    }
    camera("camera.yaml", partial(samples.calibration, HERE))
    camera("camera.json", partial(samples.plain_calibration, HERE))
    for ending in ("xml", "yml", "json"):
        name = f"opencv.{ending}"
        camera(name, partial(one.written_by_opencv, HERE / name))
    pose = {"rvec": one.RVEC.tolist(), "tvec": one.TVEC.tolist()}
    camera("pose.json", partial(one.plain, HERE / "pose.json", **pose))
    eight = [*numbers[:4], 0.03, 0.01, 0.002, 0.0]
    changes = {"distortion_coefficients": eight}
    camera("rational.json", partial(one.plain, HERE / "rational.json", **changes))
    camera("names.json", json.dumps({**fxy, **lens, **size}))
    camera("ros.yaml", json.dumps(camera_info))
    camera("message.yaml", json.dumps(message))
    camera("kalibr.yaml", json.dumps({"cam0": kalibr}))
    camera("fisheye.yaml", json.dumps({"cam0": {**kalibr, "distortion_model": "equidistant"}}))
    camera("matlab.json", json.dumps(matlab))
    camera("realsense.json", json.dumps({**real, "model": "Brown Conrady", "coeffs": numbers}))
    camera("colmap.txt", f"# Camera list\n1 OPENCV 1280 1024 3653 3657 650 498 {words}\n")
    camera(
        "zivid.yml",
        "CameraIntrinsics:\n  CameraMatrix:\n    CX: 650\n    CY: 498\n    FX: 3653\n    FY: 3657\n"
        "  Distortion:\n    K1: -0.25\n    K2: 0.1\n    K3: 0.03\n    P1: 0.001\n    P2: -0.002\n"
        "image_width: 1280\nimage_height: 1024\n",
    )
    camera("bouguet.m", "fc = [ 3653 ; 3657 ];\ncc = [ 650 ; 498 ];\n")
    camera("metashape.xml", "<calibration><projection>frame</projection></calibration>")
    camera("centred.json", json.dumps({"K": rows, "D": numbers, "width": 9, "height": 6}))
    for names in two.NAMES:
        file = f"{names}.yaml"
        stereo(f"OpenCV, {names}", partial(two.opencv, HERE / file, names), file)
    for ending in ("xml", "json"):
        file = f"stereo.{ending}"
        stereo(f"OpenCV, {ending}", partial(two.opencv, HERE / file), file)
    stereo("PyYAML", partial(two.pyyaml, HERE / "lists.yaml"), "lists.yaml")
    stereo("Kalibr", partial(two.kalibr, HERE / "chain.yaml"), "chain.yaml")
    stereo("ROS", partial(two.ros, HERE), "left.yaml", "right.yaml")
    stereo("ROS, messages", partial(two.ros, HERE, message=True), "left.yaml", "right.yaml")
    stereo("MATLAB, old", partial(two.matlab, HERE / "old.json", old=True), "old.json")
    stereo("MATLAB, new", partial(two.matlab, HERE / "new.json", old=False), "new.json")
    stereo("MATLAB to OpenCV", partial(two.from_matlab_to_opencv, HERE / "to.json"), "to.json")


def poses(record: Record) -> None:
    """Lists of poses in every form, convention and robot's angles."""

    def of(name: str, content: str | Callable[[], Any], file: str, **options: Any) -> None:
        def read() -> Any:
            Path(file).write_text(content) if isinstance(content, str) else content()
            return pose_values(iriftrace.read_poses(file, **options))

        record(name, read)

    shifted = np.array([(1, 0, 0, 1.5), (0, 0, -1, -2), (0, 1, 0, 3), (0, 0, 0, 1)])
    row = " ".join(map(str, shifted.ravel().tolist()))
    of("matrix.txt", row, "matrix.txt")
    of("matrices.txt", f"{row}\n{row}\n", "matrices.txt")
    of("matrix.csv", row.replace(" ", ","), "matrix.csv")
    of("semicolons.csv", row.replace(".", ",").replace(" ", ";"), "semicolons.csv")
    of("array.npy", partial(np.save, "array.npy", np.stack([shifted] * 3)), "array.npy")
    of("lists.json", json.dumps([shifted.tolist()]), "lists.json")
    ours = {"matrices": [shifted.tolist()], "azimuth_deg": [4], "elevation_deg": [None]}
    of("ours.json", json.dumps(ours), "ours.json")
    for convention in ("opencv", "mitsuba", "opengl", "ros"):
        of(f"matrix, {convention}", row, "c.txt", convention=convention)
    half = 0.5**0.5
    turned = f"x,y,z,qx,qy,qz,qw\n1,2,3,0,0,{half},{half}\n"
    of("quaternions", turned, "q.csv")
    of("quaternions, ros, m", turned, "q.csv", convention="ros", length_unit="m")
    of("quaternions, named", turned.replace("x,", "X,").replace("\n1", "\n1", 1), "n.csv")
    of("targets", "x,y,z,target_x,target_y,target_z\n1,2,3,-50,20,0\n", "t.csv")
    of("no header", "1,2,3,4,5,6\n", "none.csv")
    angles = "1.5,-2,3,31,-47.5,112.25\n"
    for robot, names in {
        "fanuc": "w,p,r",
        "yaskawa": "rx,ry,rz",
        "mitsubishi": "a,b,c",
        "kuka": "a,b,c",
        "staubli": "rx,ry,rz",
        "kawasaki": "o,a,t",
        "universal": "rx [rad],ry [rad],rz [rad]",
    }.items():
        own = angles if robot != "universal" else "1.5,-2,3,0.31,-0.47,1.12\n"
        of(f"robot, {robot}", f"x,y,z,{names}\n{own}", "robot.csv", robot=robot)
    quaternion = f"x,y,z,q1,q2,q3,q4\n1,2,3,{half},0,0,{half}\n"
    of("robot, abb", quaternion, "robot.csv", robot="abb")
    of("robot, by its columns", f"x,y,z,w,p,r\n{angles}", "robot.csv")
    kuka = "DEFDAT P\nE6POS P1={X 1.5,Y -2,Z 3,A 31,B -47.5,C 112.25}\nENDDAT\n"
    of("program, kuka", kuka, "p.txt")
    colmap = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ\n1 1 0 0 0 1 2 3\n"
    of("COLMAP", colmap, "images.txt")

    def orbits() -> Any:
        around = iriftrace.Orbit((1.0, 2.0, 3.0), (225.0, 150.0, 100.0))
        found = iriftrace.orbit_poses(around, [0.1, 33.3, 200.0], [-90.0, 0.3])
        return pose_values(found) | {
            "fibonacci": pose_values(iriftrace.fibonacci_poses(around, 7)),
        }

    record("orbits", orbits)


def clouds(record: Record) -> None:
    """Clouds in every format, with columns of many names."""
    from validation.attack import samples

    def of(name: str, content: str | Callable[[], Any], file: str, **options: Any) -> None:
        def read() -> Any:
            Path(file).write_text(content) if isinstance(content, str) else content()
            return cloud_values(Path(file).resolve(), **options)

        record(name, read)

    for ending in ("ply", "stl", "asc", "vtp", "e57", "pcd"):
        name = f"cloud.{ending}"
        of(name, partial(samples.cloud(name), HERE), name)
    rows = np.random.default_rng(1).uniform(-100, 100, (20, 6))

    def text(header: str, order: str, mark: str = ",", decimal: str = ".") -> str:
        lines = [header] if header else []
        for row in rows[:, [int(digit) for digit in order]].tolist():
            lines.append(mark.join(f"{value:.12g}".replace(".", decimal) for value in row))
        return "\n".join(lines) + "\n"

    of("xyz", text("", "012", " "), "a.xyz")
    of("pts with its count", "20\n" + text("", "012", " "), "a.pts")
    of("asc with intensity", text("", "0123", " "), "b.asc")
    of("txt without names", text("", "012", " "), "c.txt")
    of("txt, columns", text("", "3012", " "), "d.txt", columns=["2", "3", "4"])
    of("csv, names", text("i,x,y,z", "3012"), "e.csv")
    of("csv, columns", text("i,a,b,c", "3012"), "f.csv", columns=["a", "b", "c"])
    of("csv, units in brackets", text("x [mm],y [mm],z [mm]", "012"), "g.csv")
    of("csv, metres in parentheses", text("x (m),y (m),z (m)", "012"), "h.csv")
    of("csv, units in names", text("id,x_mm,y_mm,z_mm", "3012"), "i.csv")
    of("csv, ParaView", text('"gap","Points:0","Points:1","Points:2"', "3012"), "j.csv")
    of("csv, decimal commas", text("x;y;z", "012", ";", ","), "k.csv")
    of("txt, comment", text("# id x y z", "3012", " "), "l.txt")
    of("csv, sep=", "sep=;\n" + text("x;y;z", "012", ";"), "m.csv")
    of("csv, German", text("Nr;X-Koordinate;Y-Koordinate;Z-Koordinate", "3012", ";"), "n.csv")
    of("csv, row of units", text("id,x,y,z\n,[mm],[mm],[mm]", "3012"), "o.csv")
    of("csv, normals", text("x,y,z,nx,ny,nz", "012345"), "p.csv")
    of("txt, words", text("Scan 12 January", "012", " "), "q.txt")
    of("csv, quoted", '"x","y","z","i"\n"1.5","2.5","3.5",""\n"4.5","5.5","6.5","7"\n', "r.csv")
    of("csv, empty cells", "x;y;z;i\n1,5;2,5;3,5;\n;;;\n4,5;5,5;6,5;7\n", "s.csv")
    of("csv, -9999", "x,y,z\n1.5,2.5,3.5\n-9999,-9999,-9999\n4.5,5.5,6.25\n4,5,6.125\n", "t.csv")
    of("csv, valid", "x,y,z,valid\n1.5,2.5,3.5,1\n7,8,9,0\n4.5,5.5,6.25,1\n", "u.csv")
    of("csv, zeros", "x,y,z\n1.5,2.5,3.5\n0,0,0\n4.5,5.5,6.25\n", "v.csv")
    of("csv, footer", "x,y,z\n1.5,2.5,3.5\n4.5,5.5,6.25\nmean,,\n", "w.csv")
    of("csv, unit given", text("x,y,z", "012"), "x.csv", length_unit="m")
    of(
        "ptx",
        "2\n2\n1 2 3\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n1 2 3 1\n"
        "0.1 0 0 0.5\n0 0 0 0.5\n0 0.2 0 0.25\n0.1 0.2 0.3 1\n",
        "a.ptx",
    )
