"""The XML file of a scene: its elements, what Mitsuba parses from it, and checks of its meshes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import check_readable
from iriftrace.core.runtime import variant as runtime
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.io.ply import read_whole_ply
from iriftrace.medium.shells.hessian import PLY_COLUMNS

if TYPE_CHECKING:
    import mitsuba as mi
    from mitsuba.parser import SceneNode

_DERIVATIVES = frozenset(f"{name}_1".encode() for name in PLY_COLUMNS)
"""Columns of a shell's file that have the derivatives of the index."""

WAVELENGTH = "wavelength"
"""Parameter of every scene, independent of its file."""

BLOCKER_ID = "blocker_"
"""Beginning of the ids of bodies that only block the view."""

SHELL_BSDFS = ("iso_shell", "dielectric")

_NAMED_FILES = {"calibrated_camera": ("calibration", None), "gradient_path": ("field", FIELD_FILE)}
"""Properties of plugins that name files, besides the filenames of meshes, and their defaults."""


@frozen(eq=False)
class SceneFile:
    """Files and placement of the meshes of a scene."""

    part_path: Path  # mesh of the shape with id ``part``
    part_to_world: FloatArray  # (4, 4)
    shell_paths: tuple[Path, ...]
    shells_moved: bool  # some have a to_world, so they do not lie where the field does
    blockers: tuple[tuple[Path, FloatArray], ...]  # meshes of bodies that only block the view
    file_paths: tuple[Path, ...]  # all that it names: meshes of any object, fields


def read_scene_file(path: Path, values: Mapping[str, str]) -> SceneFile:
    """Parse a scene's XML without loading it, and refuse or warn of what would spoil the result."""
    import mitsuba as mi

    nodes = _parsed(path, values)
    shapes = [node.props for node in nodes if node.type == mi.ObjectType.Shape]
    files = _files(nodes, path)
    for file in files:
        check_readable(file)
    for node in nodes:
        _check_named_file(node, path)
    part, part_path = _the_part(shapes, path)
    for props in shapes:
        mesh = _mesh_file(props, path)
        # Mitsuba also looks in the current folder.
        if mesh is not None and not os.path.isfile(str(props["filename"])):
            _check_there(mesh, path)
    shells = [props for props in shapes if _is_shell(props, nodes)]
    shell_paths = _shell_meshes(shells, _bends_in_layers(nodes), path)
    _warn_of_lost_accuracy(nodes, bool(shell_paths), path)
    return SceneFile(
        part_path=part_path,
        part_to_world=_placement(part, "The part"),
        shell_paths=shell_paths,
        shells_moved=any(
            not np.array_equal(_placement(props, "A shell"), np.eye(4)) for props in shells
        ),
        blockers=tuple(
            (mesh, _placement(props, "A blocker"))
            for props in shapes
            if props.id().startswith(BLOCKER_ID) and (mesh := _mesh_file(props, path)) is not None
        ),
        file_paths=files,
    )


def _parsed(path: Path, values: Mapping[str, str]) -> list[SceneNode]:
    """Nodes of an XML file that is a scene and has these parameters."""
    import mitsuba as mi

    _check_variables(path, read_xml(path), values)
    values = of_the_file(values)
    try:
        config = mi.parser.ParserConfig(str(mi.variant()))
        state = mi.parser.parse_file(config, str(path), **values)
        mi.parser.transform_resolve_references(config, state)
    except RuntimeError as error:
        raise InputError(runtime.readable(error), code="scene.unreadable") from error
    return list(state.nodes)


def _the_part(shapes: Sequence[mi.Properties], path: Path) -> tuple[mi.Properties, Path]:
    """The shape that is measured, and its mesh."""
    parts = [props for props in shapes if props.id() == "part"]
    if len(parts) != 1:
        raise InputError(
            f'{path} has {len(parts)} shapes with id="part", but the measured part is known by it; '
            "give exactly one shape this id.",
            code="scene.part_count",
        )
    part_path = _mesh_file(parts[0], path)
    if part_path is None:
        raise InputError(
            f'The shape with id="part" in {path} is a {parts[0].plugin_name()}, but faces and '
            "regions need a mesh file; use type ply.",
            code="part.no_mesh",
        )
    _check_there(part_path, path)
    return parts[0], part_path


