"""Glow, fringes and the image sensor of photographs, against closed forms and Mitsuba's light."""

import mitsuba as mi
import numpy as np
import pytest
from scipy.constants import c, h, k
from scipy.ndimage import binary_erosion

import iriftrace
from iriftrace.core.errors import InputError
from iriftrace.scenes import folder_of

pytestmark = pytest.mark.usefixtures("variant")

STEPS, PERIOD = 5, 16.0
DELAYS = 2.0 * np.pi * np.arange(STEPS) / STEPS


@pytest.fixture(scope="module")
def scene(variant: str) -> iriftrace.Scene:
    """The bundled cylinder with a projector, 245 x 205 px."""
    return iriftrace.load_scene(folder_of("fringe_cylinder") / "scene.xml", {"scale": 0.1})


def phase_of(pictures: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Phase, rad, 0 to 2 pi, and amplitude of phase-shifted pictures (Malacara, 1992, 14.7)."""
    sine, cosine = (
        sum(one * shape(d) for one, d in zip(pictures, DELAYS, strict=True))
        for shape in (np.sin, np.cos)
    )
    return np.arctan2(sine, cosine) % (2.0 * np.pi), 2.0 / STEPS * np.hypot(sine, cosine)


def glowing(wavelength: str, kelvin: float) -> float:
    """Electrons of a pixel that sees a glowing plate, in a dark room."""
    scene = iriftrace.load_scene(
        folder_of("slab") / "scene.xml", {"scale": 0.01, "wavelength": wavelength}
    )
    taken = iriftrace.photograph(
        scene,
        part=iriftrace.Appearance(0.8, kelvin),
        ambient=0.0,
        samples=1,
        sensor=iriftrace.ImageSensor(exposure="1 ms"),
    )
    electrons = taken.electrons["hot"]
    return float(electrons[electrons > 0.0].mean())


@pytest.mark.filterwarnings("ignore")
def test_the_glow_is_plancks() -> None:
    """A factor of 198 between 650 and 450 nm at 1100 degC, and 1.2 % a kelvin at 633 nm."""
    hot = 1373.15
    # Photons of 650 nm are more for the same energy.
    ratio = glowing("650 nm", hot) / glowing("450 nm", hot) * 450.0 / 650.0
    x, y = (h * c / (1e-9 * nm * k * hot) for nm in (450.0, 650.0))
    assert ratio == pytest.approx((450.0 / 650.0) ** 5 * np.expm1(x) / np.expm1(y), rel=1e-9)
    growth = glowing("633 nm", hot + 1.0) / glowing("633 nm", hot) - 1.0
    assert growth == pytest.approx(h * c / (633e-9 * k * hot**2), rel=0.01)
    assert growth == pytest.approx(0.012, abs=2e-4)


def test_steps_without_noise_give_the_place_that_lights(scene: iriftrace.Scene) -> None:
    taken = iriftrace.photograph(
        scene,
        part=iriftrace.Appearance(temperature="1100 degC"),
        light=iriftrace.Light("fringes", steps=STEPS, period=PERIOD, gray=True),
        samples=1,
        seed=None,
    )
    steps = [taken.pictures[f"hot_step_{n}"].astype(float) for n in range(STEPS)]
    phase, amplitude = phase_of(steps)
    bits = [
        taken.pictures[name] > np.mean(steps, axis=0) for name in taken.pictures if "gray" in name
    ]
    assert len(bits) == 4
    fringe = np.zeros(phase.shape, dtype=int)
    for bit in np.logical_xor.accumulate(bits):
        fringe = 2 * fringe + bit
    place = PERIOD * (fringe + phase / (2.0 * np.pi)) - 0.5
    true = taken.truth.channels["second.px.X"]
    bright = (true > -1.0) & (amplitude > 0.1 * amplitude.max())
    assert bright.sum() > 5000
    # Rounding to 16 bits alone.
    assert np.abs(place - true)[bright].max() < 1e-3


def test_the_box_of_a_pixel_keeps_the_place(scene: iriftrace.Scene) -> None:
    taken = iriftrace.photograph(
        scene, light=iriftrace.Light("fringes", steps=STEPS), samples=3, seed=None
    )
    steps = [taken.pictures[f"hot_step_{n}"].astype(float) for n in range(STEPS)]
    true = taken.truth.channels["second.px.X"]
    off = PERIOD * phase_of(steps)[0] / (2.0 * np.pi) - 0.5 - true
    off = (off + 0.5 * PERIOD) % PERIOD - 0.5 * PERIOD
    assert np.median(np.abs(off)[true > -1.0]) < 1e-3


def test_noise_of_the_phase(scene: iriftrace.Scene) -> None:
    """Its standard deviation is sqrt(2/N) sigma/B (Surrel, Applied Optics 36 (1997) 271)."""
    sensor = iriftrace.ImageSensor(full_well=1e6, gain=0.06, dark_noise=1e4, offset=2000.0)
    light = iriftrace.Light("fringes", steps=STEPS)
    taken = iriftrace.photograph(scene, light=light, samples=1, sensor=sensor)
    noisy, amplitude = phase_of([one.astype(float) for one in taken.pictures.values()])
    exact, electrons = phase_of(list(taken.electrons.values()))
    np.testing.assert_allclose(amplitude.max(), sensor.gain * electrons.max(), rtol=0.1)
    good = electrons > 10.0 * sensor.dark_noise
    # Shot noise adds 2 % to the variance, and rounding less.
    mean = np.mean(list(taken.electrons.values()), axis=0)
    sigma = np.sqrt(sensor.dark_noise**2 + mean + 1.0 / 12.0 / sensor.gain**2)
    off = np.angle(np.exp(1j * (noisy - exact))) * electrons / sigma / np.sqrt(2.0 / STEPS)
    assert good.sum() > 2000
    assert off[good].std() == pytest.approx(1.0, abs=0.04)
    assert abs(off[good].mean()) < 0.05


def test_fringes_are_those_that_measure_triangulates(scene: iriftrace.Scene) -> None:
    """A measured point lies on the plane of the column that lights it."""
    scan = iriftrace.measure(scene, phase="columns")
    taken = iriftrace.photograph(scene, light=iriftrace.Light(), samples=1)
    column, row = scan.pixel.astype(int).T
    lit = taken.truth.channels["second.px.X"][row, column]
    assert scene.second is not None
    np.testing.assert_allclose(lit, scene.second.project(scan.points)[:, 0], atol=5e-5)


def test_a_laser_lights_one_line_and_the_cold_picture_does_not_glow(scene: iriftrace.Scene) -> None:
    taken = iriftrace.photograph(
        scene,
        air="both",
        part=iriftrace.Appearance(temperature="1100 degC"),
        light=iriftrace.Light("laser"),
        ambient=0.0,
        seed=None,
    )
    hot, cold = taken.electrons["hot"], taken.electrons["cold"]
    place = taken.truth.channels["second.cold.px.X"]
    assert scene.second is not None
    middle = 0.5 * (scene.second.resolution[0] - 1)
    part = binary_erosion(taken.truth.channels["part.face"] > 0, iterations=2)
    bright = cold > 0.05 * cold.max()
    assert bright.sum() > 50
    assert (np.abs(place - middle)[part & bright] < 3.0).all()
    assert cold[part & (np.abs(place - middle) > 8.0)].max() < 1e-6 * cold.max()
    glow = (hot - cold)[part]
    assert np.quantile(glow, 0.1) == pytest.approx(np.median(glow), rel=0.01)


# Mitsuba compiles its integrator for the shells of the other scene, too.
@pytest.mark.filterwarnings("ignore:Mitsuba's own integrators")
def test_the_cold_picture_is_that_of_mitsubas_projector(scene: iriftrace.Scene) -> None:
    """Its integrator `direct` with the stock projector, camera and diffuse surface."""
    assert scene.second is not None
    taken = iriftrace.photograph(
        scene,
        air="cold",
        part=iriftrace.Appearance(0.4),
        light=iriftrace.Light("uniform", irradiance=3.0),
        ambient=0.0,
        samples=4,
        seed=None,
    )

    def placed(device: iriftrace.Camera) -> dict[str, object]:
        start, ahead, up = device.origin, device.forward, -device.matrix[:3, 1]
        turn = mi.ScalarTransform4f().look_at(
            start.tolist(), (start + 100.0 * ahead).tolist(), up.tolist()
        )
        angle = 2.0 * np.arctan(0.5 * device.sensor_mm[0] / device.focal_length_mm)
        return {"to_world": turn, "fov": float(np.degrees(angle))}

    width, height = scene.camera.resolution
    film = {"width": width, "height": height, "pixel_format": "luminance"}
    film |= {"type": "hdrfilm", "rfilter": {"type": "box"}, "component_format": "float32"}
    white = mi.Bitmap(np.ones((*scene.second.resolution[::-1], 1), dtype=np.float32))
    texture = {"type": "bitmap", "bitmap": white, "raw": True}
    stock = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct"},
            "sensor": {
                "type": "perspective",
                "film": film,
                "sampler": {"type": "independent", "sample_count": 64},
                **placed(scene.camera),
            },
            "part": {
                "type": "ply",
                "filename": scene.part.path,
                "face_normals": True,
                "bsdf": {"type": "diffuse", "reflectance": 0.6},
            },
            "light": {"type": "projector", "irradiance": texture, **placed(scene.second)},
        }
    )
    theirs = np.array(mi.render(stock))[..., 0]
    one = taken.sensor.electrons(np.ones(1), scene.camera.pixel_area_mm2, 633.0)
    assert taken.sensor.exposure is not None
    ours = taken.electrons["cold"] / (one * taken.sensor.exposure)
    # Its irradiance at a depth of 1 is pi for a white texture.
    depth = scene.second.to_camera(scene.part.centre[None])[0, 2]
    ours *= np.pi / (3.0 * depth**2)
    inner = binary_erosion(ours > 0.05 * ours.max())
    ratio = theirs[inner] / ours[inner]
    assert inner.sum() > 5000
    assert np.median(ratio) == pytest.approx(1.0, abs=5e-4)
    assert theirs[inner].sum() == pytest.approx(ours[inner].sum(), rel=2e-3)
    assert ratio.std() < 0.03


def test_the_sensor_is_linear_with_poisson_noise() -> None:
    """The slope of variance over mean is the gain K (EMVA 1288 4.0, 6.6)."""
    sensor = iriftrace.ImageSensor(gain=4.0, dark_noise=5.0, dark_current=0.0, offset=500.0)
    generator = np.random.default_rng(1)
    means, variances = [], []
    for electrons in (0.0, 1000.0, 4000.0, 8000.0):
        grey = sensor.grey_values(np.full(200_000, electrons), 1e-3, generator).astype(float)
        means.append(grey.mean())
        variances.append(grey.var())
    slope, dark = np.polyfit(np.array(means) - 500.0, variances, 1)
    assert slope == pytest.approx(4.0, rel=0.01)
    assert dark == pytest.approx(16.0 * 25.0 + 1.0 / 12.0, rel=0.5)
    assert variances[0] == pytest.approx(16.0 * 25.0 + 1.0 / 12.0, rel=0.01)
    for electrons in (1e6, 1e30):
        full = sensor.grey_values(np.full(10, electrons), 1e-3, None)
        assert (full == 4.0 * sensor.full_well + 500.0).all()
        noisy = sensor.grey_values(np.full(10, electrons), 1e-3, generator)
        np.testing.assert_allclose(noisy, full, atol=6.0 * 4.0 * 5.0)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda: iriftrace.Appearance(1.2), "photo.emissivity"),
        (lambda: iriftrace.Light("fringes", steps=2), "photo.light"),
        (lambda: iriftrace.Light("stripes"), "photo.unknown_light"),
        (lambda: iriftrace.Light("fringes", lines="column"), "photo.unknown_light"),
        (lambda: iriftrace.ImageSensor(gain=0.0), "photo.image_sensor"),
        (lambda: iriftrace.Checkerboard((0, 3)), "photo.checkerboard"),
    ],
)
def test_impossible_values_are_refused(change: object, code: str) -> None:
    with pytest.raises(InputError) as error:
        change()  # type: ignore[operator]
    assert error.value.code == code


def test_what_cannot_be_photographed_is_refused(scene: iriftrace.Scene) -> None:
    slab = iriftrace.load_scene(folder_of("slab") / "scene.xml", {"scale": 0.01})
    with pytest.raises(InputError, match="no second device"):
        iriftrace.photograph(slab, light=iriftrace.Light())
    with pytest.raises(InputError, match="Nothing in the picture is bright"):
        iriftrace.photograph(scene, ambient=0.0, samples=1)
