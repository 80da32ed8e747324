"""Laws on the projectile without runs: against the equation of motion solved directly, and against simulations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labsim.inference.emulation.deflection import acts_on_projectile, deflect
from labsim.records import Material, Projectile
from labsim.runs.parts import Motion
from labsim.runs.store import RunStore
from labsim.sph import DropSetting

SPEEDS = (0.25, 0.38, 0.58, 0.9)
RADIUS = 0.5e-3


BEAD = Projectile("hemisphere", RADIUS, 1.33e-6)


def set_drop(speed: float) -> DropSetting:
    return DropSetting(BEAD, speed, Material(p_m=1300.0), spacing=RADIUS / 4, after_stop=0.34)


def fall(setting: DropSetting) -> Motion:
    """A drop whose dust resists as a function of depth and speed, with all laws, until it stops."""
    mass = setting.projectile.mass
    k, c = 0.5, 3e-4  # N/m, kg/m

    def read(key: str, at: float) -> float:
        table = getattr(setting, key)
        return float(np.interp(at, *np.transpose(table))) if table else 0.0

    def accelerate(t: float, state: np.ndarray) -> tuple[float, float]:
        z, v = state
        push = 1e-4 + k * z + c * v * v + read("force_of_depth", z)
        push += (read("force_of_speed", v) + read("force_of_time", t)) * v / (v + 1e-3)
        push += read("viscosity_of_depth", z) * v + read("drag_of_depth", z) * v * v
        here, below = (read("gathered_of_depth", at) for at in (z, z + 1e-7))
        push += (below - here) / 1e-7 * v * v
        return v, setting.gravity - push / (mass + here + read("mass_of_depth", z))

    def rest(_: float, state: np.ndarray) -> float:
        return state[1]

    rest.terminal, rest.direction = True, -1  # type: ignore[attr-defined]
    found = solve_ivp(
        accelerate, (0, 1), (0, setting.impact_speed), events=rest, rtol=1e-9, atol=1e-12, dense_output=True
    )
    stop = found.t[-1]
    time = np.linspace(0, stop, 2000)
    depth, speed = found.sol(time)
    after = stop * np.linspace(1.001, 1.34, 100)
    return Motion(
        setting, np.append(time, after), np.append(depth, np.full(100, depth[-1])),
        np.append(speed, np.zeros(100)), float(depth[-1]), float(stop), True,
    )  # fmt: skip


LAWS = {
    "force of depth": ("force_of_depth", ((0.0, 0.0), (RADIUS, 3e-4), (2 * RADIUS, 0.0))),
    "a pull": ("force_of_depth", ((0.0, -5e-5), (1.0, -5e-5))),
    "force of speed": ("force_of_speed", tuple((v, 3e-4 * v**1.5) for v in np.linspace(0, 1.2, 25))),
    "force of time": ("force_of_time", ((0.0, 0.0), (2e-3, 1e-4))),
    "viscosity of depth": ("viscosity_of_depth", ((0.0, 0.0), (2 * RADIUS, 4e-4))),
    "drag of depth": ("drag_of_depth", ((0.0, 0.0), (2 * RADIUS, 8e-4))),
    "mass": ("mass_of_depth", ((0.0, 0.0), (2 * RADIUS, 4e-7))),
    "mass that lay still": ("gathered_of_depth", ((0.0, 0.0), (2 * RADIUS, 4e-7))),
}


@pytest.mark.parametrize("law", LAWS)
def test_deflected_motions_solve_the_equation_of_motion(law: str) -> None:
    """In dust whose resistance is a function of depth and speed the method is exact but for its interpolation."""
    key, table = LAWS[law]
    before = [fall(set_drop(speed)) for speed in SPEEDS]
    changed = [run.setting.replace(**{key: table}) for run in before]
    (motions,) = deflect(before, [changed])
    for old, motion, setting in zip(before, motions, changed, strict=True):
        assert motion is not None
        direct = fall(setting)
        moved = direct.penetration_depth - old.penetration_depth
        later = direct.stopping_time - old.stopping_time
        assert abs(moved) > 0.005 * old.penetration_depth  # or the law would not be at work
        assert motion.penetration_depth - old.penetration_depth == pytest.approx(moved, rel=0.02)
        assert motion.stopping_time - old.stopping_time == pytest.approx(
            later, rel=0.03, abs=2e-3 * old.stopping_time
        )
        half = 0.5 * direct.stopping_time
        assert motion.depth_at(np.array([half])) == pytest.approx(direct.depth_at(np.array([half])), rel=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_deflected_motions_are_those_of_simulations(law: str, shared_store: str) -> None:
    """Depths change by what runs with the law say, to a tenth of it and a per mille of the depth, which runs are rough by."""
    key, table = LAWS[law]
    plain = [set_drop(speed) for speed in SPEEDS]
    changed = [setting.replace(**{key: table}) for setting in plain]
    runs = RunStore(shared_store).get_parts([*plain, *changed], [Motion] * 2 * len(plain), workers=2)
    before, simulated = runs[: len(plain)], runs[len(plain) :]
    (motions,) = deflect(before, [changed])
    for old, motion, direct in zip(before, motions, simulated, strict=True):
        moved = direct.penetration_depth - old.penetration_depth
        print(
            law,
            old.setting.impact_speed,
            moved / old.penetration_depth,
            motion.penetration_depth / old.penetration_depth - 1,
        )
        assert motion.penetration_depth - old.penetration_depth == pytest.approx(
            moved, rel=0.1, abs=1e-3 * old.penetration_depth
        )


def test_what_the_runs_do_not_know_is_not_said() -> None:
    """A force that stops the slowest drop at once leaves their range; the others do not suffer."""
    before = [fall(set_drop(speed)) for speed in SPEEDS]
    strong = [run.setting.replace(force_of_depth=((0.0, 2e-3), (1.0, 2e-3))) for run in before]
    weak = [run.setting.replace(force_of_depth=((0.0, 1e-5), (1.0, 1e-5))) for run in before]
    first, second = deflect(before, [strong, weak])
    assert first[0] is None and first[-1] is not None and None not in second


def test_only_laws_on_the_projectile_are_taken() -> None:
    plain = set_drop(0.4)
    assert acts_on_projectile(plain, plain.replace(force_of_speed=((0.0, 0.0), (1.0, 1e-4))))
    assert not acts_on_projectile(plain, plain.replace(pore_gas=100.0))
    assert not acts_on_projectile(
        plain, plain.replace(pore_gas=100.0, force_of_speed=((0.0, 0.0), (1.0, 1e-4)))
    )
