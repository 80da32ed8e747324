"""A law with one number changed by three percent is found out: closed forms of the paths say which number it is."""

import math

import numpy as np
import pytest

from labsim.records import Material
from labsim.sph import sirono
from labsim.sph.bodies import set_body
from labsim.sph.materials import SHELF, find_law
from labsim.sph.particles import fill_at_rest, name_rows

MATERIAL, SOLID = Material(), 2000.0
MUTANTS = {
    "bulk modulus": ("trial = k * (", "trial = 1.03 * k * ("),
    "shear modulus": ("shear = shear_to_bulk * k", "shear = 1.03 * shear_to_bulk * k"),
    "four thirds": ("1.0 + 4.0 * (1.0 / 3.0)", "1.0 + (1.0 / 3.0)"),
    "shear strength": ("limit2 = shear_factor", "limit2 = 1.06 * shear_factor"),
    "compressive strength": ("= compressive[i], tensile[i]", "= 1.03 * compressive[i], tensile[i]"),
    "tensile strength": ("= compressive[i], tensile[i]", "= compressive[i], 1.03 * tensile[i]"),
}


def lead(law, phi, strain=0.0, shear=0.0, sideways=0.0, steps=400):
    """One particle of ``law`` after ln strains along z and across, and a shear, led there in even steps."""
    setting = set_body(Material(law=law), 1e-4, 1.0)
    s, own = name_rows(setting, fill_at_rest(setting, np.ones(1), np.zeros(1), np.array([phi])))
    constants, tables = law_constants(law, setting)
    s.lzz[:], s.lxx[:], s.u[:], s.lxz[:], s.lzx[:] = strain, sideways, sideways, shear, shear
    for _ in range(steps):
        find_law(law).update(0, 1, 1.0 / steps, True, s, own, constants, tables)
    q = math.sqrt(1.5 * (s.sxx[0] ** 2 + s.szz[0] ** 2 + (s.sxx[0] + s.szz[0]) ** 2) + 3 * s.sxz[0] ** 2)
    return s.pressure[0], q, s.sound[0], s.density[0] / SOLID


def law_constants(law, setting):
    module = find_law(law)
    return module.make_constants(setting), module.make_tables(setting)


def find_wrong(law) -> set[str]:
    """Closed forms that the law misses by more than one percent."""
    found = {}
    modulus = float(sirono.bulk_modulus(0.15, MATERIAL))
    p, q, sound, phi = lead(law, 0.15, strain=-1e-4)
    found["bulk modulus"] = p / (modulus * math.expm1(1e-4))
    found["shear modulus"] = q / (2 * 0.5 * modulus * 1e-4)
    found["four thirds"] = sound**2 * phi * SOLID / (modulus * (1 + 4 / 3 * 0.5))
    p, *_, phi = lead(law, 0.15, strain=-0.15, sideways=-0.15)
    found["compressive strength"] = p / float(sirono.compressive_strength(phi, MATERIAL))
    p, *_, phi = lead(law, 0.15, strain=0.05, sideways=0.05)
    found["tensile strength"] = p / float(sirono.tensile_strength(phi, MATERIAL))
    _, q, _, phi = lead(law, 0.15, shear=0.1)
    found["shear strength"] = q / float(sirono.shear_strength(phi, MATERIAL))
    return {name for name, ratio in found.items() if not math.isclose(ratio, 1.0, rel_tol=0.01)}


def test_the_law_meets_every_closed_form():
    assert find_wrong("porous_dust") == set()


@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_found_out(name, tmp_path):
    file = tmp_path / "porous_dust.py"
    old, new = MUTANTS[name]
    source = (SHELF.folder / file.name).read_text()
    assert source.count(old) == 1
    file.write_text(source.replace(old, new))
    wrong = find_wrong(str(file))
    print(name, "->", wrong)
    assert name in wrong
