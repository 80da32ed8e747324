import time

import numpy as np
import pytest

from labsim.ct import coarsen, mask_near_bead, project
from labsim.records import FillingMap


def empty_map(nr=22, nz=40, cell=80e-6):
    r, z = (np.arange(nr) + 0.5) * cell, 0.8e-3 - (np.arange(nz) + 0.5) * cell
    return FillingMap(
        r, z, np.zeros((nz, nr)), np.ones((nz, nr)), np.ones((nz, nr)), 0.8e-3, 0.5e-3, (0.0, 0.0)
    )


def lattice(step=50e-6, width=2.6e-3, depth=3.5e-3):
    r, z = np.meshgrid(np.arange(step / 2, width, step), -np.arange(step / 2, depth, step))
    return r.ravel(), z.ravel(), step


@pytest.mark.parametrize("blur", [0.0, 30e-6, 60e-6])
def test_uniform_dust_stays_uniform(blur):
    r, z, h = lattice()
    m = empty_map()
    seen = project(r, z, 2 * np.pi * r * h * h, np.full(r.size, 0.15), m, blur=blur)
    assert seen[m.z < -4 * max(blur, 20e-6)] == pytest.approx(0.15, abs=2e-4)
    assert seen[m.z > 4 * max(blur, 20e-6)] == pytest.approx(0.0, abs=2e-4)


@pytest.mark.parametrize("blur", [0.0, 40e-6])
def test_mass_is_conserved(blur):
    rng = np.random.default_rng(0)
    r, z = rng.uniform(0, 1.0e-3, 500), rng.uniform(-1.5e-3, -0.2e-3, 500)
    volume, phi = rng.uniform(1e-13, 1e-12, 500), rng.uniform(0.1, 0.4, 500)
    m = empty_map()
    seen = project(r, z, volume, phi, m, blur=blur)
    cell = 80e-6
    mass = (seen * 2 * np.pi * m.r * cell * cell).sum()
    assert mass == pytest.approx((volume * phi).sum(), rel=2e-3)


def test_blur_spreads_a_point_by_its_own_width():
    m = empty_map(nr=60, nz=120, cell=10e-6)
    seen = project(np.array([2e-6]), np.array([0.2e-3]), np.array([2e-16]), np.array([0.2]), m, blur=50e-6)
    weight = seen * m.r
    z = (weight.sum(1) * m.z).sum() / weight.sum()
    assert np.sqrt((weight.sum(1) * (m.z - z) ** 2).sum() / weight.sum()) == pytest.approx(50e-6, rel=0.03)
    assert np.sqrt((weight.sum(0) * m.r**2).sum() / weight.sum() / 2) == pytest.approx(50e-6, rel=0.03)


def test_scale_shift_and_mask():
    r, z, h = lattice()
    m = empty_map()
    volume, phi = 2 * np.pi * r * h * h, np.full(r.size, 0.15)
    plain = project(r, z, volume, phi, m)
    assert project(r, z, volume, phi, m, scale=1.1) == pytest.approx(1.1 * plain)
    assert project(r, z, volume, phi, m, shift=80e-6)[:-1] == pytest.approx(plain[1:], abs=1e-9)
    assert project(r, z, np.full(r.size, h * h), phi, m, geometry="planar") == pytest.approx(plain)
    masked = mask_near_bead(m.r, m.z, 80e-6, -0.3e-3, 0.5e-3, 0.12e-3)
    assert np.isnan(project(r, z, volume, phi, m, masked=masked)[masked]).all()


def test_it_is_fast():
    r, z, h = lattice(step=25e-6)
    m = empty_map()
    assert r.size > 1e4
    project(r, z, 2 * np.pi * r * h * h, np.full(r.size, 0.15), m, blur=30e-6)
    walls = []
    for _ in range(5):
        began = time.perf_counter()
        project(r, z, 2 * np.pi * r * h * h, np.full(r.size, 0.15), m, blur=30e-6)
        walls.append(time.perf_counter() - began)
    assert min(walls) < 0.02


def test_the_mask_depends_on_the_bead_alone():
    m = empty_map()
    masked = mask_near_bead(m.r, m.z, 80e-6, -0.3e-3, 0.5e-3, 0.12e-3)
    corner = np.hypot(np.maximum(m.r - 40e-6, 0)[None], np.maximum(np.abs(m.z + 0.3e-3) - 40e-6, 0)[:, None])
    assert (corner[masked] < 0.62e-3).all() and (corner[~masked] >= 0.62e-3).all()
    rod = mask_near_bead(m.r, m.z, 80e-6, -0.3e-3, 0.5e-3, 0.12e-3, rod=True)
    assert rod[0, 0] and not masked[0, 0]


def test_coarser_cells_keep_the_mass():
    m = empty_map()
    r, z, h = lattice()
    from dataclasses import replace

    m = replace(m, filling_factor=project(r, z, 2 * np.pi * r * h * h, 0.1 + 100 * r, m, blur=30e-6))
    coarse = coarsen(m, 2)
    cells = [(x.filling_factor * x.r).sum() * k * k for x, k in ((m, 1), (coarse, 2))]
    assert cells[1] == pytest.approx(cells[0], rel=1e-9)


def test_the_mean_over_particles_is_free_of_their_gaps():
    """A shaken lattice of compacted dust: the mean over particles gives the field, the sum over cells its gaps too."""
    rng = np.random.default_rng(1)
    r, z, h = lattice(width=2.2e-3)
    phi = 0.15 + 0.06 * np.exp(-((r / 0.6e-3) ** 2) - ((z + 1.5e-3) / 0.4e-3) ** 2)
    volume = 2 * np.pi * r * h * h
    r, z = np.abs(r + 0.25 * h * rng.uniform(-1, 1, r.size)), z + 0.25 * h * rng.uniform(-1, 1, r.size)
    m = empty_map()
    truth = 0.15 + 0.06 * np.exp(-((m.r[None, :] / 0.6e-3) ** 2) - ((m.z[:, None] + 1.5e-3) / 0.4e-3) ** 2)
    dust = (m.z[:, None] < -0.4e-3) & (m.z[:, None] > -3.0e-3) & (m.r < 1.2e-3)
    noise = {
        each: float(np.std((project(r, z, volume, phi, m, blur=40e-6, of_particles=each) - truth)[dust]))
        for each in (False, True)
    }
    assert noise[True] < 0.3 * noise[False] and noise[True] < 1.5e-3


def test_cells_without_particles_have_no_average():
    r, z, h = lattice()
    m = empty_map()
    seen = project(r, z, 2 * np.pi * r * h * h, np.full(r.size, 0.15), m, blur=40e-6, of_particles=True)
    assert seen == pytest.approx(0.15, abs=1e-9)  # the mean of all dust, and nowhere a division by nothing
