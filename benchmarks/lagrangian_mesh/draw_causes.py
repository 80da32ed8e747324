"""Draw a plan of causes, each as large as eight standard deviations in its campaign.

    python benchmarks/lagrangian_mesh/make_campaigns.py FOLDER --plan fresh.toml --only f51,f52
    python benchmarks/lagrangian_mesh/draw_causes.py FOLDER f51,f52 --first 71 --seed 20261125 > more.toml

The campaigns named have nothing hidden. Of each a cause is drawn that leaves SIGMAS standard deviations: χ² of the best nominal
fit to the same drops without noise, less that of nothing hidden, is its square. Where no size inside the cause's limits does,
another is drawn. The plan's twin has it, with the same seed and with noise.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from make_campaigns import make_campaign

from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.effects import Effect
from labsim.errors import LabsimError
from labsim.inference.calibrate import prepare
from labsim.inference.runs import RunStore
from labsim.inference.scatter import set_terms
from labsim.records import Campaign

SIGMAS = 8.0
CLOSE = 0.15  # of ln of the standard deviations
TRIES, STRIDE = 6, 3.0  # sizes tried, and how much larger the next may be
ROOM = 2.0  # factor on both ends of the range of p_m, which must not stop the fit
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


def hide_drawn(name: str, effect: Effect, sign: float, draws: int, size: float) -> dict | None:
    """The same with what else is drawn the same at every size."""
    return hide(name, effect, size, sign, np.random.default_rng(draws))


def find_sizes(campaign: Campaign) -> dict[str, tuple[Effect, float]]:
    """Of every cause: the effect and the amplitude that is SIGMAS standard deviations where it is small."""
    bench, nominal = prepare(campaign, RunStore(), workers=1, terms=set_terms(campaign))
    found = screen(bench, nominal, np.random.default_rng(1))
    signal = {score.name: score.signal for score in found.scores}
    return {
        name: (bench.effects[name], SIGMAS / signal[name])
        for name in CAUSES
        if signal.get(name, 0.0) > 0.0 and math.isfinite(signal[name])
    }


def leave(plan: dict, folder: Path) -> float:
    """χ² that the best nominal fit leaves of a campaign without noise. Raises LabsimError, RuntimeError where there is none."""
    with tempfile.TemporaryDirectory(dir=folder) as made:
        name, _ = make_campaign(({**plan, "quiet": True}, Path(made)))
        campaign = read_campaign(Path(made) / name)
        low, high = campaign.p_m_range
        campaign = replace(campaign, p_m_range=(low / ROOM, high * ROOM))
        return prepare(campaign, RunStore(), workers=1, terms=set_terms(campaign))[1].chi_square


def aim(
    plan: dict, hide_size: Callable[[float], dict | None], size: float, folder: Path, floor: float
) -> dict | None:
    """What to hide so that SIGMAS are left, within CLOSE; None where no size does. size : the first; floor : χ² of nothing."""
    tried = {0.0: 0.0}
    for _ in range(TRIES):
        hidden = hide_size(size)
        if hidden is None:
            return None
        try:
            left = math.sqrt(max(leave({**plan, **hidden}, folder) - floor, 0.0))
        except (LabsimError, RuntimeError):
            return None
        print(f"# {hidden}: {left:.1f} sigma", file=sys.stderr, flush=True)
        if abs(math.log(max(left, 0.1) / SIGMAS)) < CLOSE:
            return hidden
        tried[size] = left
        below = max((s for s, sigma in tried.items() if sigma < SIGMAS), default=0.0)
        above = min((s for s, sigma in tried.items() if sigma > SIGMAS), default=math.inf)
        if math.isinf(above):
            size *= min(SIGMAS / max(left, 0.5), STRIDE)
        else:
            share = (SIGMAS - tried[below]) / (tried[above] - tried[below])
            size = below + min(max(share, 0.1), 0.9) * (above - below)
    return None


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
        floor = leave(plan[name], asked.folder)
        if len(waiting) <= 2:  # every cause as often as the others, but where none of those left is possible
            waiting += list(map(str, rng.permutation(CAUSES)))
        for cause in list(waiting):
            sign = float(rng.choice([-1.0, 1.0]))
            draws = rng.integers(2**32)
            hidden = None
            for each in (sign, -sign):
                if hidden is None and cause in sizes:
                    effect, size = sizes[cause]
                    hide_size = partial(hide_drawn, cause, effect, each, draws)
                    hidden = aim(plan[name], hide_size, size, asked.folder, floor)
            if hidden is not None:
                waiting.remove(cause)
                break
        else:
            continue
        print(f'[[campaign]]\nname = "f{asked.first + k}"\ncause = "{cause}"')
        print(f'note = "{SIGMAS:g} sigma, as {name} without it"')
        print(f"pm = {plan[name]['pm']}\nseed = {plan[name]['seed']}")
        print("".join(f"{key} = {write(value)}\n" for key, value in hidden.items()), flush=True)


if __name__ == "__main__":
    main()
