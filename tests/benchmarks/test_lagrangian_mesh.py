"""The Lagrangian mesh of benchmarks/ against closed forms, and one drop against the independent material points."""

import math

import numpy as np
import pytest

from benchmarks.lagrangian_mesh import mesh, quadrilateral
from benchmarks.lagrangian_mesh.cavity import grow_cavity, solve_cavity
from benchmarks.lagrangian_mesh.drop import find_limits
from benchmarks.lagrangian_mesh.rebound import measure_lift
from benchmarks.lagrangian_mesh.tip import measure_tip
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, simulate

RADIUS = 0.5e-3
DAMPING = np.array([0.02, 1.2, 0.1])


def lay_dented_mesh(radius):
    """12 × 10 cells under a hemispherical dent whose edge is at the 8th node, sheared and uneven inside."""
    r, depth = np.meshgrid(radius / 8.0 * np.arange(13), radius / 8.0 * np.arange(11.0) ** 1.1, indexing="ij")
    z = -depth - np.sqrt(np.maximum(radius**2 - r**2, 0.0)) * (1.0 - depth / depth.max())
    return r, z


def load(r, z, cells, dust, u, v, dt):
    force_r, force_z, spent = np.zeros_like(r), np.zeros_like(r), np.zeros(3)
    quadrilateral.load_nodes(r, z, u, v, dt, cells, dust.law, DAMPING, force_r, force_z, spent)
    return force_r, force_z, spent


def test_pressure_on_a_curved_surface_is_pressure_times_its_cross_section():
    dust = mesh.Dust(p_m=1e6)
    r, z = lay_dented_mesh(RADIUS)
    cells = mesh.lay_mesh(r, z, dust, 0.0)
    pressure = 20.0
    cells[..., quadrilateral.PHI0] = quadrilateral.find_unstressed(0.15, pressure, dust.bulk_modulus)
    _, force, _ = load(r, z, cells, dust, np.zeros_like(r), np.zeros_like(r), 0.0)
    width = RADIUS / 8.0
    # the node at the dent's edge carries half of the ring on either side
    inside = force[:8, 0].sum() + pressure * 0.5 * width * (RADIUS - 0.5 * width)
    assert inside == pytest.approx(pressure * 0.5 * RADIUS**2, rel=0.01)
    assert force[:, 0].sum() == pytest.approx(pressure * 0.5 * r[-1, 0] ** 2, rel=1e-12)
    assert np.abs(force.sum()) < 1e-12 * np.abs(force).sum()


def test_uniform_pressure_loads_no_inner_node():
    """Hoop stress and the growing rings balance: each half of it alone would load a node as much as the pressure does."""
    dust = mesh.Dust(p_m=1e6)
    edges = mesh.grade(1.5 * RADIUS, 3.0 * RADIUS, RADIUS / 8.0, 1.12)
    r, z = np.meshgrid(edges, -edges, indexing="ij")
    cells = mesh.lay_mesh(r, z, dust, 0.0)
    cells[..., quadrilateral.PHI0] = quadrilateral.find_unstressed(0.15, 20.0, dust.bulk_modulus)
    radial, axial, _ = load(r, z, cells, dust, np.zeros_like(r), np.zeros_like(r), 0.0)
    assert np.abs(radial[1:-1]).max() < 1e-12 * np.abs(radial[-1]).max()
    assert np.abs(axial[:, 1:-1]).max() < 1e-12 * np.abs(axial[:, 0]).max()


@pytest.mark.parametrize("gas", [0.0, 1e5])
def test_swelling_is_pure_pressure(gas):
    """v = α x strains by α in all three directions, hoops included; trapped gas adds P0 ((1 - φi)/(1 - φ) - 1)."""
    dust = mesh.Dust(p_m=1e9, tensile_factor=1e6, gas_pressure=gas)
    r, z = lay_dented_mesh(RADIUS)
    cells = mesh.lay_mesh(r, z, dust, 0.0)
    strain = 1e-3
    load((1 + strain) * r, (1 + strain) * z, cells, dust, strain * r, strain * z, 1.0)
    thinned = (1 + strain) ** -3
    exact = dust.bulk_modulus * (thinned - 1) + gas * (0.85 / (1 - 0.15 * thinned) - 1)
    assert cells[..., quadrilateral.PRESSURE] == pytest.approx(exact, rel=1e-9)
    assert np.abs(cells[..., quadrilateral.SRR : quadrilateral.SRZ + 1]).max() < 1e-9 * abs(exact)


