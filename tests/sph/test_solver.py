"""What every run promises: the same bytes again, momentum and energy that balance, clear refusals."""

import hashlib
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from labsim.errors import SimulationError
from labsim.records import Material, Projectile
from labsim.runs.store import require_stopped
from labsim.sph import DropSetting, Numerics, _jit, check_setting, particles, simulate
from labsim.sph import drop as drop_module
from labsim.sph.materials import porous_dust
from labsim.sph.materials._parts import gas_energy
from labsim.sph.run import make_run
from labsim.sph.state import LOG, Rows

RADIUS = 5e-4
MASS = 2540 * 4 / 3 * math.pi * RADIUS**3
BEAD = Projectile("hemisphere", RADIUS, MASS)
CYLINDER = Projectile("cylinder", RADIUS, 2540 * math.pi * RADIUS**2)


def a_drop(**changes):
    values = {"projectile": BEAD, "impact_speed": 0.66, "material": Material(), "spacing": RADIUS / 5}
    return DropSetting(**(values | changes))


def digest(run):
    parts = (run.time, run.depth, run.velocity, run.force, run.particles.filling_factor, run.particles.r)
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


@pytest.fixture(scope="module")
def drop():
    return simulate(a_drop())


@pytest.fixture(scope="module")
def planar_drop():
    return simulate(a_drop(projectile=CYLINDER, geometry="planar"))


def test_it_stops_and_says_how_deep(drop):
    assert drop.stopped
    assert 0.5e-3 < drop.penetration_depth < 0.9e-3
    assert drop.velocity[0] == 0.66
    assert np.max(drop.depth) == pytest.approx(drop.penetration_depth, rel=1e-3)
    assert drop.warnings == ()


def test_momentum(drop, planar_drop):
    assert abs(drop.momentum_error) < 1e-12
    assert abs(planar_drop.momentum_error) < 1e-12


def test_energy_book(drop, planar_drop):
    for run in (drop, planar_drop):
        assert abs(run.energy_error) < 0.01
        assert run.energies["plastic"] > 0.5 * run.energies["kinetic_at_contact"]
        assert run.energies["viscous"] >= 0


@pytest.mark.parametrize(
    "changes",
    [{"material": Material(contact_friction=0.3)}, {"projectile": Projectile("sphere", RADIUS, MASS)}],
)
def test_books_with_friction_and_with_a_sphere(changes, drop):
    run = simulate(a_drop(**changes))
    assert abs(run.momentum_error) < 1e-12
    assert abs(run.energy_error) < 0.01
    if "material" in changes:
        assert run.energies["friction"] > 0
        assert run.penetration_depth < drop.penetration_depth


def test_dust_that_stays_as_it_is_gives_no_energy():
    """The dust starts under its own weight: what it holds of elastic energy then is not booked as work of the drop."""
    setting = a_drop(material=Material(bulk_modulus=4500.0))
    dust, wall = particles.place_particles(setting)
    drop_module._fill_elastic(setting, dust)
    assert np.sum(dust[particles.MASS] * dust[particles.ELASTIC]) > 0
    log = np.zeros((2, len(LOG)))
    log[:, 2] = setting.impact_speed
    run = make_run(setting, log, None, dust, dust, dust, wall, 2 * math.pi, 0, 1.0)
    assert run.energies["elastic"] == 0.0
    assert run.energies["plastic"] == 0.0


def test_energy_of_trapped_gas_comes_back():
    """Dust with gas, pressed by 5 % and not yielding: none of the work that the law books is plastic."""
    setting = a_drop(material=Material(p_m=1e9, tensile_log10_a=9.0), pore_gas=2e4, gravity=0.0)
    dust, wall = particles.place_particles(setting)
    pressed = dust.copy()
    rate, steps = -0.05 / 3, 1000
    s, own = particles.name_rows(setting, pressed)
    s.ring[:], s.u[:], s.lxx[:], s.lzz[:] = 1.0, rate, rate, rate
    constants, tables = porous_dust.make_constants(setting), porous_dust.make_tables(setting)
    for _ in range(steps):
        porous_dust.update(0, s.x.size, 1 / steps, True, s, own, constants, tables)
    for each in (dust, pressed):
        drop_module._fill_elastic(setting, each)
    log = np.zeros((2, len(LOG)))
    log[:, 2] = setting.impact_speed
    energies = make_run(setting, log, None, pressed, pressed, dust, wall, 2 * math.pi, 0, 1.0).energies
    assert energies["gas"] > 0.05 * energies["elastic"] > 0
    assert abs(energies["plastic"]) < 1e-4 * energies["gas"]


