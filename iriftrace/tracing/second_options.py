"""Options of a scene's second device, for Python and for commands, and the placing of both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from attrs import evolve, field, frozen
from attrs.converters import optional

from iriftrace.core.errors import InputError, changed, refuse_given
from iriftrace.core.number_lists import Vector
from iriftrace.core.units import Length
from iriftrace.tracing.camera_options import (
    CameraOptions,
    needed_pixel_size,
    refuse_unseen_part,
)

if TYPE_CHECKING:
    from iriftrace.camera.camera import Camera
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part
    from iriftrace.tracing.xml import SceneSettings

System = Literal["stereo", "fringe", "laser"]

SYSTEM_OF_DEVICE: dict[str, System] = {
    "camera_2": "stereo",
    "projector": "fringe",
    "laser": "laser",
}
"""Kind of sensor by the id of the scene's second device."""

DEVICE_OF_SYSTEM = {system: device for device, system in SYSTEM_OF_DEVICE.items()}

PlacingBoth = Callable[["Part", "IndexField | None", "ShellStack"], tuple["Camera", "Camera"]]


@frozen
class SecondOptions:
    """A second device, with which points are triangulated; see ``iriftrace measure``.

    Parameters
    ----------
    second
        Its position in mm, "150,-100,40"; it looks at the same target, by default through the
        camera's lens onto the camera's sensor.
    second_calibration
        Its calibration of OpenCV (.yaml or .json), whose pose is used unless second is given.
    second_pixel_size
        Width of its pixel, which its calibration needs, "5.4 um".
    system
        Its kind: a projector (fringe, by default), a second camera (stereo) or a laser, whose
        sheet is the middle column of its picture.
    """

    second: Vector | None = field(default=None, converter=optional(Vector))
    second_calibration: Path | None = None
    second_pixel_size: Length | None = field(default=None, converter=optional(Length))
    system: System | None = None

    def given(self) -> bool:
        """True if there is a second device."""
        if self.second is not None or self.second_calibration is not None:
            return True
        refuse_given(
            changed(self, ("second_pixel_size", "system")),
            "is of a second device, and there is none; give its position too, such as "
            '"150,-100,40".',
            "second.no_device",
        )
        return False

    def device(
        self,
        first: CameraOptions,
        camera: Camera,
        part: Part,
        field: IndexField | None,
        stack: ShellStack,
    ) -> Camera:
        """The second device, at its full resolution."""
        from iriftrace.camera.pose import look_at

        if self.second_calibration is not None:
            device = self._calibrated(first).camera(part, field, stack)
        elif self.second is None or self.second_pixel_size is not None:
            raise InputError(
                "the size of a pixel belongs to a calibration of the second device; give that too.",
                code="second.no_calibration",
                argument="second_calibration",
            )
        else:
            target = part.centre if first.target is None else first.target
            device = camera.at(look_at(self.second, target, first.up))
        return device

    def _calibrated(self, first: CameraOptions) -> CameraOptions:
        """Options of the second device, if its calibration is given."""
        size = needed_pixel_size(
            self.second_pixel_size, self.second_calibration, "second_pixel_size"
        )
        stands = first.origin is not None or first.target is not None or first.has_pose()
        if first.calibration is not None and not stands:
            raise InputError(
                f"{first.calibration} has no pose, so the camera's place relative to the second "
                "device is unknown; give origin and target too, or a calibration with the pose.",
                code="calibration.no_pose",
                argument="origin",
            )
        options = CameraOptions(
            calibration=self.second_calibration,
            pixel_size=size,
            calibration_length_unit=first.calibration_length_unit,
            focus=first.focus,
            origin=self.second,
            target=first.target if self.second is not None else None,
            up=first.up,
        )
        if self.second is None and not options.has_pose():
            raise InputError(
                f"{self.second_calibration} has no pose, so the place of the second device "
                "is unknown; give its position too.",
                code="calibration.no_pose",
                argument="second",
            )
        return options