def test_rigid_sphere_on_elastic_dust():
    """Hertz: (15 m v² / (16 E* √a))^(2/5) deep after 1.4716 depth/v; what is left of the energy is elastic."""
    dust = mesh.Dust(p_m=1e9, tensile_factor=1e6, bulk_modulus=300e3)
    speed = 0.05
    young, poisson = 9 * 0.5 / 3.5 * dust.bulk_modulus, 2 / 7  # of μ = K/2
    mass = mesh.BEAD_DENSITY * 4 / 3 * math.pi * RADIUS**3
    depth = (15 * mass * speed**2 * (1 - poisson**2) / (16 * young * math.sqrt(RADIUS))) ** 0.4
    run = mesh.run_drop(dust, RADIUS, speed, mesh.Numerics(quadratic=0.0), gravity=0.0)
    assert run.stopping_depth == pytest.approx(depth, rel=0.02)
    assert run.stopping_time == pytest.approx(1.4716 * depth / speed, rel=0.03)
    assert run.energies["elastic"] > 0.98 * run.energies["kinetic at contact"]


def test_cavity_in_yielding_dust():
    """Grown 2.5-fold from a finite radius, it is 2 % short of the pressure that it bears when grown from nothing."""
    dust = mesh.Dust()
    exact, xi, phi = solve_cavity(dust)
    _, pressure, places, found = grow_cavity(dust, growth=2.5, speed=0.1, layers=36, sectors=4)
    assert 0.97 * exact < np.mean(pressure[-50:]) < exact
    near = places < 1.5
    assert found[near] == pytest.approx(np.interp(places[near], xi, phi), rel=0.012)


def test_cavity_in_a_metal():
    """Without compaction the exact answer has a closed form, (2Y/3)(1 + ln(E/(3(1 - ν)Y))); Hill (1950), ch. V."""
    dust = mesh.Dust(p_m=1e9, shear_factor=1e-3, tensile_factor=0.5, bulk_modulus=3e6)
    compressive, tensile = quadrilateral.find_strengths(0.15, dust.law)
    strength = dust.shear_factor * math.sqrt(compressive * tensile)
    young, poisson = 9 * 0.5 / 3.5 * dust.bulk_modulus, 2 / 7
    closed = 2 / 3 * strength * (1 + math.log(young / (3 * (1 - poisson) * strength)))
    assert solve_cavity(dust)[0] == pytest.approx(closed, rel=0.002)


@pytest.fixture(scope="module")
def drop():
    return mesh.run_drop(mesh.Dust(), RADIUS, 0.30)


def test_drop_stops_where_the_material_points_stop(drop):
    depth, stop = find_limits(0.5, 0.30)
    assert drop.stopping_depth * 1e3 == pytest.approx(depth, rel=0.015)
    assert drop.stopping_time * 1e3 == pytest.approx(stop, rel=0.015)


def test_energy_is_booked(drop):
    assert abs(drop.energy_error) < 1e-3
    at_contact = drop.energies["kinetic at contact"]
    for sink in ("viscous", "hourglass", "contact"):
        assert 0.0 < drop.energies[sink] < 0.015 * at_contact
    assert drop.energies["plastic"] > 0.95 * at_contact


def test_energy_of_trapped_gas_is_booked():
    run = mesh.run_drop(mesh.Dust(gas_pressure=5e3), RADIUS, 0.30)
    assert abs(run.energy_error) < 1e-3
    assert run.energies["gas"] > 0.2 * run.energies["kinetic at contact"]


def test_dust_at_the_tip(drop):
    """The dense dust hardly depends on the mesh: the same volumes to 4 % with cells half as wide."""
    figures = []
    fine = mesh.run_drop(mesh.Dust(), RADIUS, 0.30, mesh.Numerics(cells=14.0))
    for run, cells in ((drop, 8.0), (fine, 14.0)):
        places = (x.ravel() for x in (run.r, run.z, run.volume, run.phi))
        figures.append(measure_tip(*places, run.stopping_depth, RADIUS, RADIUS / cells))
    coarse, better = figures
    assert coarse["V(>0.20)"] == pytest.approx(better["V(>0.20)"], rel=0.05)
    assert coarse["max"] == pytest.approx(better["max"], abs=0.01)
    assert better["max"] < 0.26


def test_what_tangles_says_so():
    with pytest.raises(RuntimeError, match="tangled"):
        mesh.run_drop(mesh.Dust(p_m=300.0), RADIUS, 1.5, mesh.Numerics(cells=5.0, depth=9.0))