def test_energy_of_trapped_gas_is_the_work_of_its_pressure():
    phi, initial, pressure = np.linspace(0.10, 0.30, 2001), 0.15, 2e4
    setting = a_drop(pore_gas=pressure)
    s = Rows(*np.zeros((len(Rows._fields), phi.size)))._replace(
        density=2000 * phi, initial=np.full(phi.size, initial)
    )
    energy = gas_energy(setting, s)
    excess = pressure * ((1 - initial) / (1 - phi) - 1)
    np.testing.assert_allclose(
        np.gradient(energy, phi)[1:-1], (excess / (2000 * phi**2))[1:-1], rtol=1e-3, atol=1e-3
    )
    assert energy[500] == pytest.approx(0.0, abs=1e-12)


def test_mass_ledger(drop):
    """Every particle keeps its mass: Σ φ V ρs is what was filled in, and the dust lost in volume went into compaction."""
    p = drop.particles
    filled = 0.15 * np.sum(p.volume * p.filling_factor / p.initial_filling_factor)
    assert np.sum(p.filling_factor * p.volume) == pytest.approx(filled, rel=1e-12)
    lost = np.sum(p.volume * (p.filling_factor / p.initial_filling_factor - 1))
    swept = math.pi * (RADIUS * drop.penetration_depth**2 - drop.penetration_depth**3 / 3)
    if drop.penetration_depth > RADIUS:
        swept = 2 / 3 * math.pi * RADIUS**3 + math.pi * RADIUS**2 * (drop.penetration_depth - RADIUS)
    assert 0.8 * swept < lost < 2 * swept  # the surface around it sinks too


def test_planar_run_is_symmetric(planar_drop):
    p = planar_drop.particles
    scale = 2 * np.max(np.abs(p.r))
    here, there = (
        np.lexsort((np.round(p.r, 7), np.round(p.z, 7))),
        np.lexsort((np.round(-p.r, 7), np.round(p.z, 7))),
    )
    np.testing.assert_allclose(p.r[here], -p.r[there], atol=1e-10 * scale)
    np.testing.assert_allclose(p.z[here], p.z[there], atol=1e-10 * scale)


def test_the_same_bytes_again(drop):
    assert digest(simulate(a_drop())) == digest(drop)


