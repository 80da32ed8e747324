"""Laws as files: paths in p-q against closed form, a drop's books, a law from elsewhere, compiled code found again on disk."""

import math
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from labsim.errors import SimulationError
from labsim.records import Material, Projectile
from labsim.sph import DropSetting, check_setting, simulate, solver_hash
from labsim.sph.bodies import set_body
from labsim.sph.materials import SHELF, find_law, is_current, list_laws
from labsim.sph.particles import fill_at_rest, name_rows

CLAY = Material(law="von_mises")
COHESION, SHEAR, BULK = 5e3, 5e5, 5e6  # its defaults, Pa


class Lump:
    """One particle of a material, led along a path of strain."""

    def __init__(self, material):
        self.setting = set_body(material, 1e-4, 1.0, filling_factor=0.5)
        self.law = find_law(material.law)
        self.s, self.own = name_rows(
            self.setting, fill_at_rest(self.setting, np.ones(1), np.zeros(1), np.array([0.5]))
        )

    def lead(self, lxx=0.0, lzz=0.0, lxz=0.0, hoop=0.0, steps=2000):
        """Velocity gradient (1/s) over 1 s; ``hoop`` asks for rings of radius 1."""
        s = self.s
        s.lxx[:], s.lzz[:], s.lxz[:], s.u[:] = lxx, lzz, lxz, hoop
        constants, tables = self.law.make_constants(self.setting), self.law.make_tables(self.setting)
        for _ in range(steps):
            self.law.update(0, 1, 1.0 / steps, True, s, self.own, constants, tables)
        return s.pressure[0], math.sqrt(
            1.5 * (s.sxx[0] ** 2 + s.szz[0] ** 2 + (s.sxx[0] + s.szz[0]) ** 2) + 3 * s.sxz[0] ** 2
        )


@pytest.mark.parametrize("strain", [0.005, 0.05])
def test_uniaxial_path_of_von_mises(strain):
    """q = 2 G ε until 2 c, p = K (e^ε - 1) all the way."""
    p, q = Lump(CLAY).lead(lzz=-strain)
    assert p == pytest.approx(BULK * math.expm1(strain), rel=1e-9)
    assert q == pytest.approx(min(2 * SHEAR * strain, 2 * COHESION), rel=1e-9)


def test_isotropic_path_of_von_mises():
    p, q = Lump(CLAY).lead(lxx=-0.01, lzz=-0.01, hoop=-0.01)
    assert p == pytest.approx(BULK * math.expm1(0.03), rel=1e-9)
    assert q == pytest.approx(0.0, abs=1e-9 * p)


def test_simple_shear_of_von_mises():
    lump = Lump(CLAY)
    lump.lead(lxz=0.001)
    assert lump.s.sxz[0] == pytest.approx(SHEAR * 0.001, rel=1e-5)
    p, q = lump.lead(lxz=0.1)
    assert p == 0.0
    assert q == pytest.approx(2 * COHESION, rel=1e-9)
    assert abs(lump.s.sxz[0]) == pytest.approx(2 / math.sqrt(3) * COHESION, rel=1e-3)


def test_elastic_work_is_what_the_law_says_it_holds():
    lump = Lump(CLAY)
    lump.lead(lzz=-0.004, lxx=0.001, lxz=0.001)
    held = lump.law.elastic_energy(lump.setting, lump.s, lump.own)[0]
    assert lump.s.work[0] == pytest.approx(held, rel=1e-3)


def test_tension_ends_at_its_limit_and_leaves_a_gap():
    lump = Lump(Material(law="von_mises", constants=(("tension", 100.0),)))
    assert lump.lead(lxx=0.01, lzz=0.01, hoop=0.01)[0] == pytest.approx(-100.0, rel=1e-12)
    # half the way back is closing the gap: no pressure beyond the elastic recovery of the limit
    assert lump.lead(lxx=-0.005, lzz=-0.005, hoop=-0.005)[0] > BULK * 0.01


