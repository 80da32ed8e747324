"""Hats: the pieces that a law left free in the equations is made of, each a change of the setting like an effect's.

They never stand in the catalogue. What fits them: free_law.py; equations: docs/free-law.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

from ...effects import Effect, Normal, Parameter
from ...effects.contract import ChangeSetting
from ...effects.terms import Knots, add_table
from ...inference.fits.fitting import Fit
from ...inference.observations.compacted_zone import CompactedZones
from ...inference.observations.tracks import Tracks
from ...inference.workbench import Workbench
from ...records import Campaign
from ...sph import DropSetting

PRESSURE = 400.0  # Pa, what stops a drop of 0.65 m/s by the published 625 Pa s/m: the unit of the forces
MASS = 0.3  # of the projectile's mass, that sticks to it: the unit
STEP = 0.3  # of a hat when it is simulated
FALLING = 1.05  # of the impact speed, more than any drop gains by its weight in the dust
COMPACTION = (
    0.0,
    0.03,
    0.07,
    0.13,
)  # above φ0: half of what a tip compacts ends below 0.03, nine tenths below 0.07
DEPTHS = (0.0, 0.5, 1.0, 2.0, 4.0)  # tip radii
# tip radii, enough for the terms; a mass that goes up and down again would be any force of depth
MASS_DEPTHS = (0.0, 1.0, 4.0)
SPEEDS = (0.1, 0.3, 0.6, 1.2)  # m/s; nought at rest: a force that does not change with speed is one of depth


@dataclass(frozen=True)
class FreeLaw:
    """One place in the equations. grid : all knots; knots : those that hats stand at, the law is nought at the others; unit : of
    the knots; reach : between what of them the data speak; scale : of a coefficient, in value_unit."""

    name: str
    over: str
    unit: str
    grid: tuple[float, ...]
    knots: tuple[float, ...]
    reach: tuple[float, float]
    value_unit: str
    scale: float

    def hat(self, k: int) -> str:
        return f"{self.name} at {self.knots[k]:g}"

    @property
    def hats(self) -> tuple[str, ...]:
        return tuple(self.hat(k) for k in range(len(self.knots)))


def list_laws(bench: Workbench, fit: Fit) -> tuple[FreeLaw, ...]:
    """The four laws with the hats that these drops and scans reach."""
    deepest, fastest = 0.0, 0.0
    for observation, nuisances in zip(bench.observations, fit.nuisances, strict=True):
        if isinstance(observation, Tracks):
            instants = observation.instants(nuisances)
            fastest = max([fastest, *(math.exp(instant.log_speed) for instant in instants)])
            depths = (model.deepest / model.radius for model in observation.models)
            deepest = max([deepest, *depths])
        elif isinstance(observation, CompactedZones):
            observed = [zone.observed for zone in observation.zones]
            deepest = max([deepest, *(each.reduced.map.tip_depth / each.radius for each in observed)])
            fastest = max(fastest, math.exp(float(nuisances.max())))
    material, level = bench.campaign.material, bench.campaign.sample.filling_factor
    dust = tuple(round(level + more, 6) for more in COMPACTION if level + more < material.phi_2)
    at_rest = (0.0, *SPEEDS)
    return (
        FreeLaw("strength of filling factor", "filling factor", "1", dust, dust, (dust[0], dust[-1]), "1", 1.0),
        FreeLaw(
            "force of depth", "depth", "tip radii", DEPTHS, _reached(DEPTHS, deepest), (0.0, deepest), "Pa", PRESSURE
        ),
        FreeLaw(
            "force of speed", "speed", "m/s", at_rest, _reached(at_rest, fastest)[1:], (0.0, fastest), "Pa", PRESSURE
        ),
        FreeLaw(
            "mass of depth", "depth", "tip radii", MASS_DEPTHS, _reached(MASS_DEPTHS, deepest)[1:], (0.0, deepest),
            "1", MASS,
        ),
    )  # fmt: skip


def _reached(knots: Sequence[float], most: float) -> tuple[float, ...]:
    """Those whose hats begin before ``most``."""
    return (knots[0], *(knot for before, knot in pairwise(knots) if before < most))


def make_hats(law: FreeLaw, deepest: Mapping[DropSetting, float] | None = None) -> dict[str, Effect]:
    """Every hat of a law as an effect with one amplitude, in the law's value_unit: null changes nothing, bit for bit.

    deepest : depth (m) of drops without a law; a force that such a drop does not meet leaves its setting, so no run is made.
    """
    hats = {}
    for name, knot in zip(law.hats, law.knots, strict=True):
        unit = tuple((place, 1.0 if place == knot else 0.0) for place in law.grid)
        step = STEP * law.scale
        lowest = -0.9 if law.over == "filling factor" else -1e5
        parameter = Parameter(
            "amplitude", law.value_unit, 0.0, (lowest, 1e5), Normal(0.0, law.scale), step, "of one hat"
        )
        hats[name] = Effect(
            name, name, "material", (parameter,), "", (), {}, Path(__file__), lambda campaign: "",
            _add(law, unit, knot, deepest or {}), None, partial(_give, (parameter,)),
        )  # fmt: skip
    return hats


def _add(law: FreeLaw, unit: Knots, knot: float, deepest: Mapping[DropSetting, float]) -> ChangeSetting:
    begins = max((place for place in law.grid if place < knot), default=-math.inf)

    def change(setting: DropSetting, values: Mapping[str, float], place: object) -> DropSetting:
        amplitude = values["amplitude"]
        if amplitude == 0.0:
            return setting
        reached = {
            "filling factor": math.inf,
            "depth": deepest.get(setting, math.inf) / setting.projectile.tip_radius,
            "speed": FALLING * setting.impact_speed,
        }
        if reached[law.over] <= begins:
            return setting
        null = 1.0 if law.over == "filling factor" else 0.0
        return add_table(setting, law.name, tuple((knot, null + amplitude * height) for knot, height in unit))

    return change


def _give(parameters: tuple[Parameter, ...], campaign: Campaign) -> tuple[Parameter, ...]:
    """The parameters of one hat, the same in every campaign."""
    return parameters