def _shell_meshes(shells: Sequence[mi.Properties], in_layers: bool, path: Path) -> tuple[Path, ...]:
    """Meshes of shells with the data that bend rays, at the shells or in the layers between."""
    meshes, flat = [], []
    for props in shells:
        placement = _placement(props, f"Shell '{props.id()}'")
        mesh = _mesh_file(props, path)
        if mesh is None:
            continue
        turn, columns = placement[:3, :3], _ply_columns(mesh)
        keeps_lengths = np.allclose(turn.T @ turn, np.eye(3), atol=1e-6)
        if in_layers and not keeps_lengths and columns and columns.issuperset(_DERIVATIVES):
            raise InputError(
                f"Shell '{props.id()}' in {path} has a to_world that changes lengths, but its file "
                "gives the index's derivatives per mm of its own; write the scene again from the "
                "moved field, or bend rays at the shells alone (bending=shells).",
                code="shells.stretched",
                argument="field_transform",
            )
        meshes.append(mesh)
        if not _flag(props, "face_normals") and not _has_normals(mesh, columns):
            flat.append(mesh.name)
    if flat:
        raise InputError(
            f"{', '.join(flat)} in {path} has no vertex normals, and Mitsuba would derive some "
            'without grad(n); add <boolean name="face_normals" value="true"/> to the shape.',
            code="shells.no_normals",
        )
    return tuple(meshes)


def _warn_of_lost_accuracy(nodes: Sequence[SceneNode], has_shells: bool, path: Path) -> None:
    if any(_plugin(node) == "dielectric" for node in nodes):
        warn_of_dielectric(str(path))
    if has_shells and not any(_flag(n.props, "embree_use_robust_intersections") for n in nodes):
        warn(
            f"{path} does not set embree_use_robust_intersections, so single rays can slip between "
            'triangles; add <boolean name="embree_use_robust_intersections" value="true"/>.'
        )


def warn_of_dielectric(name: str) -> None:
    """Warn of a scene whose shells are Mitsuba's."""
    warn(
        f"{name} has shells with Mitsuba's dielectric, whose single-precision index ratio costs up "
        "to 0.6 % of the deflection; use iso_shell."
    )


def require_scene(path: Path) -> None:
    """Refuse the name of a scene that does not exist."""
    if not path.is_file():
        raise InputError(
            f"There is no scene file {path}; `iriftrace scene` writes one.", code="file.missing"
        )


def read_xml(path: Path) -> ElementTree.Element:
    """Root of a scene's XML file with its comments; raises InputError for any other file."""
    require_scene(path)
    check_readable(path)
    root = None
    try:
        with path.open("rb") as file:
            # The file of another program may be large.
            root = next(ElementTree.iterparse(file, ("start",)))[1]
        if root.tag == "scene":
            builder = ElementTree.TreeBuilder(insert_comments=True)
            return ElementTree.parse(path, ElementTree.XMLParser(target=builder)).getroot()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        if root is not None:
            raise InputError(
                f"{path} is no longer XML ({error}); correct it, or write the scene again.",
                code="scene.damaged",
            ) from error
    raise InputError(
        f"{path} is not a Mitsuba scene; give the XML file that `iriftrace scene` makes from a "
        "field and a part.",
        code="scene.other_file",
    )


def parameters_of(root: ElementTree.Element) -> list[str]:
    """Names of the ``<default>`` parameters of a scene's XML."""
    return [str(element.get("name")) for element in root.iter("default")]


def _check_variables(path: Path, root: ElementTree.Element, values: Mapping[str, str]) -> None:
    known = parameters_of(root)
    if WAVELENGTH in values and WAVELENGTH in known:
        raise InputError(
            f'{path} has a parameter "{WAVELENGTH}" of its own, so the name is ambiguous; '
            "rename the file's parameter.",
            code="scene.own_wavelength",
        )
    unknown = [name for name in of_the_file(values) if name not in known]
    if unknown:
        raise InputError(
            f"{path} has no parameter {', '.join(unknown)}, so setting it would change nothing; "
            f"it has {', '.join(known) or 'none'}.",
            code="scene.unknown_parameter",
            argument="define",
        )
    # An included file may use parameters that the file itself does not.
    used = " ".join(value for element in root.iter() for value in element.attrib.values())
    unneeded = [name for name in known if f"${name}" not in used]
    if unneeded and root.find(".//include") is None:
        raise InputError(
            f'{path} has <default name="{unneeded[0]}">, but nothing in it uses ${unneeded[0]}, so '
            "setting it would change nothing; remove it or use it.",
            code="scene.unused_parameter",
        )


