"""Draw a plan of causes, each as large as eight standard deviations in its campaign.

    python benchmarks/lagrangian_mesh/make_campaigns.py FOLDER --plan fresh.toml --only f51,f52
    python benchmarks/lagrangian_mesh/draw_causes.py FOLDER f51,f52 --first 71 --seed 20261125 > more.toml

The campaigns named have nothing hidden. Each is screened, which says how large every cause has to be to leave a trace of SIGMAS
standard deviations beside p_m; one is drawn whose size lies inside its limits and the plan's twin has it, with the same seed.
"""

from __future__ import annotations

import argparse
import math
import tomllib
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.effects import Effect
from labsim.inference.calibrate import prepare
from labsim.inference.runs import RunStore
from labsim.inference.scatter import set_terms
from labsim.records import Campaign

SIGMAS = 8.0
CAUSES = (
    "strength_rate", "shear_strength", "tensile_strength", "pore_gas", "side_friction", "sample_drift",
    "density_gradient", "projectile_mass", "strength_slope", "surface_crust",
)  # fmt: skip
WEAKEST = 0.2  # of K0, Δ, factors: what the mesh still follows
SOFTEST = -0.027  # of φ in a crust: dust has no strength at φ1


def hide(name: str, effect: Effect, size: float, sign: float, rng: np.random.Generator) -> dict | None:
    """Keys of a campaign in a plan, or None where a cause of this size is none."""
    parameter = effect.amplitudes[0]
    if name == "strength_rate":
        n = float(np.clip(rng.normal(0.5, 0.15), 0.1, 1.0))
        eta = size * 1000.0 ** (0.5 - n)
        return {"dust": {"eta": eta, "rate_n": n}} if eta <= 1.0 else None
    if name in ("shear_strength", "tensile_strength", "projectile_mass"):
        factor = (1.0 + size) ** sign
        key = {"shear_strength": "shear_factor", "tensile_strength": "tensile_factor"}.get(name)
        within = max(WEAKEST, parameter.limits[0]) <= factor <= parameter.limits[1]
        return ({"dust": {key: factor}} if key else {"measure": {"mass": factor}}) if within else None
    value = parameter.null + sign * size
    if not parameter.limits[0] <= value <= parameter.limits[1]:
        return None
    if name == "pore_gas":
        return {"dust": {"gas_pressure": value}}
    if name == "side_friction":
        return {"body": {"side": value}}
    if name == "sample_drift":
        return {"drift": value} if abs(value) < 1.0 else None
    if name == "density_gradient":
        return {"dust": {"gradient": value}}
    if name == "strength_slope":
        return {"dust": {"delta": value}} if value > WEAKEST else None
    assert name == "surface_crust"
    length = next(each.null for each in effect.parameters if each.shape)
    return {"dust": {"crust": [value, length]}} if value > SOFTEST else None


def find_sizes(campaign: Campaign) -> dict[str, tuple[Effect, float]]:
    """Of every cause: the effect and the amplitude that is SIGMAS standard deviations."""
    bench, nominal = prepare(campaign, RunStore(), workers=1, terms=set_terms(campaign))
    found = screen(bench, nominal, np.random.default_rng(1))
    signal = {score.name: score.signal for score in found.scores}
    return {
        name: (bench.effects[name], SIGMAS / signal[name])
        for name in CAUSES
        if signal.get(name, 0.0) > 0.0 and math.isfinite(signal[name])
    }


def write(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {write(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(write, value)) + "]"
    return f"{value:.4g}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", help="f51,f52 …")
    parser.add_argument("--plan", type=Path, default=Path(__file__).parent / "fresh.toml")
    parser.add_argument("--first", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    plan = {each["name"]: each for each in tomllib.loads(asked.plan.read_text())["campaign"]}
    waiting: list[str] = []
    for k, name in enumerate(asked.names.split(",")):
        sizes = find_sizes(read_campaign(asked.folder / name))
        if len(waiting) <= 2:  # every cause as often as the others, but where none of those left is possible
            waiting += list(map(str, rng.permutation(CAUSES)))
        for cause in list(waiting):
            sign = float(rng.choice([-1.0, 1.0]))
            hidden = None
            for each in (sign, -sign):
                if hidden is None and cause in sizes:
                    hidden = hide(cause, *sizes[cause], each, rng)
            if hidden is not None:
                waiting.remove(cause)
                break
        else:
            continue
        print(f'[[campaign]]\nname = "f{asked.first + k}"\ncause = "{cause}"')
        print(f'note = "{SIGMAS:g} sigma, as {name} without it"')
        print(f"pm = {plan[name]['pm']}\nseed = {plan[name]['seed']}")
        print("".join(f"{key} = {write(value)}\n" for key, value in hidden.items()))


if __name__ == "__main__":
    main()
