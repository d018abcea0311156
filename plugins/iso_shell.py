"""The bsdf ``iso_shell``: a surface of constant index between two layers of air."""

from __future__ import annotations

from functools import cache

import drjit as dr
import mitsuba as mi

from iriftrace.core.errors import InputError
from iriftrace.plugins.kernels import types as dt
from iriftrace.plugins.properties import number


@cache
def plugin_class(variant: str) -> type:
    """Build the plugin's class for one Mitsuba variant, which must be the one in force."""

    class IsoShell(mi.BSDF):
        r"""Iso-index shell (``iso_shell``).

        ============  =========  =====================================================  ========
        Parameter     Type       Meaning                                                Default
        ============  =========  =====================================================  ========
        ``ext_ior``   float      index on the side the normals point to (outside)       required
        ``int_ior``   float      index on the other side                                required
        ``iso_ior``   float      index of the air on the surface itself                  the mean
        ``layer``     string     name of the shell, unique, so that Mitsuba does not    empty
                                 merge shells whose indices are equal
        ============  =========  =====================================================  ========

        Bends a ray by Snell's law and lets all of it pass: neighbouring layers of air differ by
        1e-5, so the reflected fraction (below 1e-10) is ignored. Both numbers are kept in double
        precision; ``first_hit`` takes them directly, and bends rays at the shell or, where its file
        has the index's derivatives, all along the layers (only then is ``iso_ior`` used). Mitsuba's
        own integrators work too (in single precision): the bsdf is a perfect transmission of weight
        1. Shadow rays stop at shells, so such pictures need lights that a camera ray can hit.

        .. code-block:: xml

            <bsdf type="iso_shell">
                <float name="ext_ior" value="1.0002718"/>
                <float name="int_ior" value="1.0002553"/>
                <string name="layer" value="1"/>
            </bsdf>

        .. code-block:: python

            mi.load_dict({"type": "iso_shell", "ext_ior": 1.0002718, "int_ior": 1.0002553})
        """

        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            self.ext_ior = number(props, "ext_ior")
            self.int_ior = number(props, "int_ior")
            mean = 0.5 * (self.ext_ior + self.int_ior)
            self.iso_ior = number(props, "iso_ior", mean)
            for name in ("ext_ior", "int_ior", "iso_ior"):
                value = getattr(self, name)
                if not 0.5 < value < 5:
                    raise InputError(
                        f'"{name}" is {value}, not a refractive index; air has about 1.0003 '
                        "(give n, not n - 1)."
                    )
            # A shell without a step, as in a test of a scene, bends nothing.
            low, high = sorted((self.ext_ior, self.int_ior))
            if low < high and not low <= self.iso_ior <= high:
                raise InputError(
                    f'"iso_ior" is {self.iso_ior}, the index on the shell, but not between ext_ior '
                    f"{self.ext_ior} and int_ior {self.int_ior}."
                )
            self.layer = str(props.get("layer", ""))
            flags = mi.BSDFFlags.DeltaTransmission | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [flags]
            self.m_flags = flags

        def sample(
            self,
            ctx: mi.BSDFContext,
            si: dt.SurfaceInteraction3f,
            sample1: dt.Float,
            sample2: dt.Point2f,
            active: dt.Bool = True,
        ) -> tuple[dt.BSDFSample3f, dt.Spectrum]:
            cos_in = mi.Frame3f.cos_theta(si.wi)
            active = mi.Bool(active) & (cos_in != 0)
            if not ctx.is_enabled(mi.BSDFFlags.DeltaTransmission):
                active = mi.Bool(False)
            inward = cos_in > 0
            into_inside = mi.Float(self.int_ior / self.ext_ior)
            into_outside = mi.Float(self.ext_ior / self.int_ior)
            eta = dr.select(inward, into_inside, into_outside)
            cos_out_squared = 1 - (1 - dr.square(cos_in)) / dr.square(eta)
            cos_out = dr.sqrt(dr.maximum(cos_out_squared, 0))
            reflected = cos_out_squared <= 0
            refracted = mi.Vector3f(
                -si.wi.x / eta, -si.wi.y / eta, dr.select(inward, -cos_out, cos_out)
            )
            sample: dt.BSDFSample3f = dr.zeros(mi.BSDFSample3f, dr.width(si.wi))
            sample.wo = dr.select(reflected, mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z), refracted)
            sample.pdf = dr.select(active, mi.Float(1), 0)
            sample.eta = dr.select(reflected, mi.Float(1), eta)
            sample.sampled_type = mi.UInt32(+mi.BSDFFlags.DeltaTransmission)
            sample.sampled_component = mi.UInt32(0)
            return sample, mi.Spectrum(1) & active

        # All light passes in one direction, so that there is no density at any other.
        def eval(self, *_: object, **__: object) -> dt.Spectrum:
            return mi.Spectrum(0)

        def pdf(self, *_: object, **__: object) -> dt.Float:
            return mi.Float(0)

        def eval_pdf(self, *_: object, **__: object) -> tuple[dt.Spectrum, dt.Float]:
            return mi.Spectrum(0), mi.Float(0)

        def to_string(self) -> str:
            return f"IsoShell[ext_ior={self.ext_ior!r}, int_ior={self.int_ior!r}]"

    return IsoShell