def of_the_file(values: Mapping[str, str]) -> dict[str, str]:
    """The parameters that belong to the scene file itself."""
    return {name: value for name, value in values.items() if name != WAVELENGTH}


def _plugin(node: SceneNode) -> str:
    return str(node.props.plugin_name())


def _flag(props: mi.Properties, name: str) -> bool:
    return name in props and props[name] is True


def _is_shell(props: mi.Properties, nodes: Sequence[SceneNode]) -> bool:
    import mitsuba as mi

    children = (props[key] for key in list(props.keys()))
    linked = (c for c in children if isinstance(c, mi.Properties.ResolvedReference))
    return any(_plugin(nodes[child.index()]) in SHELL_BSDFS for child in linked)


def _mesh_file(props: mi.Properties, scene: Path) -> Path | None:
    if "filename" not in props:
        return None
    named = Path(str(props["filename"]))
    return named if named.is_absolute() else scene.parent / named


def _check_named_file(node: SceneNode, scene: Path) -> None:
    """Refuse a file of the current folder, where Mitsuba also looks, instead of the scene's."""
    name, default = _NAMED_FILES.get(_plugin(node), ("", None))
    named = node.props.get(name, default) if name else None
    # A missing file is reported by the reader that needs it, with more detail.
    if isinstance(named, str) and os.path.isfile(named):
        _check_there(scene.parent / named, scene)


def _check_there(file: Path, scene: Path) -> None:
    if file.is_file():
        return
    if file.is_relative_to(scene.parent):
        raise InputError(
            f"{file.relative_to(scene.parent)} is not next to {scene}; move the whole folder.",
            code="file.missing",
        )
    raise InputError(
        f"The file {file}, which {scene} names, is missing; correct its path.", code="file.missing"
    )


def _files(nodes: Sequence[SceneNode], scene: Path) -> tuple[Path, ...]:
    """Every file that a property names, once."""
    words = [
        str(node.props[key])
        for node in nodes
        for key in list(node.props.keys())
        if isinstance(node.props[key], str)
    ]
    # A value that is not a name, such as a long text, is not a file either.
    return tuple(
        file for word in dict.fromkeys(words) if os.path.isfile(file := scene.parent / word)
    )


def _placement(props: mi.Properties, what: str) -> FloatArray:
    if "to_world" not in props:
        return np.eye(4)
    to_world: Any = props["to_world"]
    matrix = np.array(to_world.matrix, dtype=np.float64).reshape(4, 4)
    if np.linalg.det(matrix[:3, :3]) <= 0:
        raise InputError(
            f"{what} has a to_world that mirrors it, which would turn its triangles inside out; "
            "mirror the mesh itself instead.",
            code="scene.mirrored",
        )
    return matrix


def _bends_in_layers(nodes: Sequence[SceneNode]) -> bool:
    """True if an integrator bends rays in layers; without one the default one may, which does."""
    chosen = [
        (node.props.get("bending", "layers"), node.props.get("normals", "gradient"))
        for node in nodes
        if _plugin(node) == "first_hit"
    ]
    return not chosen or ("layers", "gradient") in chosen


def _ply_columns(mesh: Path) -> set[bytes] | None:
    """Words of the header of a PLY; None if the file is missing or not one."""
    if not mesh.is_file() or mesh.suffix.lower() != ".ply":
        return None
    with mesh.open("rb") as file:
        head, end, _ = file.read(4096).partition(b"end_header")
    return set(head.split()) if end else None


def _has_normals(mesh: Path, columns: set[bytes] | None) -> bool:
    """True for normals, and for a file that is missing or damaged, which Mitsuba reports."""
    if not mesh.is_file() or mesh.suffix.lower() == ".ply":
        return columns is None or b"nx" in columns
    return mesh.suffix.lower() == ".obj" and b"\nvn " in mesh.read_bytes()


def check_meshes(files: Iterable[Path]) -> None:
    """Refuse damaged meshes, whose corners Mitsuba does not check."""
    for mesh in files:
        if mesh.suffix.lower() == ".ply":
            read_whole_ply(mesh, "write the scene again")