@pytest.mark.parametrize(
    ("dust", "forces"),
    [
        ({"eta": 0.04, "rate_n": 0.5}, {}),
        ({"gradient": 8.0}, {}),
        ({"crust": (0.03, 0.5e-3)}, {}),
        ({"interface": (0.3e-3, 0.2e-3, 3.0)}, {}),
        ({"hardening": 3.0}, {}),
        ({}, {"side": 0.15}),
        ({}, {"shaft_drag": 2.0}),
        ({}, {"pull": 1e-5}),
        ({}, {"viscous": 1e-4}),
        ({}, {"inertial": 3e-4}),
        ({}, {"film": (3e-5, 0.2e-3)}),
        ({}, {"gathered": 0.5}),
    ],
)
def test_what_campaigns_hide_holds_a_drop_back_and_closes_its_book(dust, forces):
    plain = mesh.run_drop(mesh.Dust(), RADIUS, 0.30)
    held = mesh.run_drop(mesh.Dust(**dust), RADIUS, 0.30, forces=mesh.Forces(**forces))
    assert held.stopping_depth < 0.99 * plain.stopping_depth
    assert abs(held.energy_error) < 0.005
    assert (held.energies["forces"] + held.energies["gathered mass"] > 0.0) == bool(forces)


def test_how_deep_the_mesh_is_does_not_matter_where_the_dust_gets_looser_downwards():
    """φ falls by 0.034 a cm: without an end near φ1 a tip of 1.5 mm goes 3 % deeper in 7 radii of dust than in 6, 45 % in 9."""
    dust = mesh.Dust(p_m=1350.0, gradient=-3.4)
    depths = [
        mesh.run_drop(dust, 1.5e-3, 0.5, mesh.Numerics(cells=6.0, depth=depth)).stopping_depth
        for depth in (6.0, 9.0)
    ]
    bead = Projectile("hemisphere", 1.5e-3, mesh.BEAD * 1.5e-3**3)
    run = simulate(DropSetting(bead, 0.5, Material(p_m=1350.0), filling_gradient=-3.4, spacing=0.3e-3))
    assert depths == pytest.approx([run.penetration_depth] * 2, rel=0.006)


@pytest.mark.parametrize("bulk", [15e3, 135e3])
def test_a_drop_is_thrown_back_as_far_as_by_the_mesh(bulk):
    """Three times as far by dust that is nine times as soft."""
    bead = Projectile("hemisphere", RADIUS, mesh.BEAD * RADIUS**3)
    material = Material(p_m=1300.0, bulk_modulus=bulk)
    run = simulate(DropSetting(bead, 0.5, material, spacing=RADIUS / 5, after_stop=0.5))
    numerics = mesh.Numerics(depth=6.0)
    found = mesh.run_drop(mesh.Dust(bulk_modulus=bulk), RADIUS, 0.5, numerics, after=1.5)
    ours = measure_lift(run.time, run.depth, run.stopping_time, run.penetration_depth)
    theirs = measure_lift(found.time, found.depth, found.stopping_time, found.stopping_depth)
    assert ours == pytest.approx(theirs, rel=0.08)
    assert theirs[1] == pytest.approx({15e3: 44e-6, 135e3: 14e-6}[bulk] * 1e6, rel=0.08)


def test_friction_holds_a_drop_down_on_its_way_back():
    lifts, books = [], []
    for side in (0.0, 0.3):
        run = mesh.run_drop(mesh.Dust(), RADIUS, 0.3, forces=mesh.Forces(side=side), after=1.5)
        lifts.append(measure_lift(run.time, run.depth, run.stopping_time, run.stopping_depth)[1])
        books.append(abs(run.energy_error))
    assert 0.0 < lifts[1] < 0.8 * lifts[0]
    assert max(books) < 0.005


def test_dust_that_shear_weakens_lets_a_drop_go_deeper_and_closes_its_book():
    plain = mesh.run_drop(mesh.Dust(), RADIUS, 0.30)
    let = mesh.run_drop(mesh.Dust(weakening=0.4), RADIUS, 0.30)
    assert let.stopping_depth > 1.01 * plain.stopping_depth
    assert abs(let.energy_error) < 0.005


