"""OpenFOAM cells whose faces have more than four corners, against their volume and surface."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.io.field import read_field


def test_faces_with_many_corners_are_split_alike_from_both_sides(tmp_path: Path) -> None:
    """Prisms on hexagons side by side: eight faces, two of them with six corners."""
    grid = hexagons()
    kelvin = np.array([293.15, 400.0, 500.0])
    write_prisms(tmp_path, grid, kelvin)
    field = read_field(tmp_path)
    area = 1.5 * np.sqrt(3.0)
    assert field.grid.volume == pytest.approx(3 * area * 1e3**3, rel=1e-6)
    surface = field.grid.extract_surface(algorithm="geometry")
    assert surface.area == pytest.approx((2 * area + 18.0) * 1e6, rel=1e-6)


def hexagons() -> np.ndarray:
    """Corners of four regular hexagons with edge 1 above each other, (4, 6, 3)."""
    angle = np.arange(6) * np.pi / 3
    return np.stack(
        [np.stack([np.cos(angle), np.sin(angle), np.full(6, float(z))], axis=1) for z in range(4)]
    )


def write_prisms(folder: Path, layers: np.ndarray, kelvin: np.ndarray) -> None:
    """A stack of three prisms, written by hand: the common writer knows four corners at most."""
    faces, owner, neighbour = [], [], []
    for z in (1, 2):
        faces.append([6 * z + k for k in range(6)])
        owner.append(z - 1)
        neighbour.append(z)
    faces.append(list(range(6))[::-1])
    owner.append(0)
    faces.append([18 + k for k in range(6)])
    owner.append(2)
    for z in range(3):
        for k in range(6):
            a, b = 6 * z + k, 6 * z + (k + 1) % 6
            faces.append([a, b, b + 6, a + 6])
            owner.append(z)

    def save(name: str, kind: str, items: list[str]) -> None:
        path = folder / "constant/polyMesh" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"
            f"{len(items)}\n(\n" + "\n".join(items) + "\n)\n"
        )

    save("points", "vectorField", [f"({x} {y} {z})" for x, y, z in layers.reshape(-1, 3)])
    save("faces", "faceList", [f"{len(f)}({' '.join(map(str, f))})" for f in faces])
    save("owner", "labelList", list(map(str, owner)))
    save("neighbour", "labelList", list(map(str, neighbour)))
    save("boundary", "polyBoundaryMesh", ["all { type patch; nFaces 20; startFace 2; }"])
    (folder / "1").mkdir()
    (folder / "1/T").write_text(
        "FoamFile { version 2.0; format ascii; class volScalarField; object T; }\n"
        "dimensions [0 0 0 1 0 0 0];\ninternalField nonuniform List<scalar> 3 ("
        + " ".join(map(str, kelvin))
        + ");\nboundaryField { all { type zeroGradient; } }\n"
    )
