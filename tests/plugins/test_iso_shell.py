"""The bsdf iso_shell: its numbers, its refraction, and pictures by Mitsuba's own integrator."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.plugins.iso_shell import _warn_of_pictures
from iriftrace.plugins.kernels.vertex_table import aligned_rows
from validation.inputs.small_scenes import nested_spheres, ply, sphere

pytestmark = [
    pytest.mark.usefixtures("variant"),
    pytest.mark.filterwarnings("ignore:Mitsuba's own integrators show no true"),
]

EXT, INT = 1.000271800000001, 1.000255300000002


def bsdf(**values: Any) -> Any:
    return mi.load_dict({"type": "iso_shell", **values})


def test_indices_are_kept_in_double_precision() -> None:
    """Single precision would round both by up to 6e-8: 0.4 % of their difference."""
    loaded = bsdf(ext_ior=EXT, int_ior=INT, layer="1")
    assert (loaded.ext_ior, loaded.int_ior) == (EXT, INT)
    from_xml = mi.load_string(
        f'<bsdf version="3.0.0" type="iso_shell"><float name="ext_ior" value="{EXT!r}"/>'
        f'<float name="int_ior" value="{INT!r}"/></bsdf>'
    )
    assert (from_xml.ext_ior, from_xml.int_ior) == (EXT, INT)


def test_index_on_the_surface_is_the_mean_unless_given() -> None:
    assert bsdf(ext_ior=EXT, int_ior=INT).iso_ior == 0.5 * (EXT + INT)
    surface = 1.000261234567891
    assert bsdf(ext_ior=EXT, int_ior=INT, iso_ior=surface).iso_ior == surface


def test_traverse_changes_indices_in_double_precision() -> None:
    """An index on the shell that was not given stays the mean, one that is set stays as it is."""
    shell = bsdf(ext_ior=EXT, int_ior=INT)
    parameters = mi.traverse(shell)
    parameters["ext_ior"] = EXT + 1e-14
    parameters.update()
    assert (shell.ext_ior, shell.int_ior) == (EXT + 1e-14, INT)
    assert shell.iso_ior == 0.5 * (EXT + 1e-14 + INT)
    parameters["iso_ior"] = INT
    parameters.update()
    parameters["ext_ior"] = EXT
    parameters.update()
    assert (shell.ext_ior, shell.int_ior, shell.iso_ior) == (EXT, INT, INT)
    assert [float(value[0]) for _, value in mi.traverse(shell)] == [EXT, INT, INT]


def test_a_wrong_index_is_refused_and_changes_nothing() -> None:
    shell = bsdf(ext_ior=EXT, int_ior=INT)
    parameters = mi.traverse(shell)
    parameters["int_ior"] = 2.6e-4
    with pytest.raises(InputError, match=r'"int_ior" is 0\.00026, not a refractive index'):
        parameters.update()
    assert shell.int_ior == float(parameters["int_ior"][0]) == INT


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"ext_ior": EXT, "int_ior": INT, "iso_ior": 1.0003},
            '"iso_ior" is 1.0003, the index on the shell, but not between',
        ),
        ({"ext_ior": "1.0", "int_ior": 1.0}, "\"ext_ior\" is '1.0', not a number"),
        ({"ext_ior": 1.0, "int_ior": True}, '"int_ior" is True, not a number'),
        ({"ext_ior": 1.0}, '"int_ior" is missing'),
        ({"ext_ior": 2.718e-4, "int_ior": 1.0}, "not a refractive index.*give n, not n - 1"),
        ({"ext_ior": 1.0, "int_ior": 7.0}, '"int_ior" is 7.0, not a refractive index'),
        ({"ext_ior": float("nan"), "int_ior": 1.0}, '"ext_ior" is nan; give a finite number'),
        ({"ext_ior": float("inf"), "int_ior": 1.0}, '"ext_ior" is inf; give a finite number'),
        ({"ext_ior": 1.0, "int_ior": 1.0, "iso_ior": 2.6e-4}, '"iso_ior" is 0.00026, not a'),
        ({"ext_ior": 1.0, "int_ior": 1.0, "iso_ior": "1.0"}, "\"iso_ior\" is '1.0', not a number"),
        ({"ext_ior": 1.0, "int_ior": 1.0, "lyer": "1"}, 'unreferenced property.*\n.*"lyer"'),
    ],
)
def test_wrong_parameters_are_refused(values: dict[str, Any], message: str) -> None:
    """Mitsuba's loader would take a string where a number belongs."""
    with pytest.raises(RuntimeError, match=message):
        bsdf(**values)