@pytest.mark.parametrize("cache", ["cold", "warm", "two workers"])
def test_the_same_bytes_from_another_process(drop, tmp_path_factory, cache):
    folder = tmp_path_factory.getbasetemp() / "compiled"
    program = (
        "import sys; sys.path[:0] = " + repr(sys.path) + "\n"
        "import importlib.util as u; s = u.spec_from_file_location('t', " + repr(__file__) + ")\n"
        "t = u.module_from_spec(s); s.loader.exec_module(t); print(t.digest(t.simulate(t.a_drop())))"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    count = 2 if cache == "two workers" else 1
    workers = [
        subprocess.Popen([sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(count)
    ]
    for worker in workers:
        out, _ = worker.communicate()
        assert worker.returncode == 0
        assert out.strip() == digest(drop)
    assert any(folder.rglob("*.nbi"))


def test_solver_hash_changes_with_a_source(tmp_path, monkeypatch):
    (tmp_path / "materials").mkdir()
    (tmp_path / "part.py").write_text("a = 1\n")
    monkeypatch.setattr(_jit, "_SOURCES", tmp_path)
    before = _jit.hash_sources()
    assert _jit.hash_sources() == before
    (tmp_path / "materials" / "law.py").write_text("a = 1\n")
    assert _jit.hash_sources() == before
    (tmp_path / "part.py").write_text("a = 2\n")
    after = _jit.hash_sources()
    assert after != before
    (tmp_path / "part.py").rename(tmp_path / "other.py")
    assert _jit.hash_sources() != after


def test_import_to_first_step_is_quick(drop):
    """With a warm cache, from the import to a drop of 100 µs: seconds of the process, not of a busy machine."""
    program = (
        "import sys; sys.path[:0] = " + repr(sys.path) + "\n"
        "import time, importlib.util as u; s = u.spec_from_file_location('t', " + repr(__file__) + ")\n"
        "import labsim\nfrom labsim.sph import DropSetting, simulate\nfrom labsim.records import Material, Projectile\n"
        f"b = Projectile('hemisphere', {RADIUS}, {MASS})\n"
        f"simulate(DropSetting(b, 0.66, Material(), spacing={RADIUS / 5}, duration=1e-6))\n"
        "print(time.process_time())"
    )
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert float(out) < 2.0


@pytest.mark.parametrize(
    ("changes", "key", "says"),
    [
        ({"spacing": RADIUS / 3.9}, "spacing", "does not resolve"),
        ({"spacing": 0.0}, "spacing", "positive"),
        ({"impact_speed": 16.0}, "impact_speed", "sound speed"),
        ({"impact_speed": math.nan}, "impact_speed", "positive"),
        ({"filling_factor": 0.12}, "filling_factor", "(0.12, 0.58)"),
        ({"filling_factor": 0.6}, "filling_factor", "(0.12, 0.58)"),
        ({"crust_excess": 0.5}, "filling_factor", "0.65"),
        ({"filling_gradient": -25.0}, "filling_gradient", "no strength 1 mm down"),
        ({"material": Material(p_m=0.0)}, "material.p_m", "positive"),
        ({"projectile": CYLINDER}, "projectile.tip", "planar"),
        ({"projectile": Projectile("sphere", RADIUS, 0.0)}, "projectile", "positive"),
    ],
)
def test_a_setting_that_cannot_be_simulated(changes, key, says):
    with pytest.raises(SimulationError) as caught:
        check_setting(a_drop(**changes))
    assert caught.value.key == key
    assert says in str(caught.value)


def test_four_spacings_across_the_tip_will_do():
    check_setting(a_drop(spacing=RADIUS / 4))


def test_dust_that_hardly_holds_together_comes_to_an_end():
    """A twentieth of the tensile strength in soft dust, 9.7 mm of it, whose bottom stops the drop: then a point collapses, and
    its steps become ever shorter. The motion up to the stop is known by then, and the run ends there."""
    setting = DropSetting(
        Projectile("hemisphere", 0.5e-3, 3.3249e-6),
        1.419857,
        Material(p_m=500.0, tensile_log10_a=2.8 + math.log10(0.05)),
        spacing=1e-4,
        after_stop=0.16,
        depth=9.7e-3,
    )
    run = simulate(setting)
    assert run.stopped and run.steps < 20_000
    assert run.stopping_time <= run.time[-1] < 1.16 * run.stopping_time
    assert np.diff(run.time).min() > 1e-10


def test_a_run_that_blows_up_names_its_parameters():
    with pytest.raises(SimulationError, match=r"blew up after \d+ steps.*courant=12"):
        simulate(a_drop(numerics=Numerics(courant=12.0)))


def test_a_run_whose_book_of_energy_does_not_close_is_made_with_a_shorter_step(monkeypatch):
    """A slow drop at twice the step that its sound asks for: the book shows it."""
    setting = DropSetting(
        Projectile("hemisphere", 0.5e-3, 3.3249e-6),
        0.1,
        Material(p_m=4000.0),
        spacing=1.25e-4,
        numerics=Numerics(courant=1.8),
    )
    found = simulate(setting)
    assert abs(found.energy_error) < 0.02 and not found.warnings and found.setting == setting
    monkeypatch.setattr(drop_module, "HALVINGS", 0)
    first = simulate(setting)
    assert abs(first.energy_error) > 0.05
    half = simulate(setting.replace(numerics=Numerics(courant=0.9)))
    assert half.penetration_depth == found.penetration_depth and half.steps == found.steps
    assert any("book of energy" in warning for warning in first.warnings)


def test_clamp_near_the_upper_limit_is_reported():
    """A dust that hardly grows stronger is driven up to φ2: the run says so."""
    weak = Material(p_m=2.0, phi_2=0.2, tensile_log10_a=-1.0, bulk_modulus=45e3)
    run = simulate(a_drop(material=weak, duration=1e-3, depth=a_drop().extent[1]))
    assert any("φ2" in warning and "%" in warning for warning in run.warnings)
    assert any("did not stop" in warning for warning in run.warnings)


def test_a_drop_that_would_feel_the_bottom_gets_deeper_dust(monkeypatch):
    """Mass that sticks carries the tip farther than its box was made for: the same depth as in dust that is deep anyway."""
    heavy = a_drop(mass_of_depth=((0.0, 0.0), (2e-3, 9.0 * a_drop().projectile.mass)))
    box = heavy.extent[1]
    found, deep = simulate(heavy), simulate(heavy.replace(depth=2 * box))
    assert found.stopped and found.setting == heavy and not found.warnings
    assert found.penetration_depth == pytest.approx(deep.penetration_depth, rel=1e-3)
    monkeypatch.setattr(drop_module, "FELT", -100.0)
    stopped_by_bottom = simulate(heavy)
    assert stopped_by_bottom.penetration_depth < 0.95 * found.penetration_depth


def test_a_drop_that_nothing_stops_ends_above_the_bottom():
    """It is no drop that stopped at the bottom of its box."""
    pulled = a_drop(force_of_depth=((0.0, -0.1), (1.0, -0.1)))
    run = simulate(pulled)
    assert not run.stopped and run.velocity[-1] > 0.0 and run.depth[-1] < pulled.extent[1]
    assert any("mm of dust" in warning for warning in run.warnings)
    with pytest.raises(SimulationError, match="mm of dust did not stop the drop"):
        require_stopped([run])


@pytest.mark.parametrize(
    "term",
    [
        "strength_rate",
        "crust_excess",
        "side_friction",
        "force_of_speed",
        "force_of_depth",
        "force_of_time",
        "viscosity_of_depth",
        "drag_of_depth",
    ],
)
def test_terms_of_the_catalogue_make_it_shallower(term, drop):
    value = {
        "strength_rate": 0.02,
        "crust_excess": 0.05,
        "side_friction": 2.0,
        "force_of_speed": ((0.0, 0.0), (1.0, 2e-3)),
        "force_of_depth": ((0.0, 0.0), (1e-3, 2e-3)),
        "force_of_time": ((0.0, 0.0), (1e-2, 2e-2)),
        "viscosity_of_depth": ((0.0, 0.0), (1e-3, 4e-3)),
        "drag_of_depth": ((0.0, 0.0), (1e-3, 8e-3)),
    }[term]
    run = simulate(a_drop(**{term: value}))
    assert run.penetration_depth < drop.penetration_depth * 0.998
    assert abs(run.momentum_error) < 1e-12
    assert abs(run.energy_error) < 0.015


def test_dust_that_sticks_is_as_good_as_a_heavier_projectile(drop):
    """The same mass from the start on; and mass that grows on the way takes it deeper, with its book closed."""
    setting = a_drop()
    mass = setting.projectile.mass
    heavier = simulate(a_drop(projectile=replace(setting.projectile, mass=1.5 * mass)))
    size = {"width": setting.extent[0], "depth": heavier.setting.extent[1]}
    heavier = simulate(a_drop(projectile=replace(setting.projectile, mass=1.5 * mass), **size))
    from_the_start = simulate(a_drop(mass_of_depth=((0.0, 0.5 * mass), (1.0, 0.5 * mass)), **size))
    assert from_the_start.penetration_depth == pytest.approx(heavier.penetration_depth, rel=2e-4)
    grown = simulate(a_drop(mass_of_depth=((0.0, 0.0), (1e-2, 5.0 * mass))))
    assert drop.penetration_depth * 1.01 < grown.penetration_depth < 2.0 * drop.penetration_depth
    assert abs(grown.momentum_error) < 1e-12 and abs(grown.energy_error) < 0.015
    assert (
        simulate(a_drop(mass_of_depth=((0.0, 0.0), (1.0, 0.0)))).penetration_depth == drop.penetration_depth
    )


def test_dust_that_lay_still_takes_its_momentum_from_the_projectile():
    """A mesh that shares no code with labsim: 0.1162 of the mass in every radius takes 2.08 % and 4.86 % of the depth (1.3071 of
    1.3738 radii at 0.4 m/s), where dust that has the tip's speed already adds to it."""
    radius, mass = 5e-4, 3.3249e-6
    ball = Projectile("hemisphere", radius, mass, length=4e-3)
    for speed, of_mesh in ((0.2, 0.6745 / 0.6888), (0.4, 1.3071 / 1.3738)):
        plain = DropSetting(ball, speed, Material(p_m=1300.0), spacing=radius / 5)
        run = simulate(plain.replace(gathered_of_depth=((0.0, 0.0), (12 * radius, 12 * 0.1162 * mass))))
        ratio = run.penetration_depth / simulate(plain).penetration_depth
        assert ratio == pytest.approx(of_mesh, abs=0.002)
        assert abs(run.momentum_error) < 1e-12 and abs(run.energy_error) < 0.005


def test_a_drag_along_the_shaft_takes_what_another_code_says():
    """A mesh that shares no code with labsim: 5 N s²/m² a metre of immersed length take 3.93 % and 13.90 % of the depth."""
    radius, mass = 5e-4, 3.3249e-6
    ball = Projectile("hemisphere", radius, mass, length=4e-3)
    for speed, of_mesh in ((0.2, 0.6617 / 0.6887), (0.4, 1.1827 / 1.3737)):
        plain = DropSetting(ball, speed, Material(p_m=1300.0), spacing=radius / 5)
        run = simulate(plain.replace(drag_of_depth=((0.0, 0.0), (12 * radius, 12 * radius * 5.0))))
        ratio = run.penetration_depth / simulate(plain).penetration_depth
        assert ratio == pytest.approx(of_mesh, abs=0.002)
        assert abs(run.momentum_error) < 1e-12 and abs(run.energy_error) < 0.005


def test_trapped_gas_is_in_the_energy_book(drop):
    """Which way trapped gas moves the depth is open (it stiffens the dust, and takes its shear strength away)."""
    run = simulate(a_drop(pore_gas=4e4))
    assert abs(run.penetration_depth / drop.penetration_depth - 1) > 0.01
    assert abs(run.momentum_error) < 1e-12
    print(run.energy_error)


def test_strength_shape_of_one_changes_nothing(drop):
    assert digest(simulate(a_drop(strength_shape=((0.1, 1.0), (0.5, 1.0))))) == digest(drop)


def test_looking_for_fronts_keeps_depth_and_books(drop):
    run = simulate(a_drop(numerics=Numerics(front=0.005)))
    assert run.penetration_depth == pytest.approx(drop.penetration_depth, rel=0.006)
    assert abs(run.momentum_error) < 1e-12
    assert abs(run.energy_error) < 0.01


def test_a_filling_factor_that_grows_with_depth(drop):
    run = simulate(a_drop(filling_gradient=10.0))
    assert run.penetration_depth < drop.penetration_depth
    assert np.ptp(run.particles.initial_filling_factor) > 0.01


def test_a_filling_factor_that_falls_stays_as_it_is_near_where_strength_ends(drop):
    setting = a_drop(filling_gradient=-12.0)
    run = simulate(setting)
    assert run.penetration_depth > drop.penetration_depth
    phi, depth = run.particles.initial_filling_factor, np.linspace(0.0, 4e-3, 4001)
    assert phi.min() == pytest.approx(setting.material.phi_1 + 0.005)
    above = particles._filling_above(setting, depth)
    assert np.gradient(above, depth) == pytest.approx(
        particles.initial_filling_factor(setting, depth), abs=1e-5
    )
