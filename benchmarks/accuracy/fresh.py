"""Draw a plan of campaigns that labsim has never been judged by: nothing hidden, listed causes, pairs, unlisted causes.

    python -m benchmarks.accuracy.fresh --seed 20261127 > fresh.toml
    python -m benchmarks.lagrangian_mesh.film_campaigns FOLDER --plan fresh.toml
    OMP_NUM_THREADS=1 python -m benchmarks.accuracy.blind FOLDER --rows fresh.jsonl
    python -m benchmarks.accuracy.count_verdicts fresh.jsonl

The seed is drawn after the code that is judged is frozen. p_m is even in its logarithm from 700 to 2500 Pa, the scatter of p_m
between samples from 1 to 10 %; half of the campaigns have two scans. A listed cause is as large as its prior says, without the
half of the prior that is nearest to nothing. Sizes of unlisted causes are in KINDS. Campaigns stand in random order.

More of some listed causes, all with scans:

    python -m benchmarks.accuracy.fresh --seed 20261130 --nulls 0 --listed 20 --pairs 0 --unlisted 0 \\
        --only bulk_modulus,shear_strength --scans
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import cycle

import numpy as np

from benchmarks.campaigns.labelled import format_toml
from benchmarks.campaigns.scan import VOXEL
from labsim.effects import Effect, list_effects

P_M, SCATTER, NOISE_SLOPE = (700.0, 2500.0), (0.01, 0.10), 0.5
OUTER = 0.5  # of a prior, that a cause is drawn from
# effect -> table and key of a plan
LISTED = {
    "shear_strength": ("dust", "shear_factor"),
    "tensile_strength": ("dust", "tensile_factor"),
    "strength_slope": ("dust", "delta"),
    "bulk_modulus": ("dust", "bulk_modulus"),
    "strength_rate": ("dust", "eta"),
    "pore_gas": ("dust", "gas_pressure"),
    "surface_crust": ("dust", "crust"),
    "density_gradient": ("dust", "gradient"),
    "filling_factor": ("dust", "filling_factor"),
    "strength_ceiling": ("dust", "phi_2"),
    "side_friction": ("body", "side"),
    "sample_drift": ("", "drift"),
    "projectile_mass": ("measure", "mass"),
    "pixel_scale": ("measure", "pixel"),
    "frame_rate": ("measure", "frame"),
    "surface_row": ("measure", "surface_row"),
    "ct_scale": ("ct", "scale"),
    "ct_blur": ("ct", "blur_mm"),
}
NEED_SCANS = ("ct_scale", "ct_blur")
SOFTEST = -0.025  # of φ in a crust: dust has no strength at φ1
WEAKEST, MOST_GAS = 0.25, 8e3  # of a strength or a slope, Pa: what the mesh still follows

Draw = Callable[[np.random.Generator], dict]


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Even in the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def either(rng: np.random.Generator, low: float, high: float) -> float:
    """The same, or one over it."""
    return between(rng, low, high) ** rng.choice([-1.0, 1.0])


# in no catalogue: what is hidden, for a tip of 0.5 mm, which some 0.7 mN stop
KINDS: dict[str, Draw] = {
    "drag of the tip with the square of the speed": lambda g: {"body": {"inertial": between(g, 2e-4, 8e-4)}},
    "drag of the tip with the speed": lambda g: {"body": {"viscous": between(g, 1.3e-4, 5e-4)}},
    "drag of the shaft with the square of the speed": lambda g: {
        "body": {"shaft_drag": between(g, 1.0, 5.0)}
    },
    "a pull upwards": lambda g: {"body": {"pull": between(g, 5e-5, 2e-4)}},
    "a film": lambda g: {"body": {"film": [between(g, 1e-4, 3e-4), between(g, 1e-4, 3e-4)]}},
    "mass gathered with depth": lambda g: {"body": {"gathered": between(g, 0.1, 0.5)}},
    "a thin strong or weak layer": lambda g: {
        "dust": {"interface": [between(g, 1.5e-4, 4e-4), between(g, 1e-4, 2e-4), either(g, 2.0, 5.0)]}
    },
    "layers of the filling factor": lambda g: {
        "dust": {"layers": [between(g, 0.005, 0.015), between(g, 0.3e-3, 1e-3)]}
    },
    "p_m by size": lambda g: {"small_strength": either(g, 1.15, 1.4)},
    "shear weakens": lambda g: {
        "dust": {"weakening": between(g, 0.2, 0.6), "weakening_shear": between(g, 0.1, 0.4)}
    },
    "shear hardens": lambda g: {"dust": {"hardening": between(g, 1.0, 5.0)}},
    "a camera that wobbles": lambda g: {
        "measure": {"wobble": [between(g, 0.4, 1.6), between(g, 150.0, 600.0)]}
    },
    "rows that are read one after another": lambda g: {"measure": {"line_time": between(g, 2e-6, 1e-5)}},
    "a clock that drifts": lambda g: {
        "measure": {"clock_drift": between(g, 0.05, 0.15) * float(g.choice([-1.0, 1.0]))}
    },
    "dust that creeps": lambda g: {"dust": {"creep": [between(g, 0.1, 0.3), between(g, 3e-4, 1e-3)]}},
}


def draw_listed(effect: Effect, rng: np.random.Generator) -> dict:
    """Keys of a plan that hide a listed cause."""
    name = effect.name
    parameter = effect.amplitudes[0]
    while True:
        share = rng.uniform()
        if parameter.prior.cdf(parameter.null) < 0.01:  # to one side alone
            share = OUTER + (1.0 - OUTER) * share
        else:
            share = share * (1.0 - OUTER) if share < 0.5 else OUTER + (1.0 - OUTER) * share
        value = float(parameter.prior.ppf(share))
        inside = parameter.limits[0] <= value <= parameter.limits[1]
        if name in ("shear_strength", "tensile_strength", "strength_slope"):
            inside &= value > WEAKEST
        if name == "pore_gas":
            inside &= value < MOST_GAS
        if name == "surface_crust":
            inside &= value > SOFTEST
        if inside:
            break
    table, key = LISTED[name]
    if name == "ct_blur":
        value = 1e3 * (VOXEL + value)
    keys: dict = {key: value}
    shapes = [each for each in effect.parameters if each.shape]
    if shapes:
        (shape,) = shapes
        drawn = float(np.clip(shape.prior.sample(rng), *shape.limits))
        keys = {key: [value, drawn]} if name == "surface_crust" else {key: value, "rate_n": drawn}
    return {table: keys} if table else keys


def join(one: dict, other: dict) -> dict:
    """Keys of two causes in one campaign."""
    both = dict(one)
    for key, value in other.items():
        both[key] = {**both[key], **value} if isinstance(both.get(key), dict) else value
    return both


def draw_plan(
    seed: int,
    *,
    nulls: int,
    listed: int,
    pairs: int,
    unlisted: int,
    letter: str = "n",
    only: Sequence[str] = tuple(LISTED),
    scans: bool = False,
    kinds: int = len(KINDS),
) -> list[dict]:
    """What is hidden in each campaign, with all that a plan says of it. only : listed causes that are dealt; scans : all have;
    kinds : the first of KINDS that are dealt, 14 for seeds of 2026."""
    rng, effects = np.random.default_rng(seed), list_effects(None)

    def deal(names: list[str], count: int) -> list[str]:
        """Each as often as the others, in random order."""
        order = cycle(rng.permutation(names))
        return [str(next(order)) for _ in range(count)]

    causes: list[dict] = [{"cause": "none"} for _ in range(nulls)]
    for name in deal(list(only), listed):
        causes.append({"cause": name, **draw_listed(effects[name], rng)})
    for _ in range(pairs):
        pair = sorted(map(str, rng.choice(list(LISTED), 2, replace=False)))
        causes.append(
            {"cause": " + ".join(pair), **join(*(draw_listed(effects[name], rng) for name in pair))}
        )
    for kind in deal(list(KINDS)[:kinds], unlisted):
        causes.append({"cause": "unknown", "note": kind, **KINDS[kind](rng)})
    plan = []
    for k, each in enumerate(causes[i] for i in rng.permutation(len(causes))):
        drawn = {
            "pm": round(between(rng, *P_M), -1),
            "seed": int(rng.integers(2**31)),
            "scatter": between(rng, *SCATTER),
            "noise_slope": float(rng.uniform(-NOISE_SLOPE, NOISE_SLOPE)),
            "scans": bool(rng.uniform() < 0.5) or scans or any(name in each["cause"] for name in NEED_SCANS),
        }
        plan.append({"name": f"{letter}{k + 1:03d}", **each, **drawn})
    return plan


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, required=True)
    for kind, count in (("nulls", 30), ("listed", 36), ("pairs", 8), ("unlisted", 28)):
        parser.add_argument(f"--{kind}", type=int, default=count)
    parser.add_argument("--letter", default="n")
    parser.add_argument("--only", type=lambda names: names.split(","), default=list(LISTED))
    parser.add_argument("--scans", action="store_true", help="all campaigns have two")
    parser.add_argument(
        "--kinds", type=int, default=len(KINDS), help="the first that are dealt, 14 for seeds of 2026"
    )
    asked = parser.parse_args()
    print(f"# benchmarks/accuracy/fresh.py --seed {asked.seed}")
    for each in draw_plan(**vars(asked)):
        print("\n[[campaign]]")
        print("\n".join(f"{key} = {format_toml(value)}" for key, value in each.items()))


if __name__ == "__main__":
    main()