@pytest.mark.parametrize(
    "hidden, law",
    [
        ({"weakening": 0.5}, {"strength_of_strain": lambda e: 1.0 - 0.5 * (1.0 - 2.0 ** (-e / 0.3))}),
        ({"hardening": 2.0}, {"shear_of_strain": lambda e: 1.0 + 2.0 * e}),
    ],
)
def test_what_plastic_strain_does_is_the_same_in_labsim(hidden, law):
    """Depths move by 7 % and -15 %, alike to 0.7 % of the depth."""
    strain = np.linspace(0.0, 4.0, 201)
    setting = DropSetting(
        Projectile("hemisphere", RADIUS, mesh.BEAD * RADIUS**3), 0.5, Material(), spacing=RADIUS / 5
    )
    terms = {key: tuple(zip(strain, shape(strain), strict=True)) for key, shape in law.items()}
    numerics = mesh.Numerics(cells=10.0)
    moved = [mesh.run_drop(mesh.Dust(**each), RADIUS, 0.5, numerics).stopping_depth for each in ({}, hidden)]
    ours = [simulate(each).penetration_depth for each in (setting, setting.replace(**terms))]
    assert abs(moved[1] / moved[0] - 1.0) > 0.05
    assert ours[1] / ours[0] == pytest.approx(moved[1] / moved[0], abs=0.007)


@pytest.mark.parametrize("middle, factor, moved", [(0.35e-3, 3.0, -0.061), (0.3e-3, 0.25, 0.084)])
def test_a_thin_layer_of_another_strength_does_the_same_in_labsim(middle, factor, moved):
    """0.15 mm thick, one and a half spacings of labsim and six cells of the mesh: alike to 0.6 % of the depth."""
    edges = (middle - 0.075e-3, middle + 0.075e-3)
    layer = (
        (edges[0] - 1e-7, 1.0), (edges[0] + 1e-7, factor), (edges[1] - 1e-7, factor), (edges[1] + 1e-7, 1.0),
    )  # fmt: skip
    setting = DropSetting(
        Projectile("hemisphere", RADIUS, mesh.BEAD * RADIUS**3), 0.5, Material(), spacing=RADIUS / 5
    )
    numerics = mesh.Numerics(cells=20.0)
    theirs = [
        mesh.run_drop(mesh.Dust(interface=each), RADIUS, 0.5, numerics).stopping_depth
        for each in ((0.0, 0.0, 1.0), (middle, 0.15e-3, factor))
    ]
    ours = [simulate(each).penetration_depth for each in (setting, setting.replace(strength_of_depth=layer))]
    assert theirs[1] / theirs[0] - 1.0 == pytest.approx(moved, abs=0.002)
    assert ours[1] / ours[0] == pytest.approx(theirs[1] / theirs[0], abs=0.006)


@pytest.mark.parametrize("creep", [(0.2, 1e-3), (0.4, 3e-4), (-0.3, 1e-3)])
def test_a_strength_that_goes_with_time_does_the_same_in_labsim(creep):
    """Depths move by 4, 34 and -4 %, alike to 0.5 % of the depth, times to 1.5 %; the mesh closes its book."""
    share, first = creep
    time = np.linspace(0.0, 0.02, 401)
    law = tuple(zip(time, 1.0 - share * np.log1p(time / first), strict=True))
    setting = DropSetting(
        Projectile("hemisphere", RADIUS, mesh.BEAD * RADIUS**3), 0.5, Material(), spacing=RADIUS / 5
    )
    numerics = mesh.Numerics(cells=10.0)
    theirs = [mesh.run_drop(mesh.Dust(**each), RADIUS, 0.5, numerics) for each in ({}, {"creep": creep})]
    ours = [simulate(each) for each in (setting, setting.replace(strength_of_time=law))]
    moved = theirs[1].stopping_depth / theirs[0].stopping_depth
    assert abs(moved - 1.0) > 0.03 and (moved > 1.0) == (share > 0.0)
    assert ours[1].penetration_depth / ours[0].penetration_depth == pytest.approx(moved, abs=0.005)
    later = theirs[1].stopping_time / theirs[0].stopping_time
    assert ours[1].stopping_time / ours[0].stopping_time == pytest.approx(later, abs=0.015)
    assert all(abs(each.energy_error) < 0.005 for each in (*theirs, *ours))


def test_after_its_stop_a_drop_comes_up_and_closes_its_book():
    stop = mesh.run_drop(mesh.Dust(), RADIUS, 0.30)
    rest = mesh.run_drop(mesh.Dust(), RADIUS, 0.30, after=2.0)
    assert rest.stopping_depth == stop.stopping_depth
    assert rest.time[-1] == pytest.approx(2.0 * stop.stopping_time, rel=0.01)
    assert 0.8 * stop.stopping_depth < rest.depth[-1] < stop.stopping_depth
    assert abs(rest.energy_error) < 0.005
