"""Draw a plan of causes, each as large as eight standard deviations in its campaign.

    python -m benchmarks.lagrangian_mesh.make_campaigns FOLDER --plan fresh.toml --only f51,f52
    python -m benchmarks.lagrangian_mesh.draw_causes FOLDER f51,f52 --first 71 --seed 20261125 > more.toml

The campaigns named have nothing hidden. Of each a cause is drawn that is SIGMAS standard deviations strong: to the same drops
without noise, its square is how much lower χ² of the best fit is with the cause than without. Where no size inside the cause's
limits, and within LIKELY of its prior, does, another is drawn. The plan's twin has it, with the same seed and with noise.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.lagrangian_mesh.make_campaigns import labelled, make_campaign
from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.effects import Effect
from labsim.errors import LabsimError
from labsim.inference.calibrate import prepare
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.inference.scatter import set_error_budget
from labsim.records import Campaign
from labsim.runs.store import RunStore

SIGMAS = 8.0
CLOSE = 0.15  # of ln of the standard deviations
TRIES, STRIDE = 6, 3.0  # sizes tried, and how much larger the next may be
ROOM = 2.0  # factor on both ends of the range of p_m, which must not stop the fit
CAUSES = (
    "strength_rate", "shear_strength", "tensile_strength", "pore_gas", "side_friction", "sample_drift",
    "density_gradient", "projectile_mass", "strength_slope", "surface_crust",
)  # fmt: skip
LIKELY = 0.0013  # on either side of the prior: three standard deviations of a normal one
WEAKEST = 0.2  # of K0, Δ, factors: what the mesh still follows
SOFTEST = -0.027  # of φ in a crust: dust has no strength at φ1


def hide(name: str, effect: Effect, size: float, rng: np.random.Generator) -> tuple[dict, float] | None:
    """Keys of a campaign in a plan, and the effect's amplitude; None where a cause of this size (its sign counts) is none."""
    parameter = effect.amplitudes[0]
    scaled = name in ("shear_strength", "tensile_strength", "projectile_mass")
    if scaled:
        value = (1.0 + abs(size)) ** math.copysign(1.0, size)
    else:
        value = abs(size) if name == "strength_rate" else parameter.null + size
    if not LIKELY < float(parameter.prior.cdf(value)) < 1.0 - LIKELY:
        return None
    if name == "strength_rate":
        n = float(np.clip(rng.normal(0.5, 0.15), 0.1, 1.0))
        eta = value * 1000.0 ** (0.5 - n)
        return ({"dust": {"eta": eta, "rate_n": n}}, eta) if eta <= 1.0 else None
    if not parameter.limits[0] <= value <= parameter.limits[1] or (scaled and value < WEAKEST):
        return None
    if scaled:
        key = {"shear_strength": "shear_factor", "tensile_strength": "tensile_factor"}.get(name)
        return ({"dust": {key: value}} if key else {"measure": {"mass": value}}), value - 1.0
    keys: dict | None = None
    if name == "pore_gas":
        keys = {"dust": {"gas_pressure": value}}
    elif name == "side_friction":
        keys = {"body": {"side": value}}
    elif name == "sample_drift" and abs(value) < 1.0:
        keys = {"drift": value}
    elif name == "density_gradient":
        keys = {"dust": {"gradient": value}}
    elif name == "strength_slope" and value > WEAKEST:
        keys = {"dust": {"delta": value}}
    elif name == "surface_crust" and value > SOFTEST:
        keys = {"dust": {"crust": [value, next(each.null for each in effect.parameters if each.shape)]}}
    return None if keys is None else (keys, size)


def find_sizes(campaign: Campaign) -> dict[str, tuple[Effect, float]]:
    """Of every cause: the effect and the amplitude that is SIGMAS standard deviations where it is small."""
    problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
    found = screen(problem, nominal, np.random.default_rng(1))
    signal = {score.name: score.signal for score in found.scores}
    return {
        name: (problem.effects[name], SIGMAS / signal[name])
        for name in CAUSES
        if signal.get(name, 0.0) > 0.0 and math.isfinite(signal[name])
    }


def find_strength(plan: dict, name: str, amplitude: float, folder: Path) -> float:
    """Standard deviations: the root of what a cause takes from χ² of the best fit to a campaign without noise. What it does not
    take is what two codes differ by in other dust. Raises LabsimError, RuntimeError where a run fails."""
    with tempfile.TemporaryDirectory(dir=folder) as made:
        label, _ = make_campaign(({**plan, "quiet": True}, Path(made)))
        campaign = read_campaign(Path(made) / label)
        low, high = campaign.p_m_range
        campaign = replace(campaign, p_m_range=(low / ROOM, high * ROOM))
        problem, nominal = prepare(campaign, RunStore(), workers=1, budget=set_error_budget(campaign))
        # from the truth: from the nominal p_m, far off where the cause is strong, some fits ended halfway
        found = fit_hypothesis(problem, (name,), (math.log(plan["pm"]), {name: amplitude}))
        return math.sqrt(max(nominal.chi_square - found.chi_square, 0.0))


def aim(plan: dict, name: str, effect: Effect, size: float, drawn: int, folder: Path) -> dict | None:
    """What to hide so that it is SIGMAS strong, within CLOSE; None where no size does. size : the first, with its sign; drawn :
    seed of what else is drawn, the same at every size."""
    tried = {0.0: 0.0}
    for _ in range(TRIES):
        hidden = hide(name, effect, size, np.random.default_rng(drawn))
        if hidden is None:
            return None
        keys, amplitude = hidden
        try:
            strength = find_strength({**plan, **keys}, name, amplitude, folder)
        except (LabsimError, RuntimeError):
            return None
        print(f"# {keys}: {strength:.1f} sigma", file=sys.stderr, flush=True)
        if abs(math.log(max(strength, 0.1) / SIGMAS)) < CLOSE:
            return keys
        tried[size] = strength
        below = max((s for s, sigma in tried.items() if sigma < SIGMAS), key=abs)
        above = min((s for s, sigma in tried.items() if sigma > SIGMAS), key=abs, default=None)
        if above is None:
            size *= min(SIGMAS / max(strength, 0.5), STRIDE)
        else:
            share = (SIGMAS - tried[below]) / (tried[above] - tried[below])
            size = below + min(max(share, 0.1), 0.9) * (above - below)
    return None


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
            drawn = int(rng.integers(2**32))
            hidden = None
            for each in (sign, -sign):
                if hidden is None and cause in sizes:
                    effect, size = sizes[cause]
                    hidden = aim(plan[name], cause, effect, each * size, drawn, asked.folder)
            if hidden is not None:
                waiting.remove(cause)
                break
        else:
            continue
        print(f'[[campaign]]\nname = "f{asked.first + k}"\ncause = "{cause}"')
        print(f'note = "{SIGMAS:g} sigma, as {name} without it"')
        print(f"pm = {plan[name]['pm']}\nseed = {plan[name]['seed']}")
        print(
            "".join(f"{key} = {labelled.format_toml(value)}\n" for key, value in hidden.items()), flush=True
        )


if __name__ == "__main__":
    main()