def a_drop(**changes):
    ball = Projectile("sphere", 5e-4, 5e-7)
    return DropSetting(ball, 1.0, CLAY, filling_factor=0.5, spacing=6.25e-5, **changes)


@pytest.fixture(scope="module")
def clay():
    return simulate(a_drop())


def test_a_ball_on_clay(clay):
    print(f"D {clay.penetration_depth * 1e3:.4f} mm, energy {clay.energy_error:+.2%}")
    assert clay.stopped and clay.penetration_depth > 0
    assert abs(clay.energy_error) < 0.01
    assert clay.energies["plastic"] > 0.5 * clay.energies["kinetic_at_contact"]
    assert clay.solver == solver_hash("von_mises") != solver_hash()


@pytest.mark.parametrize(
    ("law", "constants", "phi"),
    [
        ("drucker_prager_cap", (("cohesion", 50.0), ("cap_pressure", 1e5)), 0.6),
        ("p_alpha", (("tension", 1e3),), 0.2),
    ],
)
def test_a_ball_on_other_matter(law, constants, phi):
    """It stops, momentum is kept and the books balance; the effect on rates is the law's too."""
    setting = a_drop().replace(material=Material(law=law, constants=constants), filling_factor=phi)
    run = simulate(setting)
    print(f"{law}: D {run.penetration_depth * 1e3:.4f} mm, energy {run.energy_error:+.2%}")
    assert run.stopped and run.penetration_depth > 0 and not run.warnings
    assert abs(run.energy_error) < 0.01 and abs(run.momentum_error) < 1e-12
    assert run.energies["plastic"] > 0.5 * run.energies["kinetic_at_contact"]
    check_setting(setting.replace(strength_rate=0.1))


def test_a_law_from_elsewhere_is_the_same_law(clay, tmp_path):
    """The same text in another folder, in another process: same numbers, and the next one compiles nothing."""
    path = tmp_path / "von_mises.py"
    shutil.copy(SHELF.folder / "von_mises.py", path)
    program = (
        "import sys; sys.path[:0] = " + repr(sys.path) + "\n"
        "import importlib.util as u; s = u.spec_from_file_location('t', " + repr(__file__) + ")\n"
        "t = u.module_from_spec(s); s.loader.exec_module(t)\n"
        f"run = t.simulate(t.a_drop().replace(material=t.Material(law={str(path)!r})))\n"
        "from labsim.sph.loop import load_loop\n"
        "print(run.penetration_depth.hex(), "
        f"sum(load_loop({str(path)!r}).stats.cache_misses.values()))"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "compiled")}
    out = [
        subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    ]
    assert [each[0] for each in out] == [clay.penetration_depth.hex()] * 2
    assert [each[1] for each in out] == ["1", "0"]


@pytest.mark.parametrize(
    ("material", "key", "says"),
    [
        (Material(law="mud"), "material.law", "p_alpha, porous_dust, von_mises"),
        (Material(law="von_mises", constants=(("p_m", 1.0),)), "material.p_m", "bulk_modulus, cohesion"),
        (Material(law="von_mises", constants=(("cohesion", -1.0),)), "material.cohesion", "use 0.001"),
    ],
)
def test_what_a_law_has_not(material, key, says):
    with pytest.raises(SimulationError) as caught:
        check_setting(a_drop().replace(material=material))
    assert caught.value.key == key
    assert says in str(caught.value)


def test_terms_of_the_dust_are_refused_by_clay():
    with pytest.raises(SimulationError, match="no such term"):
        check_setting(a_drop(pore_gas=1e4))


def test_solvers_of_this_day():
    assert list_laws() == ["drucker_prager_cap", "p_alpha", "porous_dust", "von_mises"]
    assert all(is_current(solver_hash(law)) for law in list_laws())
    assert not is_current("old")
    assert not is_current(solver_hash()[:-1] + "x")
