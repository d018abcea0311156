"""A project in Python: the values of its file, made when they are asked for."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from attrs import field, frozen

from iriftrace.cli.console import PROJECT_FILE, out
from iriftrace.cli.plot import read_shown
from iriftrace.cli.program import app
from iriftrace.cli.project_file import NO_VERDICT, ProjectFile, read_project_file
from iriftrace.core.html import html_table, picture
from iriftrace.figures.describe_scan import describe, sentences
from iriftrace.measuring.options import USUAL_DEVICES
from iriftrace.measuring.uncertainty.options import NOTHING_ASKED
from iriftrace.project.results import corrected_values
from iriftrace.project.run import do_steps, options_of
from iriftrace.project.stamps import states_of
from iriftrace.tracing.options import TRACE_AS_STATED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from iriftrace.measuring.two_devices.budget import FeatureBudget
    from iriftrace.measuring.two_devices.correction import Correction
    from iriftrace.measuring.two_devices.scan import Scan
    from iriftrace.tracing.scene import Scene


@frozen(eq=False)
class Project:
    """A project of a file iriftrace.toml.

    Steps that are not up to date are done first, as ``iriftrace run`` does them, so both share the
    products in the project's folder.

    Attributes
    ----------
    folder : Path
        The project's folder.
    file : ProjectFile
        What the file states.
    """

    folder: Path
    file: ProjectFile = field(repr=False)

    @classmethod
    def read(cls, path: str | Path = PROJECT_FILE) -> Self:
        """Read a project's file; InputError for a wrong key or value."""
        folder, name = Path(path).absolute().parent, Path(path).name
        with chdir(folder):
            return cls(folder, read_project_file(Path(name), app))

    def run(self, *steps: str) -> tuple[str, ...]:
        """Do the steps, by default all, that are not up to date; returns those that were done."""
        with self._here():
            return tuple(do_steps(self.file, steps, lambda text: None))

    @property
    def status(self) -> dict[str, str]:
        """Why each step has to be done; "" for those that are up to date."""
        with self._here():
            return {name: state.reason for name, state in states_of(self.file).items()}

    @cached_property
    def scene(self) -> Scene:
        """Part, air and devices; with a fitted board the fitted air."""
        return self._loaded("fit" if "fit" in self.status else "scene")

    @cached_property
    def scan(self) -> Scan:
        """What the two devices measure, simulated in the air before a fit, as by the step."""
        from iriftrace.measuring.two_devices.measure import measure

        devices = self._options("measure", "SCENE").get("devices", USUAL_DEVICES)
        return measure(self._loaded("scene"), system=devices.system, phase=devices.phase)

    @cached_property
    def correction(self) -> Correction:
        """The cloud of [scan] without its refraction error."""
        from iriftrace.core.mesh.transform import apply, read_motion
        from iriftrace.io.clouds import read_cloud
        from iriftrace.measuring.two_devices.correct import correct

        name = self.file.get("scan", "cloud")
        if name is None:
            raise self.file.fault(
                "it is missing, so there is nothing to correct; name the measured cloud.",
                *("scan", "cloud"),
                code="project.no_cloud",
            )
        options = self._options("correct", "CLOUD", "SCENE")
        devices = options.get("devices", USUAL_DEVICES)
        columns, motion = options.get("columns"), options.get("cloud_to_part")
        with self._here():
            cloud = read_cloud(
                name,
                length_unit=options.get("length_unit"),
                columns=None if columns is None else columns.split(","),
            )
            points = cloud.points if motion is None else apply(read_motion(motion), cloud.points)
        return correct(
            points,
            self.scene,
            system=devices.system,
            phase=devices.phase,
            inputs=options.get("answers", NOTHING_ASKED).inputs,
            pixels=cloud.pixels,
        )

    @cached_property
    def budget(self) -> FeatureBudget:
        """Uncertainty of a measurement of two devices before it is made."""
        from iriftrace.measuring.two_devices.budget import feature_budget

        options = self._options("budget", "SCENE")
        devices = options.get("devices", USUAL_DEVICES)
        return feature_budget(
            self.scene,
            options.get("answers", NOTHING_ASKED).inputs,
            choices=devices.feature or (),
            gate=devices.gate,
            system=devices.system,
            phase=devices.phase,
        )

    @property
    def temperatures(self) -> dict[str, float]:
        """Temperature of each region of the hot part as the file states it, K.

        Empty if [part] states none.
        """
        from iriftrace.part.region_choice import values_by_region

        reading = self._options("scene", "FIELD", "PART", "--output=scene.xml").get("part_reading")
        if reading is None or reading.hot.default is None:
            return {}
        part, hot = self.scene.part, reading.hot
        regions = values_by_region(part, hot.regions)
        return {name: float(regions.get(name, hot.default)) for name in part.region_names}

    @property
    def sentences(self) -> tuple[str, ...]:
        """Sizes with U, and verdicts, of the corrected cloud; else what the devices measure."""
        values = self._values()
        rows = describe(values)
        found = [*sentences(rows, "verdict"), *sentences(rows, "result")]
        return tuple(found or sentences(rows, "answer"))

    def figure(self) -> Figure:
        """Draw the correction, or the simulated measurement if there is no cloud."""
        from iriftrace.figures.scan import correction_figure, scan_figure

        if self._cloud:
            return correction_figure(self.correction, self.scene.part, self.scene.camera)
        return scan_figure(self.scan, self.scene.part)

    def report(self) -> Path:
        """Write the HTML report if it is not up to date; returns its path."""
        return self._product("report")

    @property
    def _cloud(self) -> bool:
        return self.file.get("scan", "cloud") is not None

    def _values(self) -> dict[str, Any]:
        """JSON values of the correction with verdicts, or of the simulated measurement."""
        product = self._product("report")
        with self._here():
            state = states_of(self.file)["report"]
            if self._cloud:
                return corrected_values(self.file, state.step.without)
        scan = product.parent.with_name("measure") / "scan.json"
        return dict(json.loads(scan.read_text(encoding="utf-8")))

    def _product(self, name: str) -> Path:
        """Main product of a step, which is made if it is not up to date."""
        self.run(name)
        with self._here():
            return self.folder / states_of(self.file)[name].step.product

    def _loaded(self, step: str) -> Scene:
        """Scene of a step, traced as [trace] states."""
        from iriftrace.tracing.load import load_scene

        product = self._product(step)
        trace = self._options("measure", "SCENE").get("trace", TRACE_AS_STATED)
        return load_scene(product, trace.variables(), variant=trace.variant, engine=trace.engine)

    def _options(self, *words: str) -> dict[str, Any]:
        """Arguments of a command's function as the file states them."""
        with self._here():
            return options_of(self.file, *words, without=NO_VERDICT)

    @contextmanager
    def _here(self) -> Iterator[None]:
        """Work in the project's folder, without the summaries of commands."""
        former, out.quiet = out.quiet, True
        try:
            with chdir(self.folder):
                yield
        finally:
            out.quiet = former

    def _repr_html_(self) -> str:
        """State of the steps, and the picture of the last result, for notebooks."""
        with self._here():
            states = states_of(self.file)
        rows = {
            name: state.reason or str(state.stamp.get("result") or "up to date")
            for name, state in states.items()
        }
        products = [
            self.folder / states[name].step.product
            for name in ("correct", "measure", "render")
            if name in states
        ]
        last = next((product for product in products if product.is_file()), None)
        shown = "" if last is None else picture(*read_shown(last))
        return html_table(f"Project in {self.folder}", rows) + shown
