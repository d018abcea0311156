"""What a study reads: fields and part, and the camera that looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iriftrace.cli.checks import check_field, check_input, check_order, check_output
from iriftrace.cli.console import working
from iriftrace.cli.study_options import StudyOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.field import IndexField
    from iriftrace.studies.pictures import View


class StudyInputs:
    """Fields and part of a study, read after every option was looked at."""

    def __init__(
        self,
        fields: Sequence[Path],
        part: Path,
        output: Path,
        options: StudyOptions,
    ) -> None:
        from iriftrace import runtime

        if not options.field.isosurfaces:
            check_order(fields[0], part)
        check_field(*fields)
        check_input(part)
        check_output(output, ".nc", "study.nc", make=False)
        if options.field.isosurfaces:
            raise InputError(
                "A study contours the field anew for each case, so it needs the volume field and "
                "no ready-made iso-surfaces."
            )
        self._camera = options.camera
        self.variant = runtime.ensure(options.variant)
        self.part = options.part.read(part)
        self.notes = options.field.notes()
        with working("Reading the field" if len(fields) == 1 else "Reading the fields"):
            self.fields: list[IndexField] = [
                options.field.read(path, options.air.air(), self.part) for path in fields
            ]

    def view(self, scale: float) -> View:
        """The camera at its traced resolution, with part and variant."""
        from iriftrace.shells import contour_shells
        from iriftrace.studies.pictures import View
        from iriftrace.viewpoint import refuse_camera_inside

        finest = self.fields[-1]
        stack = contour_shells(finest, 1)
        camera = self._camera.camera(self.part, finest, stack, scale)
        refuse_camera_inside(camera.origin, self.part, stack, finest)
        return View(self.part, camera.scaled(scale), self.variant)

    def source(self, view: View) -> dict[str, Any]:
        """Where the study comes from, as plain JSON values."""
        from importlib.metadata import version

        from attrs import asdict

        return {
            "version": version("iriftrace"),
            "fields": [asdict(field.source) for field in self.fields],
            "part": {"path": str(self.part.path), "sha256": self.part.sha256},
            "air": asdict(self.fields[0].air),
            "wavelength_nm": self.fields[0].air.wavelength_nm,
            "camera": view.camera.as_dict(),
            "notes": self.notes,
            "variant": view.variant,
            "length_unit": "mm",
        }


def short_names(paths: Sequence[Path]) -> list[str]:
    """Short names of files: their stems where these differ."""
    stems = [path.stem for path in paths]
    return stems if len(set(stems)) == len(stems) else [str(path) for path in paths]