def sampled(loaded: Any, outgoing: np.ndarray, **context: Any) -> tuple[Any, np.ndarray]:
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = mi.Vector3f(*aligned_rows(outgoing.astype(np.float32)))
    samples = mi.Point2f(0.5)
    return loaded.sample(
        mi.BSDFContext(**context), interaction, mi.Float(0.5), samples, mi.Mask(True)
    )


@pytest.mark.parametrize(("ext", "interior"), [(1.0, 1.5), (1.5, 1.0), (1.0002718, 1.0000580)])
@pytest.mark.parametrize("side", [1, -1])
def test_samples_follow_snell(ext: float, interior: float, side: int) -> None:
    """In the plane of incidence, with eta = index behind over index before, weight and pdf 1."""
    angle = np.radians(np.array((0.5, 20.0, 45.0, 60.0, 80.0)))
    ratio = ext / interior if side == 1 else interior / ext
    angle = angle[ratio * np.sin(angle) < 1]
    azimuth = 0.7
    wi = np.stack(
        (np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), side * np.cos(angle)), 1
    )
    sample, weight = sampled(bsdf(ext_ior=ext, int_ior=interior), wi)
    behind = np.arcsin(ratio * np.sin(angle))
    expected = -np.stack(
        (np.sin(behind) * np.cos(azimuth), np.sin(behind) * np.sin(azimuth), side * np.cos(behind)),
        1,
    )
    np.testing.assert_allclose(np.array(sample.wo).T, expected, atol=5e-7)
    np.testing.assert_allclose(np.array(sample.eta), 1 / ratio, rtol=1e-6)
    np.testing.assert_array_equal(np.array(sample.pdf), 1)
    np.testing.assert_array_equal(np.array(weight), 1)


def test_samples_beyond_the_critical_angle_are_reflected() -> None:
    wi = np.array(((0.8, 0.0, 0.6), (0.8, 0.0, -0.6)))
    sample, weight = sampled(bsdf(ext_ior=1.5, int_ior=1.0), wi)
    found = np.array(sample.wo).T
    # From outside (thicker) it is reflected; from inside it is refracted.
    np.testing.assert_allclose(found[0], (-0.8, 0.0, 0.6), atol=1e-6)
    assert found[1, 2] > 0
    np.testing.assert_allclose(np.array(sample.eta)[0], 1)
    np.testing.assert_array_equal(np.array(weight), 1)


def test_it_is_a_delta_transmission_only() -> None:
    """Integrators that ask for other lobes get nothing, and no density can be evaluated."""
    loaded = bsdf(ext_ior=1.0, int_ior=1.5)
    assert loaded.flags() == int(
        mi.BSDFFlags.DeltaTransmission | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
    )
    context = mi.BSDFContext()
    context.type_mask = mi.BSDFFlags.Diffuse
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = mi.Vector3f(0, 0, 1)
    _, weight = loaded.sample(context, interaction, mi.Float(0.5), mi.Point2f(0.5), mi.Mask(True))
    assert float(mi.Float(weight[0])[0]) == 0
    out = mi.Vector3f(0, 0, -1)
    assert float(loaded.eval(mi.BSDFContext(), interaction, out)[0][0]) == 0
    assert float(loaded.pdf(mi.BSDFContext(), interaction, out)[0]) == 0


