"""The command ``iriftrace photograph``: the picture that a scene's camera would take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from attrs import evolve
from cyclopts import Parameter

from iriftrace.cli import checks
from iriftrace.cli.console import say, working
from iriftrace.cli.groups import group
from iriftrace.cli.options import Output, Whole
from iriftrace.cli.trace_options import Tracing, load
from iriftrace.core.units import Length
from iriftrace.photo.image_sensor import USUAL_SENSOR, ImageSensor
from iriftrace.photo.light import Light, LightKind
from iriftrace.photo.options import AMBIENT, EMISSIVITY, HOT, SAMPLES, AirOfPicture
from iriftrace.tracing.options import TRACE_AS_STATED

LIGHT = Light()

Lamp = Annotated[Light, group(Light, "Light of the second device", 2, kind=Parameter(parse=False))]
Chip = Annotated[ImageSensor, group(ImageSensor, "Lens and image sensor", 3)]


def photograph(
    scene: Path,
    *,
    output: Output = Path("photograph/image.tiff"),
    air: AirOfPicture = HOT,
    temperature: list[str] | None = None,
    emissivity: float = EMISSIVITY,
    blocker_temperature: str | None = None,
    printed: Annotated[str | None, Parameter(name="--print")] = None,
    print_width: Length | None = None,
    print_to_world: str | None = None,
    ambient: float = AMBIENT,
    light: LightKind | None = None,
    lamp: Lamp = LIGHT,
    sensor: Chip = USUAL_SENSOR,
    samples: Whole = SAMPLES,
    seed: Whole = 0,
    noise: bool = True,
    trace: Tracing = TRACE_AS_STATED,
) -> None:
    """Take the picture of a scene's camera, through hot air, without it or both, with the truth.

    Writes 16-bit TIFF, truth.exr (where each pixel's point is, its shift, and the place in the
    second device's picture that lights it) and README.md with the numbers into the output's folder.

    Example: ``iriftrace photograph scene.xml -o photo/image.tiff --temperature "1100 degC"``

    Parameters
    ----------
    scene
        The scene's XML file.
    output
        The picture, .tiff; others that are taken get their names before the ending.
    air
        Take it through hot air, without it and without glow, or both with one exposure.
    temperature
        Temperature at which the part glows, "1100 degC"; NAME=TEMPERATURE for regions with another
        one, repeatable; or "field" for that of the field's wall. By default it does not glow.
    emissivity
        Of the part, 0 to 1; it reflects the rest diffusely.
    blocker_temperature
        The same of bodies that only block the view, such as the hot part in front of a board.
    printed
        Print on the part or board: the dots of ``iriftrace part board`` (board.csv), a picture
        (.png, .tiff), or columns and rows of a checkerboard, 10x7.
    print_width
        Width of a picture or checkerboard.
    print_to_world
        The print's frame (x right, y up, z towards the viewer) to the world's, as --part-transform
        of ``iriftrace scene``.
    ambient
        Irradiance by diffuse light, W/(m^2 nm).
    light
        Light of the second device, a projector or laser; dark by default. Fringes take a picture
        for each phase step.
    samples
        Rays along each side of a pixel.
    seed
        Of the noise.
    noise
        Shot and read noise.
    """
    from iriftrace.core.mesh.transform import parse_transform
    from iriftrace.io.photographs import check_folder
    from iriftrace.photo.appearance import Appearance
    from iriftrace.photo.photograph import photograph as take
    from iriftrace.photo.prints import read_print

    checks.scenes(scene)
    checks.output(output, "image.tiff", ".tif", make=True)
    check_folder(output.parent)
    part = Appearance(emissivity, temperature)
    if printed is not None:
        part = evolve(part, printed=read_print(printed, print_width))
    if print_to_world is not None:
        part = evolve(part, to_world=parse_transform(print_to_world))
    loaded = load(scene, trace)
    with working("Taking the picture"):
        found = take(
            loaded,
            air=air,
            part=part,
            blockers=Appearance(temperature=blocker_temperature),
            light=None if light is None else evolve(lamp, kind=light),
            ambient=ambient,
            sensor=sensor,
            samples=samples,
            seed=seed if noise else None,
        )
    files = found.save(output)
    say(f"Exposure {1e3 * found.numbers['sensor']['exposure']:.4g} ms")
    say("Files: " + ", ".join(map(str, files)))
