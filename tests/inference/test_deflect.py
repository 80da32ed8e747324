"""Laws on the projectile without runs: against the equation of motion solved directly, and against simulations."""

from __future__ import annotations

import math
from types import MethodType, SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labsim.effects import Normal, Parameter
from labsim.inference.emulation.deflection import acts_on_projectile, deflect
from labsim.inference.emulation.forward import ResponseTable
from labsim.inference.emulation.grid import ProjectileGroup, Request, RunGrid
from labsim.inference.emulation.nodes import enclosing_nodes
from labsim.inference.problem import Problem
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


def test_one_run_and_the_trend_say_what_more_runs_would() -> None:
    """A drag that grows with the square of the speed, known from one amplitude: four times as far a line is far off."""

    def drag(amplitude: float):
        table = tuple((v, 1e-3 * amplitude * v**2) for v in np.linspace(0, 1.2, 25))
        return lambda setting: setting.replace(force_of_speed=table)

    group = ProjectileGroup(BEAD, SPEEDS, is_scan=False, sparse=(0, 1, 3))
    grid = RunGrid(None, None, [group])  # type: ignore[arg-type]
    grid.setting = lambda group, speed, *_: set_drop(speed)  # type: ignore[method-assign]
    strengths = enclosing_nodes(math.log(1300.0))
    for index in strengths:
        grid.runs[Request("", None, index).of(0)] = [fall(set_drop(speed)) for speed in SPEEDS]
    table = ResponseTable(np.log(SPEEDS), group.sparse)

    def extract(run: Motion) -> np.ndarray:
        return np.log([run.penetration_depth, run.stopping_time])

    def simulate(amplitude: float) -> np.ndarray:
        runs = [fall(drag(amplitude)(set_drop(speed))) for speed in SPEEDS]
        before = grid.runs[Request("", None, 0).of(0)]
        return np.array([extract(run) - extract(old) for run, old in zip(runs, before, strict=True)])

    step = Parameter("c", "1", 0.0, (0.0, 100.0), Normal(0.0, 1.0), 1.0, "of a test")
    problem = SimpleNamespace(
        groups=[group], grid=grid, campaign=SimpleNamespace(p_m_range=(300.0, 6000.0)), node_step=1.0,
        features=[SimpleNamespace(group=0, table=table, extract=extract)], change=lambda name, a: drag(a),
        _find=lambda name: SimpleNamespace(amplitudes=[step], kind="material"), _variant=lambda name, a: f"{name} {a}",
        _extract_plain=lambda number, request: [
            (table, np.array([[extract(run)] for run in grid.runs[request.of(number)]]))
        ],
    )  # fmt: skip
    problem._fill_trend = MethodType(Problem._fill_trend, problem)
    table.changes["drag"] = {0: {1.0: simulate(1.0)}}
    assert not Problem.follows_trend(problem, "drag")
    Problem.require_trend(problem, "drag", math.log(1300.0), 3.5)
    assert Problem.follows_trend(problem, "drag")
    truth = simulate(4.0)[1]
    table.base = {index: np.zeros((len(SPEEDS), 2)) for index in strengths}
    response = table.at(math.log(1000.0), math.log(SPEEDS[1]))
    followed = response.change("drag", 4.0)
    del table.corrections["drag"]
    straight = response.change("drag", 4.0)
    assert followed == pytest.approx(truth, rel=0.02)
    assert np.all(np.abs(straight - truth) > 5 * np.abs(followed - truth))


def test_a_trend_may_end_beside_an_estimate_not_at_it() -> None:
    """Soft dust that a law leads through is left out; where it is next to the estimate, the law has runs about itself."""
    law = ResponseTable(np.log(SPEEDS), (0, 1, 3), changes={"law": {0: {1.0: np.ones((4, 2))}}})
    group = ProjectileGroup(BEAD, SPEEDS, is_scan=False, sparse=(0, 1, 3))
    problem = SimpleNamespace(
        groups=[group], campaign=SimpleNamespace(p_m_range=(300.0, 6000.0)), node_step=1.0,
        features=[SimpleNamespace(group=0, table=law)],
        _find=lambda name: SimpleNamespace(
            amplitudes=[Parameter("c", "1", 0.0, (0.0, 9.0), Normal(0.0, 1.0), 1.0, "of a test")], kind="material"
        ),
    )  # fmt: skip
    nodes = enclosing_nodes(math.log(1300.0))

    def fill(number, own, name, index, amplitudes) -> None:
        known = law.trends[name].setdefault(index, {})
        known |= {a: np.full((4, 2), a) for a in amplitudes if index not in through}

    problem._fill_trend = fill
    through = {nodes[1]}
    Problem.require_trend(problem, "law", math.log(1300.0), 1.5)
    assert not law.corrections and nodes[1] not in law.trends["law"]
    law.trends.clear()
    through = {nodes[0]}
    Problem.require_trend(problem, "law", math.log(1300.0), 1.5)
    assert set(law.trends["law"]) == {*nodes[1:]} and np.all(law.corrections["law"][0][1.0] == 0.0)
    through = {nodes[1]}
    Problem.require_trend(problem, "law", math.log(1300.0), 4.5)  # it has moved out of what is known
    assert "law" not in law.corrections and nodes[1] not in law.trends["law"]