def glowing_sphere(folder: Path) -> Any:
    """A sphere whose radiance varies over its surface between 1 and 3; it reflects a half."""
    mesh = sphere(12.0)
    shape = mi.load_dict(
        ply(
            folder / "glow.ply",
            mesh,
            mesh.vertices / 12,
            bsdf={"type": "diffuse", "reflectance": 0.5},
            emitter={"type": "area", "radiance": {"type": "mesh_attribute", "name": "vertex_glow"}},
        )
    )
    shape.add_attribute(
        "vertex_glow", 1, mi.Float(np.array(2 + mesh.vertices[:, 2] / 12, dtype=np.float32))
    )
    return shape


def picture(shapes: dict[str, Any], samples: int = 64) -> np.ndarray:
    """Through Mitsuba's own path integrator, under the conditions that suit shells."""
    loaded = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": -1, "rr_depth": 1000},
            "sensor": {
                "type": "perspective",
                "fov": 35,
                "to_world": mi.ScalarTransform4f().look_at([0, -100, 0], [0, 0, 0], [0, 0, 1]),
                "film": {
                    "type": "hdrfilm",
                    "width": 64,
                    "height": 64,
                    "pixel_format": "luminance",
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                },
            },
            "light": {"type": "constant", "radiance": 0.4},
            **shapes,
        },
        optimize=False,
    )
    return np.array(mi.render(loaded, spp=samples, seed=3))[..., 0]


def test_pictures_through_matched_shells_equal_those_without(tmp_path: Path) -> None:
    """A glowing part in a bright room: 5 shells that bend nothing do not change its picture.

    Mean within 0.3 %; away from the silhouette each pixel within 1 %, since the reflected light, a
    tenth of a pixel, has a noise of a few per cent of itself.
    """
    part = glowing_sphere(tmp_path)
    bare = picture({"part": part})
    radii = (26.0, 23.0, 20.0, 17.0, 14.0)
    shells = nested_spheres(tmp_path, radii, (1.0002,) * 6)
    through = picture({"part": part, **shells})
    assert through.mean() == pytest.approx(bare.mean(), rel=3e-3)
    on_part = bare > 0.5
    assert 0.1 < on_part.mean() < 0.5
    inside, outside = binary_erosion(on_part, iterations=2), binary_erosion(~on_part, iterations=2)
    np.testing.assert_allclose(through[inside], bare[inside], rtol=0.01)
    np.testing.assert_allclose(through[outside], 0.4, rtol=1e-6)


def test_pictures_through_hot_air_are_displaced(tmp_path: Path) -> None:
    """Inside a ball of index n a concentric part looks n times as large (n r sin = b, Bouguer), and
    the middle of the picture keeps its radiance."""
    part = glowing_sphere(tmp_path)
    bare = picture({"part": part})
    shells = nested_spheres(tmp_path, (20.0,), (1.0, 1.2), subdivisions=4)
    through = picture({"part": part, **shells})

    def radius(pixels: np.ndarray) -> float:
        return float(np.sqrt((pixels > 0.7).sum() / np.pi))

    # Bouguer gives the sine of the angle at the camera, 100 mm away; the picture shows its tangent.
    sines = np.array((12.0, 1.2 * 12.0)) / 100
    expected = np.tan(np.arcsin(sines))
    assert radius(through) / radius(bare) == pytest.approx(expected[1] / expected[0], rel=0.02)
    middle = np.s_[30:34, 30:34]
    assert through[middle].mean() == pytest.approx(bare[middle].mean(), rel=0.01)


def test_pictures_by_mitsubas_integrators_are_warned_of_once(tmp_path: Path) -> None:
    """However many shells they have, and however many pictures there are."""
    shells = nested_spheres(tmp_path, (20.0, 16.0), (1.0002, 1.0002, 1.0002))
    content = {"part": glowing_sphere(tmp_path), **shells}
    _warn_of_pictures.cache_clear()
    with pytest.warns(IriftraceWarning, match="no true displacement through iso_shell") as said:
        [picture(content, samples=1) for _ in range(2)]
    assert len(said) == 1
