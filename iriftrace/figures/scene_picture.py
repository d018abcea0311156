"""Description of a scene: part, shells of air, devices and bent rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError, SetupError, without_warnings
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures import space
from iriftrace.figures.describe import provenance_rows
from iriftrace.figures.picture import (
    BLOCKER_COLOUR,
    RAY_COLOUR,
    SECOND_COLOUR,
    Device,
    DrawnBody,
    Lines,
    SpacePicture,
    part_surface,
    round_factor,
)
from iriftrace.figures.style import ColourScale, number
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.medium.source import synthetic_mark
from iriftrace.part.part import Part
from iriftrace.tracing.scene import Scene

_MOST_SHELLS = 20
_FEWEST_SHELLS = 4
AIR_COLOUR_MAP = "plasma"
TRANSMITTANCE = 0.2
"""Of all shells together, through which the part must remain visible."""


def scene_picture(
    part: Part,
    air: ShellStack | Sequence[ShellStack],
    camera: Camera,
    second: Camera | None = None,
    *,
    second_name: str = "projector",
    blockers: Sequence[Part] = (),
) -> SpacePicture:
    """Describe part, shells and devices of a scene.

    The half of the shells that faces the viewer is cut away along the vertical plane through the
    part's centre, or that of the air if it is elsewhere, parallel to the camera's axis, so that the
    nesting shows. Their colours are linear in the air's refractivity.

    Parameters
    ----------
    part, camera, second, second_name, blockers
        The scene, mm, world.
    air : ShellStack or sequence of ShellStack
        Shells of each member of an ensemble.
    """
    stacks = [air] if isinstance(air, ShellStack) else list(air)
    towards, side = space.view_direction(camera.forward, -camera.matrix[:3, 1])
    surfaces = [part_surface(part)]
    surfaces += [part_surface(body, "blocks the view", BLOCKER_COLOUR) for body in blockers]
    devices = [Device("camera", camera, part)]
    if second is not None:
        devices.append(Device(second_name, second, part, SECOND_COLOUR, focus=False))
    if stacks:
        scale = temperature_scale(stacks)
        most = max(_FEWEST_SHELLS, _MOST_SHELLS // len(stacks))
        for member, stack in enumerate(stacks):
            surfaces += _shells(stack, scale, member if len(stacks) > 1 else None, most)
    return SpacePicture(
        title=f"Hot part and {'its air' if stacks else 'devices'}",
        surfaces=tuple(surfaces),
        devices=tuple(devices),
        towards=towards,
        cut=(_cut_through(part, stacks[0]), side) if stacks else None,
    )


def picture_of_scene(scene: Scene) -> SpacePicture:
    """Describe a scene with what its file states, and rays whose bending is exaggerated."""
    states = scene.air.states
    stacks = [state.shells for state in states if not state.files or state.files.shells]
    several = scene.averages and len(stacks) == len(states)
    name = scene.second_id.replace("_", " ")
    air = stacks if several else stacks[:1]
    picture = scene_picture(
        scene.part, air, scene.camera, scene.second, second_name=name, blockers=scene.blockers
    )
    source = stacks[0].source if stacks else states[0].source
    rays, bent = _rays(scene)
    count = len(stacks[0].shells) if stacks else 0
    shown = min(count, max(_FEWEST_SHELLS, _MOST_SHELLS // max(len(air), 1)))
    drawn = f" ({shown} drawn)" if shown < count else ""
    subtitle = []
    if stacks:
        low, high = (number(round(end)) for end in picture.scales[0].limits)
        subtitle.append(f"{counted(count, 'shell')} of air{drawn}, {low} to {high} °C")
    if bent:
        subtitle.append(bent)
    members = tuple(member.label or f"member {member.number}" for member in scene.members)
    return SpacePicture(
        title="Scene" if scene.path is None else f"Scene {scene.path.parent.name}",
        subtitle="  ·  ".join(subtitle),
        surfaces=picture.surfaces,
        lines=rays,
        devices=picture.devices,
        members=members if several else (),
        towards=picture.towards,
        cut=picture.cut,
        exaggerated="Bending of the rays" if rays else "",
        facts=provenance_rows(
            {
                "scene": {"path": scene.path, "sha256": scene.sha256},
                "part": {"path": scene.part.path, "sha256": scene.part.sha256},
                "wavelength_nm": scene.wavelength_nm,
                "engine": scene.engine,
                "ensemble": {"members": [member.as_dict() for member in scene.members]},
            },
            source,
        ),
        mark=synthetic_mark(source) or "",
    )


def temperature_scale(stacks: Sequence[ShellStack]) -> ColourScale:
    """Colours over the air's temperature, degC, that are linear in its refractivity."""
    celsius = np.concatenate([stack.temperature_k - ZERO_CELSIUS_K for stack in stacks])
    low, high = float(celsius.min()), float(celsius.max())
    if high - low < 1.0:
        low, high = low - 10.0, high + 10.0
    label = "Air temperature at the shells (°C)"
    return ColourScale(celsius, (low, high), label, False, AIR_COLOUR_MAP, of_air=True)


def _cut_through(part: Part, stack: ShellStack) -> FloatArray:
    """(3,) array, mm: centre of the part, unless it is a board outside the hot air."""
    low, high = (extreme(stack.shells[0].vertices, axis=0) for extreme in (np.min, np.max))
    inside = (part.centre > low).all() and (part.centre < high).all()
    return part.centre if inside else np.asarray((low + high) / 2.0, dtype=np.float64)


def _shells(
    stack: ShellStack, scale: ColourScale, member: int | None, most: int
) -> list[DrawnBody]:
    """All shells, or as many as the eye can tell apart, the outermost first."""
    drawn = np.rint(np.linspace(0, len(stack.shells) - 1, min(len(stack.shells), most)))
    opacity = float(1.0 - TRANSMITTANCE ** (1.0 / len(drawn)))
    celsius: FloatArray = stack.temperature_k - ZERO_CELSIUS_K
    return [
        DrawnBody(
            f"shell {place + 1} of {len(stack.shells)}",
            (shell := stack.shells[place]).vertices,
            shell.faces,
            scale=scale,
            values=float(celsius[place]),
            normals=shell.normals,
            opacity=opacity,
            member=member,
        )
        for place in drawn.astype(int).tolist()
    ]


def _rays(scene: Scene) -> tuple[tuple[Lines, ...], str]:
    """Rays of the camera through the heaviest member, and how far they are bent; or why not."""
    from iriftrace.tracing.paths import camera_paths

    try:
        with without_warnings():
            ready = scene.ready
            heaviest = int(np.argmax(ready.weights.weights)) if ready.members else 0
            one = next(iter(ready.alone([heaviest]))) if ready.members else ready
            paths = camera_paths(one)
            through = f" ({ready.members[heaviest].label})" if ready.averages else ""
    except (InputError, SetupError) as error:
        return (), f"without rays ({str(error).rstrip('.')})"
    if not len(paths.bent):
        return (), "no ray of a sample meets the part"
    size = float(np.linalg.norm(np.ptp(scene.part.bounds, axis=0)))
    factor = round_factor(paths.largest_offset, size)
    bent, straight = list(paths.bent), list(paths.straight)
    lines = Lines(f"bent rays{through}", bent, RAY_COLOUR, straight, factor, width=1.5)
    return (lines,), f"rays are bent by up to {1e3 * paths.largest_offset:.3g} µm"
