"""Text of a scene's XML file, for Mitsuba and for editing by hand, and the settings in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from attrs import Factory, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.part.part import Part
from iriftrace.tracing.objects import iso_shell_indices, lookat
from iriftrace.tracing.options import GRADIENT, SCALE

PART_FILE = "part.ply"
BLOCKER_FILE = "blocker_{}.ply"
"""Names of the files of bodies that only block the view, by their number from 1."""

_SEAL = "<!-- No command replaces this file once it is changed. SHA-256 of the rest: "
"""Start of the line that shows whether a file was edited."""


@frozen(eq=False, kw_only=True)
class SceneSettings:
    """Settings of a scene's file, besides part, camera and air.

    Attributes
    ----------
    scale : float
        Default of the file's parameter ``scale``, a factor on the resolution.
    normals : str
        Default of the file's parameter ``normals``: ``"gradient"`` or ``"facet"``.
    notes : mapping of str
        Facts about the field, such as ``{"time": "snapshot"}``; stated in every result.
    second : Camera or None
        The device with which points are triangulated (:func:`iriftrace.measure`), at its full
        resolution.
    second_id : str
        Its id, which states its kind: ``"projector"``, ``"camera_2"`` or ``"laser"``.
    blockers : tuple of Part
        Bodies that only block the view, mm, world: supports; or the hot part, if the part is a
        board that is seen past it.
    """

    scale: float = SCALE
    normals: str = GRADIENT
    notes: Mapping[str, str] = Factory(dict)
    second: Camera | None = None
    second_id: str = "projector"
    blockers: tuple[Part, ...] = ()


def scene_xml(
    camera: Camera,
    settings: SceneSettings,
    shapes: Sequence[str],
    remark: str = "",
    parameters: Mapping[str, str] | None = None,
) -> str:
    """XML of a scene: integrator, cameras, bodies and the shapes that bend the light.

    `shapes` are the lines after the part: shells, or their include; `parameters` are further
    parameters of the shapes, with defaults; `remark` is a comment at the top.
    """
    head = [
        '<?xml version="1.0" encoding="utf-8"?>',
        "<!-- Lengths in mm. Move the camera or set -D scale=..., then run iriftrace",
        "     render on this file again. -->",
        *([f"<!-- {remark.replace('--', '-').rstrip('-')} -->"] if remark else []),
    ]
    lines = [
        '<scene version="3.0.0">',
        f'    <default name="scale" value="{settings.scale!r}"/>',
        f'    <default name="normals" value={quoteattr(settings.normals)}/>',
        '    <default name="bending" value="layers"/>',
        *(
            f'    <default name="{name}" value={quoteattr(value)}/>'
            for name, value in (parameters or {}).items()
        ),
        '    <boolean name="embree_use_robust_intersections" value="true"/>',
        "",
        '    <integrator type="first_hit">',
        '        <string name="normals" value="$normals"/>',
        '        <string name="bending" value="$bending"/>',
        "    </integrator>",
        "",
        *sensor_lines(camera, "camera"),
        *(sensor_lines(settings.second, settings.second_id) if settings.second else []),
        *_body_lines("part", PART_FILE),
        *(
            line
            for number in range(1, len(settings.blockers) + 1)
            for line in _body_lines(f"blocker_{number}", BLOCKER_FILE.format(number))
        ),
    ]
    return sealed("\n".join([*head, ""]), "\n".join([*lines, *shapes, "</scene>", ""]))


def _body_lines(name: str, file: str) -> list[str]:
    """Lines of an opaque body with an id and a file."""
    return [
        f'    <shape type="ply" id="{name}">',
        f'        <string name="filename" value={quoteattr(file)}/>',
        '        <boolean name="face_normals" value="true"/>',
        '        <bsdf type="diffuse"/>',
        "    </shape>",
    ]


def sensor_lines(camera: Camera, name: str) -> list[str]:
    """Lines of a camera with the id `name`, followed by an empty one."""
    near, far = camera.focus_mm
    pose = {key: ", ".join(map(repr, vector)) for key, vector in lookat(camera).items()}
    return [
        f'    <sensor type="calibrated_camera" id="{name}">',
        f'        <float name="focal_length" value="{camera.focal_length_mm!r}"/>',
        f'        <float name="sensor_width" value="{camera.sensor_mm[0]!r}"/>',
        f'        <float name="sensor_height" value="{camera.sensor_mm[1]!r}"/>',
        f'        <float name="principal_point_x" value="{camera.principal_point_px[0] + 0.5!r}"/>',
        f'        <float name="principal_point_y" value="{camera.principal_point_px[1] + 0.5!r}"/>',
        *(
            f'        <float name="{key}" value="{value!r}"/>'
            for key, value in (camera.distortion.as_dict() if camera.distortion else {}).items()
            if value
        ),
        f'        <float name="focus_near" value="{near!r}"/>',
        *([f'        <float name="focus_far" value="{far!r}"/>'] if np.isfinite(far) else []),
        '        <float name="scale" value="$scale"/>',
        '        <transform name="to_world">',
        f'            <lookat origin="{pose["origin"]}"',
        f'                    target="{pose["target"]}"',
        f'                    up="{pose["up"]}"/>',
        "        </transform>",
        '        <film type="hdrfilm">',
        f'            <integer name="width" value="{camera.resolution[0]}"/>',
        f'            <integer name="height" value="{camera.resolution[1]}"/>',
        '            <string name="pixel_format" value="luminance"/>',
        '            <string name="component_format" value="float32"/>',
        '            <rfilter type="box"/>',
        "        </film>",
        "    </sensor>",
        "",
    ]


def shell_shapes(stack: ShellStack, meshes: Sequence[Path], folder: str) -> list[str]:
    """Lines of the shells, whose meshes lie in a folder relative to the scene's file."""
    lines = []
    for shell, mesh in zip(stack.shells, meshes, strict=True):
        lines += [
            "",
            f'    <shape type="ply" id="{mesh.stem}">',
            f'        <string name="filename" value={quoteattr(f"{folder}/{mesh.name}")}/>',
            *(
                ['        <boolean name="face_normals" value="true"/>']
                if shell.normals is None
                else []
            ),
            '        <bsdf type="iso_shell">',
            *(
                f'            <float name="{name}" value="{index!r}"/>'
                for name, index in iso_shell_indices(shell).items()
            ),
            f'            <string name="layer" value="{shell.layer}"/>',
            "        </bsdf>",
            "    </shape>",
        ]
    return lines


def included_xml(shapes: Sequence[str]) -> str:
    """XML of a file that scenes include."""
    head = ['<?xml version="1.0" encoding="utf-8"?>', '<scene version="3.0.0">']
    return "\n".join([*head, *shapes, "</scene>", ""])


def refuse_edited(xml: Path) -> None:
    """Refuse to replace a scene's file that was written or edited by hand."""
    if not xml.is_file():
        return
    text = xml.read_text(encoding="utf-8", errors="replace")
    head, found, rest = text.partition(_SEAL)
    if not found or sealed(head, rest.partition("\n")[2]) != text:
        raise InputError(
            f"{xml} was edited by hand, so it is not replaced; render it as it "
            "is, name another output, or remove it.",
            code="scene.edited",
            argument="output",
        )


def sealed(head: str, rest: str) -> str:
    """Both pieces of a scene's XML with the check sum between them, which reveals edits."""
    return f"{head}{_SEAL}{sha256((head + rest).encode()).hexdigest()} -->\n{rest}"
