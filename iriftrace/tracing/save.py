"""Save a scene: check that air, part and camera fit together, then write its folder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import evolve, field, frozen

from iriftrace.core.errors import InputError, warn
from iriftrace.medium.part_fit import body_in_air
from iriftrace.medium.shells.report import ShellReport, report_shells
from iriftrace.tracing.ensemble import FOLDER
from iriftrace.tracing.hot_air import AirState, HotAir
from iriftrace.tracing.viewpoint import refuse_bad_places
from iriftrace.tracing.write import SHELLS_FOLDER, write_ensemble_scene, write_scene
from iriftrace.tracing.xml import PART_FILE, SceneSettings, refuse_edited

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.medium.part_fit import Fit
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part
    from iriftrace.tracing.hot_air import FieldMember


@frozen(eq=False)
class SavedScene(PathLike[str]):
    """A scene that was written; usable as the path of its XML file.

    Attributes
    ----------
    path : Path
        The XML file.
    shells : ShellStack
        Those of the first state of the air as written.
    reports : tuple of tuple of ShellReport
        Facts about each shell, for each state.
    fits : tuple of Fit or None
        How field and part lie relative to each other, for each state; None for ready-made shells.
    members : tuple of FieldMember
        The states of an ensemble; empty for one state.
    """

    path: Path
    shells: ShellStack = field(repr=False)
    reports: tuple[tuple[ShellReport, ...], ...] = field(repr=False)
    fits: tuple[Fit | None, ...] = field(repr=False)
    members: tuple[FieldMember, ...] = ()

    def __fspath__(self) -> str:
        return str(self.path)


def save_scene(
    xml: Path,
    part: Part,
    states: Iterable[AirState],
    camera: Camera,
    settings: SceneSettings,
    *,
    ensemble: bool = False,
    wall_temperature_k: float | None = None,
) -> SavedScene:
    """Write the scene of a part in air of one state or, as an ensemble, of several.

    One state is in memory at a time, if `states` makes them so. See :meth:`iriftrace.Scene.save`,
    with its errors and warnings; those of an ensemble have the member's label.
    """
    _check_place(xml, part)
    shown: list[ShellStack] = []
    reports: list[tuple[ShellReport, ...]] = []
    fits: list[Fit | None] = []
    told: dict[str, list[str]] = {}

    def checked() -> Iterator[AirState]:
        for state in states:
            with named(state.label) if ensemble else nullcontext():
                fit = state.fit(part, settings.blockers, wall_temperature_k)
                for message in () if fit is None else fit.warnings:
                    if ensemble:
                        told.setdefault(message, []).append(state.label)
                    else:
                        warn(message)
                report = _report(camera, part, settings, state)
            fits.append(fit)
            reports.append(report)
            if not shown:
                shown.append(state.shells)
            notes = state.notes if fit is None else {**state.notes, **fit.notes}
            made = evolve(state, ready=state.shells, report=report, notes=notes)
            # One state is in memory at a time: none while the next one is made.
            del state
            yield made
            del made

    listed: tuple[FieldMember, ...] = ()
    if ensemble:
        _, listed = write_ensemble_scene(
            xml.parent, part, checked(), camera, settings, name=xml.name
        )
    else:
        write_scene(xml.parent, part, next(checked()), camera, settings, name=xml.name)
    for message, labels in told.items():
        of_all = len(labels) == len(reports)
        warn(message if of_all else f"{', '.join(labels)}: {message}")
    return SavedScene(xml, shown[0], tuple(reports), tuple(fits), listed)


def refuse_air(name: str, air: HotAir, wavelength_nm: float | None) -> None:
    """Refuse air that the files of a scene cannot hold as it is traced."""
    for state in air.states:
        if state.files:
            raise InputError(
                f"{name} has the air of a scene that exists already, whose files hold more than "
                "can be written here; copy its folder, or give the Scene the air of fields "
                "(HotAir(read_field(...))).",
                code="scene.of_files",
            )
        own = (state.field or state.shells).air
        if wavelength_nm not in (None, own.wavelength_nm):
            raise InputError(
                f"{name} is traced at {wavelength_nm:g} nm, but its files would hold its air at "
                f"{own.wavelength_nm:g} nm; save it without wavelength_nm, and load it with "
                f'{{"wavelength": {wavelength_nm!r}}}.',
                code="scene.other_light",
            )


@contextmanager
def named(label: str, remedy: str = "") -> Iterator[None]:
    """Add the member of an ensemble to an error without it, and a remedy in brackets."""
    try:
        yield
    except InputError as error:
        if label in str(error):
            raise
        raise InputError(
            f"the member {label} cannot be used{remedy}: {error}",
            code=error.code,
            argument=error.argument,
        ) from error


def _check_place(xml: Path, part: Part) -> None:
    """Refuse an XML file whose folder has no room for the scene's own copy of the part."""
    copy = xml.parent / PART_FILE
    if Path(part.path).resolve() == copy.resolve():
        raise InputError(
            f"The scene's own {PART_FILE} would replace the part's file {part.path}; give the "
            f"scene a folder of its own, such as {xml.with_suffix('') / xml.name}.",
            code="output.replaces",
            argument="output",
        )
    of_a_scene = any((xml.parent / name).exists() for name in (SHELLS_FOLDER, FOLDER))
    if copy.is_file() and not of_a_scene:
        raise InputError(
            f"The scene's own copy of the part would replace {copy}, where there is no scene yet; "
            f"give the scene a folder of its own, such as {xml.with_suffix('') / xml.name}.",
            code="output.replaces",
            argument="output",
        )
    refuse_edited(xml)


def _report(
    camera: Camera, part: Part, settings: SceneSettings, state: AirState
) -> tuple[ShellReport, ...]:
    """Facts about the shells, for devices that stand neither in a body nor in hot air."""
    refuse_bad_places(camera, settings.second, (part, *settings.blockers), state)
    volume = state.field
    hot = part if volume is None else body_in_air(volume, part, settings.blockers)
    return report_shells(state.shells, volume, hot)
