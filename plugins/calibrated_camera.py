"""The sensor ``calibrated_camera``: intrinsics as metrologists write them, in double precision."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import ORDER, Distortion
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.plugins.film import check_film_size
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.kernels.projection import Projection, flip_axes
from iriftrace.plugins.properties import camera_of, number


def sensor_of(camera: Camera) -> dt.Sensor:
    """A ``calibrated_camera`` for a camera, with its own film, in the variant in force.

    Raises InputError if the camera's rays are parallel.
    """
    camera.check_movable()
    near, far = camera.focus_mm
    width, height = camera.resolution
    return mi.load_dict(
        {
            "type": "calibrated_camera",
            "focal_length": camera.focal_length_mm,
            "sensor_width": camera.sensor_mm[0],
            "sensor_height": camera.sensor_mm[1],
            "principal_point_x": camera.principal_point_px[0] + 0.5,
            "principal_point_y": camera.principal_point_px[1] + 0.5,
            **({} if camera.distortion is None else camera.distortion.as_dict()),
            "focus_near": near,
            **({"focus_far": far} if math.isfinite(far) else {}),
            "to_world": mi.ScalarTransform4d(flip_axes(camera.matrix)),
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "pixel_format": "luminance",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        }
    )


def _values_of(camera: Camera) -> dict[str, float]:
    """Numbers of a camera that `mi.traverse` shows, as the plugin's parameters have them."""
    x, y = camera.principal_point_px
    lens = Distortion() if camera.distortion is None else camera.distortion
    return {
        "focal_length": camera.focal_length_mm,
        "principal_point_x": x + 0.5,
        "principal_point_y": y + 0.5,
        **lens.as_dict(),
    }


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""

    class CalibratedCamera(mi.Sensor):
        r"""Calibrated camera (``calibrated_camera``).

        =====================  =========  ==============================================  =========
        Parameter              Type       Meaning                                         Default
        =====================  =========  ==============================================  =========
        ``focal_length``       float, mm  pinhole to sensor (camera constant)             required
        ``sensor_width``       float, mm  width of the sensor                             required
        ``sensor_height``      float, mm  height of the sensor; pixels need not be        required
                                          square
        ``principal_point_x``  float, px  where the axis meets the sensor, from its left  centre
                                          edge, for the film's full size (``scale`` 1)
        ``principal_point_y``  float, px  the same from the upper edge                    centre
        ``k1``                 float      radial lens distortion, numerator               0
        ``k2``                 float      the same, next order                            0
        ``k3``                 float      the same, next order                            0
        ``k4``                 float      radial lens distortion, denominator             0
        ``k5``                 float      the same, next order                            0
        ``k6``                 float      the same, next order                            0
        ``p1``                 float      tangential lens distortion                      0
        ``p2``                 float      the same                                        0
        ``calibration``        string     file of OpenCV (YAML or JSON), next to the      none
                                          scene's, in place of the 13 parameters above
        ``pixel_size``         float, mm  width of a pixel: required with a calibration,
                                          which knows pixels only; changes no ray
        ``length_unit``        string     of the translation in the calibration's pose    mm
        ``focus_near``         float, mm  nearest distance along the ray that is sharp    0
        ``focus_far``          float, mm  farthest one                                    unlimited
        ``scale``              float      factor on the film's width and height           1
        ``to_world``           transform  pose, in Mitsuba's convention (``lookat``)      identity
                                          or, where it has one, the calibration's
        =====================  =========  ==============================================  =========

        A pinhole camera with the lens distortion of Brown and Conrady in OpenCV's form: with
        ``r2 = x x + y y`` a direction (x, y, 1) of the camera frame (x right, y down) is seen at
        ``x R + 2 p1 x y + p2 (r2 + 2 x x)``, ``y R + p1 (r2 + 2 y y) + 2 p2 x y``, times the focal
        length, where ``R = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)``.
        Rays are its inverse, by Newton's method, to 1e-10 px. Coefficients that fold the picture
        (two directions at one place) are refused. Without them nothing of this is computed.

        As on Mitsuba's film pixel ``i`` covers ``[i, i + 1)`` and its centre is ``i + 0.5``; OpenCV
        and `iriftrace.Camera` count centres as whole numbers, so add 0.5 to their principal point
        (in a calibration file it is as OpenCV counts). ``first_hit`` asks for rays in double
        precision (``rays64``); other integrators get the same in single precision. No aperture.

        ``mi.traverse`` shows ``to_world``, ``focal_length``, the principal point and the eight
        coefficients of the lens. All are differentiable: rays and image positions of
        `iriftrace.hits` depend on them, but hits that jump to another face, appear or vanish as
        the camera changes are left out of derivatives.

        .. code-block:: xml

            <sensor type="calibrated_camera">
                <float name="focal_length" value="10"/>
                <float name="sensor_width" value="6.7"/>
                <float name="sensor_height" value="5.6"/>
                <float name="focus_near" value="50"/>
                <float name="focus_far" value="250"/>
                <float name="scale" value="0.5"/>
                <transform name="to_world">
                    <lookat origin="150, -100, 120" target="0, 0, 0" up="0, 0, 1"/>
                </transform>
                <film type="hdrfilm">
                    <integer name="width" value="2448"/>
                    <integer name="height" value="2048"/>
                    <string name="pixel_format" value="luminance"/>
                    <string name="component_format" value="float32"/>
                    <rfilter type="box"/>
                </film>
            </sensor>

        With ``<string name="calibration" value="camera.yaml"/>`` and ``<float name="pixel_size"
        value="0.00274"/>`` in place of the lengths, what OpenCV found is taken as it is; a
        relative path counts from the scene's file, with ``load_dict`` from the working folder.

        .. code-block:: python

            mi.load_dict({
                "type": "calibrated_camera",
                "focal_length": 10.0, "sensor_width": 6.7, "sensor_height": 5.6,
                "to_world": mi.ScalarTransform4f().look_at([150, -100, 120], [0, 0, 0], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": 2448, "height": 2048,
                         "pixel_format": "luminance", "component_format": "float32",
                         "rfilter": {"type": "box"}},
            })
        """

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            film = self.film()
            width, height = (int(n) for n in film.size())
            self._full = full = (width, height)
            self._described = described = camera_of(props, full)
            self._scale = number(props, "scale", 1.0)
            self._camera = described.scaled(self._scale)
            if self._camera.resolution != full:
                if tuple(film.crop_size()) != full:
                    raise InputError(
                        "The film has a crop window, which loses its meaning when scale changes "
                        "the film's size; use either crop_* or scale.",
                        code="film.crop_and_scale",
                    )
                parameters = mi.traverse(film)
                parameters["size"] = list(self._camera.resolution)
                parameters.update()
            self.to_world = mi.Transform4d(flip_axes(described.matrix))
            self._values = _values_of(described)
            self._parameters = {name: mi.Float64(value) for name, value in self._values.items()}
            self._projection = Projection(self._camera)

        def description(self) -> JsonObject:
            """The camera as ``iriftrace.Camera.as_dict`` gives it."""
            return self._camera.as_dict()

        def full_resolution(self) -> tuple[int, ...]:
            """Width and height of the film before ``scale`` changed them, px."""
            return self._full

        def rays64(self, x: dt.Float64, y: dt.Float64) -> tuple[dt.Point3d, dt.Vector3d]:
            """Origins and directions through image positions, double precision, world, mm."""
            return self._attached().rays64(x, y)

        def project64(self, point: dt.Point3d) -> tuple[dt.Float64, dt.Float64, dt.Bool]:
            """Image position in pixels of points of the world, and whether they are in front."""
            return self._attached().project64(point)

        def _attached(self) -> Projection:
            """The projection; as a function of parameters if a gradient of one is requested."""
            matrix: dt.Array = self.to_world.matrix
            if not dr.grad_enabled(matrix, self._parameters):
                return self._projection
            pairs = zip(self._camera.resolution, self._full, strict=True)
            across, down = (size / full for size, full in pairs)
            return self._projection.attached(matrix, self._parameters, (across, down))

        def sample_ray(
            self,
            time: dt.Float,
            sample1: dt.Float,
            sample2: dt.Point2f,
            sample3: dt.Point2f,
            active: dt.Bool = True,
        ) -> tuple[dt.Ray3f, dt.Spectrum]:
            film = self.film()
            check_film_size(film, self._camera.resolution)
            size, offset = film.crop_size(), film.crop_offset()
            origin, direction = self.rays64(
                mi.Float64(sample2.x) * size.x + offset.x,
                mi.Float64(sample2.y) * size.y + offset.y,
            )
            wavelengths, weight = self.sample_wavelengths(
                dr.zeros(mi.SurfaceInteraction3f), sample1, active
            )
            ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), time, wavelengths)
            return ray, weight

        def sample_ray_differential(
            self,
            time: dt.Float,
            sample1: dt.Float,
            sample2: dt.Point2f,
            sample3: dt.Point2f,
            active: dt.Bool = True,
        ) -> tuple[dt.RayDifferential3f, dt.Spectrum]:
            ray, weight = self.sample_ray(time, sample1, sample2, sample3, active)
            return mi.RayDifferential3f(ray), weight

        def traverse(self, callback: mi.TraversalCallback) -> None:
            super().traverse(callback)
            flags = mi.ParamFlags.Differentiable | mi.ParamFlags.Discontinuous
            callback.put("to_world", self.to_world, flags)
            for name, value in self._parameters.items():
                callback.put(name, value, flags)

        def parameters_changed(self, keys: Sequence[str] = ()) -> None:
            # Entry by entry: a conversion as a whole would compile a kernel for each pose.
            matrix: dt.Array = dr.detach(self.to_world.matrix)
            pose = np.array([[float(matrix[i, j][0]) for j in range(4)] for i in range(4)])
            described = self._described.at(flip_axes(pose))
            values = {name: float(dr.detach(x)[0]) for name, x in self._parameters.items()}
            if values != self._values:
                described = evolve(
                    described,
                    focal_length_mm=values["focal_length"],
                    principal_point_px=(
                        values["principal_point_x"] - 0.5,
                        values["principal_point_y"] - 0.5,
                    ),
                    distortion=Distortion(**{name: values[name] for name in ORDER}),
                )
            self._camera = described.scaled(self._scale)
            self._described, self._values = described, values
            self._projection = Projection(self._camera)

        def to_string(self) -> str:
            return f"CalibratedCamera[{self._camera.as_dict()}]"

    return CalibratedCamera