@frozen
class StereoOptions:
    """Two cameras of one calibration, instead of the options of each.

    Parameters
    ----------
    stereo_calibration
        Calibration of two cameras with R and T between them (OpenCV, ROS, Kalibr, MATLAB; .yaml,
        .xml or .json); give it twice for two files.
    cloud_to_part
        Text file of a 4 x 4 rigid motion, in mm, from the frame of camera 1, which is that of a
        stereo sensor's cloud, to the part's; ``iriftrace correct`` reads the same file. Without it,
        origin and target place camera 1.
    """

    stereo_calibration: list[Path] | None = None
    cloud_to_part: Path | None = None

    def placing(
        self, first: CameraOptions, second: SecondOptions, say: Callable[[str], None]
    ) -> PlacingBoth | None:
        """Check the options, and return the function that places both cameras at full resolution.

        None if no stereo calibration is given; `say` is called with a line about it.
        """
        import numpy as np

        from iriftrace.core.mesh.transform import read_motion
        from iriftrace.io.calibration import read_stereo_calibration

        if self.stereo_calibration is None:
            refuse_given(
                changed(self, ("cloud_to_part",)),
                "places the cameras of a stereo calibration, and none is given; give that too.",
                "calibration.no_stereo",
            )
            return None
        twice = "is given, but a stereo calibration describes both cameras; leave one of them out."
        refuse_given(changed(first, ("calibration",)), twice, "camera.stated_twice")
        refuse_given(
            changed(second, ("second", "second_calibration")), twice, "camera.stated_twice"
        )
        if self.cloud_to_part is not None:
            twice = (
                "is given, but the motion of the cloud places the cameras; leave one of them out."
            )
            refuse_given(changed(first, ("origin", "target")), twice, "camera.placed_twice")
        first.refuse_intrinsics()
        files = " and ".join(map(str, self.stereo_calibration))
        size = needed_pixel_size(first.pixel_size, files)
        sizes = (size, second.second_pixel_size or size)
        motion = None if self.cloud_to_part is None else read_motion(self.cloud_to_part)
        stereo = read_stereo_calibration(
            *self.stereo_calibration, length_unit=first.calibration_length_unit
        )

        def place(part: Part, field: IndexField | None, stack: ShellStack) -> tuple[Camera, Camera]:
            matrix = motion
            if matrix is None:
                camera = stereo.first.camera(
                    pixel_size_mm=size, focus_mm=first.focus, matrix=np.eye(4)
                )
                matrix = first.placed(camera, part, field, stack).matrix
            cameras = []
            for calibration, width in zip(stereo.placed(matrix), sizes, strict=True):
                camera = calibration.camera(pixel_size_mm=width, focus_mm=first.focus)
                refuse_unseen_part(
                    camera,
                    part,
                    f"The calibration {files}, with T in {stereo.length_unit},",
                    "give the unit of T, or another motion from the cloud to the part (in mm, from "
                    "camera 1 to the part; R and T lead from camera 1 to 2).",
                )
                cameras.append(camera)
            say(
                f"Stereo calibration: baseline {stereo.baseline_mm:.5g} mm (T read in "
                f"{stereo.length_unit}), {stereo.angle_deg:.3g} deg between the axes, camera 2 "
                f"{stereo.side} camera 1."
            )
            return cameras[0], cameras[1]

        return place


def moved(first: CameraOptions, devices: Sequence[Camera]) -> Sequence[Camera]:
    """The devices as one rigid frame, the first of them at the pose of the options' file."""
    import numpy as np

    from iriftrace.io.poses import read_poses

    if first.pose is None:
        return devices
    pose = read_poses(first.pose).matrices[0]
    motion = pose @ np.linalg.inv(devices[0].matrix)
    return [device.at(motion @ device.matrix) for device in devices]


Placing = Callable[
    ["Part", "SceneSettings", "IndexField | None", "ShellStack"], tuple["Camera", "SceneSettings"]
]


def devices_of(
    first: CameraOptions,
    second: SecondOptions,
    rig: StereoOptions,
    say: Callable[[str], None] = lambda text: None,
) -> Placing:
    """Check the options, and return the function that places the camera and the second device.

    They see the part that it is given, at which they look unless a target is stated.
    It adds the second device, if there is one, to a scene's settings. `say` is called with a line
    about a stereo calibration.
    """
    place_both = rig.placing(first, second, say)
    two_devices = place_both is not None or second.given()

    def place(
        part: Part, settings: SceneSettings, field: IndexField | None, stack: ShellStack
    ) -> tuple[Camera, SceneSettings]:
        if not two_devices:
            return moved(first, [first.camera(part, field, stack)])[0], settings
        if place_both is not None:
            devices = place_both(part, field, stack)
        else:
            camera = first.camera(part, field, stack)
            devices = camera, second.device(first, camera, part, field, stack)
        camera, device = moved(first, devices)
        system = second.system or ("fringe" if place_both is None else "stereo")
        return camera, evolve(settings, second=device, second_id=DEVICE_OF_SYSTEM[system])

    return place


NO_SECOND, NO_RIG = SecondOptions(), StereoOptions()
