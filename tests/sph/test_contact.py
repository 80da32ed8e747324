"""The dust at the tip: uniform pressure on the projectile, the exchange of volume, and a bead against two other methods."""

import math

import numpy as np
import pytest

from labsim.inference.emulation.grid import COARSE_CELLS, DEFAULT_CELLS
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate
from labsim.sph import particles as rows
from labsim.sph.bodies import elastic_material, evolve_body, fill_block, set_body
from labsim.sph.drop import evolve, place_particles
from labsim.sph.particles import fill_at_rest
from labsim.sph.reconstruction import differentiate_field, share_above

RADIUS = 5e-4
BEAD = Projectile("hemisphere", RADIUS, 2540 * 4 / 3 * math.pi * RADIUS**3)
BEAD_VOLUME = 4 / 3 * math.pi * RADIUS**3
SHORT = 0.07  # spacings by which cells in equilibrium at a wall are nearer than half a cell


def test_uniform_pressure_on_a_flat_is_pressure_times_area():
    """A column of elastic dust under uniform pressure between a floor and a flat that hardly moves: the push on the flat is p A,
    and the layers against it carry the same stress as all others."""
    spacing, columns, layers = 1e-4, 16, 30
    material = elastic_material(45e3, 0.5)
    flat = Projectile("sphere", 1e4 * spacing, 1e9)
    setting = set_body(material, spacing, 6e-3).replace(projectile=flat)
    state = fill_block(setting, columns, layers)
    pressed = fill_at_rest(setting, state[rows.X], state[rows.Z], state[rows.INITIAL], 0.02 * 45e3)
    wall = pressed[rows.Z] < 3 * spacing
    height = (layers - SHORT) * spacing  # where nothing is strained by settling
    result = evolve(
        setting, pressed, wall, np.array([height, -1e-7, 0.0, 0.0, 0.0]), planes=(0.0, columns * spacing)
    )
    end = result.state
    stress = end[rows.PRESSURE] - end[rows.SZZ]
    layer = np.round(pressed[rows.Z] / spacing - 0.5).astype(int)
    late = result.log[:, 0] > 4e-3
    push = result.log[late, 3].mean() / (columns * spacing)
    inner = stress[(layer > 5) & (layer < 20)].mean()
    top = [stress[layer == layers - k].mean() / inner for k in (1, 2, 3)]
    gap = (height - end[rows.Z][layer == layers - 1].mean()) / spacing
    print(
        f"push / (p A) {push / inner:.4f}, stress of the top layers {np.round(top, 4)}, distance {gap:.3f} spacings"
    )
    assert push == pytest.approx(inner, rel=0.01)
    assert top == pytest.approx(
        [1.0, 1.0, 1.0], abs=0.15
    )  # the sum of forces does not feel a stress that alternates from layer to layer
    assert gap == pytest.approx(0.5 - SHORT, abs=0.02)


def test_exchange_keeps_volume_and_leaves_elastic_dust_alone():
    """What one particle's volume gains its neighbours lose, rings included; nothing is exchanged in dust that is not crushed."""
    setting = DropSetting(BEAD, 0.66, Material(), spacing=RADIUS / 6, duration=4e-4)
    dust, wall = place_particles(setting)
    end = evolve(setting, dust, wall, np.array([0.0, -0.66, 0.0, 0.0, 0.0])).state
    gain = end[rows.EXCHANGE] * end[rows.AREA] * end[rows.RING]
    assert np.abs(gain).sum() > 0
    assert abs(gain.sum()) < 1e-9 * np.abs(gain).sum()
    far = end[rows.Z] < -4 * RADIUS
    assert np.all(end[rows.EXCHANGE][far] == 0.0)

    body = set_body(elastic_material(45e3, 0.5), 1e-4, 2e-4)
    block = fill_block(body, 12, 12)
    block[rows.W] = 0.1 * np.sin(block[rows.Z] / 2e-4)
    assert np.all(evolve_body(body, block).state[rows.EXCHANGE] == 0.0)


@pytest.mark.parametrize("cells", [COARSE_CELLS, DEFAULT_CELLS])
@pytest.mark.parametrize(
    ("speed", "depth", "stop", "above_20", "tolerance"),
    [(0.65, 0.689e-3, 1.762e-3, 0.76, 0.06), (0.20, 0.217e-3, 1.628e-3, 0.104, 0.35)],
)
def test_a_bead_against_two_other_methods(speed, depth, stop, above_20, tolerance, cells):
    """Depth and stopping time of a material-point solver's limits, volumes of a mesh; a/dx of fingerprints and of fits."""
    run = simulate(DropSetting(BEAD, speed, Material(), spacing=RADIUS / cells))
    volume = {phi: run.compacted_volume(phi) / BEAD_VOLUME for phi in (0.17, 0.20, 0.22)}
    print(f"D {run.penetration_depth / depth - 1:+.2%} T_s {run.stopping_time / stop - 1:+.2%} V {volume} "
          f"φ max {run.particles.filling_factor.max():.3f} viscous {run.energy_share('viscous'):.3f} exchange "
          f"{run.energy_share('exchange'):.3f} contact {run.energy_share('contact'):.4f}")  # fmt: skip
    assert run.penetration_depth == pytest.approx(depth, rel=0.015)
    assert run.stopping_time == pytest.approx(stop, rel=0.045)
    if cells == DEFAULT_CELLS:
        assert volume[0.20] == pytest.approx(above_20, rel=tolerance)
    if speed > 0.5:
        assert 0.27 < volume[0.22] < 0.36
    assert run.particles.filling_factor.max() < 0.31
    assert abs(run.energy_share("contact")) < 2e-3
    assert run.energy_share("viscous") < 0.08
    assert run.energy_share("exchange") < 0.04
    assert abs(run.energy_error) < 0.005


def test_compacted_volume_is_smooth_in_the_threshold_and_keeps_the_whole():
    run = simulate(DropSetting(BEAD, 0.65, Material(), spacing=RADIUS / 5))
    thresholds = np.linspace(0.16, 0.25, 181)
    volume = np.array([run.compacted_volume(phi) for phi in thresholds])
    assert np.all(np.diff(volume) <= 0)
    assert np.max(-np.diff(volume)) < 0.05 * volume[0]  # whole particles: up to 0.14
    assert run.compacted_volume(0.0) == pytest.approx(run.particles.volume.sum())
    assert run.compacted_volume(0.6) == 0.0


def test_share_of_a_cell_above_a_linear_field():
    """Against a count of points, and a gradient that is exact for a linear field."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1, 1, (2, 400_000))
    for excess, a, b in ((0.1, 0.3, 0.2), (-0.2, 0.5, 0.0), (0.6, 0.2, 0.3), (0.0, 0.0, 0.0)):
        share = share_above(np.array([excess]), np.array([a]), np.array([b]))[0]
        counted = 0.5 if a == b == excess == 0.0 else np.mean(excess + a * x + b * y > 0)
        assert share == pytest.approx(counted, abs=3e-3)
    r, z = rng.uniform(0.1, 1.0, (2, 400))
    by_r, by_z = differentiate_field(r, z, np.full(400, 0.81 / 400), 2 + 3 * r - z, 0.15, False)
    inside = (np.abs(r - 0.55) < 0.3) & (np.abs(z - 0.55) < 0.3)
    np.testing.assert_allclose(by_r[inside], 3.0, rtol=1e-6)
    np.testing.assert_allclose(by_z[inside], -1.0, rtol=1e-6)
