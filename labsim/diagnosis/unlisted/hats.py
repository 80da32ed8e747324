"""Hats and terms as effects: a hat is a piece of a law left free in the equations, a term a formula in its place.

They never stand in the catalogue. What fits them: free_law.py, learned_law.py; equations: docs/free-law.md, docs/learned-law.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...effects import Cauchy, Effect, Instrument, Normal, Parameter, Place
from ...effects.contract import ChangeSetting
from ...effects.law_places import LAW_PLACES, Knots, LawPlace
from ...effects.terms import Term, add_term, list_terms, see_term
from ...errors import ExtrapolationError
from ...inference.fits.fitting import Fit, fit_hypothesis
from ...inference.observations.compacted_zone import CompactedZones
from ...inference.observations.drop_model import DropModel
from ...inference.observations.tracks import Tracks
from ...inference.problem import Problem
from ...records import Campaign, FloatArray
from ...sph import DropSetting

STEP = 0.3  # of a hat when it is simulated
USUAL = 0.4  # of a law's scale: half of the coefficients are within that, where their terms are largest
FALLING = 1.05  # of the impact speed, more than any drop gains by its weight in the dust
BEFORE = 3.0  # tip radii below the tip, from which on it is not felt
THIN = 0.15  # of the smallest tip's radius: thinner layers are lost between particles


@dataclass(frozen=True)
class FreeLaw:
    """A law at one place in the equations. grid : all knots; knots : those that hats stand at, the law is nought at the others;
    reach : between what of them the data speak."""

    place: LawPlace
    grid: tuple[float, ...]
    knots: tuple[float, ...]
    reach: tuple[float, float]

    @property
    def name(self) -> str:
        return self.place.name

    @property
    def over(self) -> str:
        return self.place.over

    @property
    def scale(self) -> float:
        return self.place.scale

    def hat(self, k: int) -> str:
        return f"{self.name} at {self.knots[k]:g}"

    @property
    def hats(self) -> tuple[str, ...]:
        return tuple(self.hat(k) for k in range(len(self.knots)))


def list_laws(problem: Problem, fit: Fit) -> tuple[FreeLaw, ...]:
    """The laws that are simulated, with the hats that these drops and scans reach."""
    deepest, deepest_mm, fastest, longest = 0.0, 0.0, 0.0, 0.0
    for observation, nuisances in zip(problem.observations, fit.nuisances, strict=True):
        if isinstance(observation, Tracks):
            instants = observation.instants(nuisances)
            speeds = [math.exp(instant.log_speed) for instant in instants]
            fastest = max([fastest, *speeds])
            # ms, slowed evenly
            stops = [2e3 * model.deepest / v for model, v in zip(observation.models, speeds, strict=True)]
            longest = max([longest, *stops])
            deepest = max([deepest, *(model.deepest / model.radius for model in observation.models)])
            deepest_mm = max([deepest_mm, *(1e3 * model.deepest for model in observation.models)])
        elif isinstance(observation, CompactedZones):
            observed = [zone.observed for zone in observation.zones]
            deepest = max([deepest, *(each.map.tip_depth / each.radius for each in observed)])
            deepest_mm = max([deepest_mm, *(1e3 * each.map.tip_depth for each in observed)])
            fastest = max(fastest, math.exp(float(nuisances.max())))
            longest = max(longest, 2.0 * deepest_mm / fastest)
    radii, laws = _list_radii(problem), []
    for place in LAW_PLACES.values():
        if place.over == "filling factor":
            level, most = problem.campaign.sample.filling_factor, problem.campaign.material.phi_2
            dust = tuple(round(level + more, 6) for more in place.knots if level + more < most)
            laws.append(FreeLaw(place, dust, dust, (dust[0], dust[-1])))
        elif place.simulated and place.unit == "mm":
            if place.value_unit in ("mN", "N/m") and radii.size == 1:
                continue  # no other than a pressure, where all tips are alike
            depths = [float(f"{share * deepest_mm:.3g}") for share in place.knots]
            grid = tuple(depth for depth in depths if depth == 0.0 or depth >= THIN * radii[0])
            laws.append(FreeLaw(place, grid, grid, (0.0, deepest_mm)))
        elif place.simulated:
            # beyond its reach a law is constant, and limits of terms are those up to there
            most = {"tip radii": deepest, "m/s": fastest, "ms": longest}.get(place.unit, place.reach)
            most = min(most, place.reach)
            # nought where nothing has moved: a force that does not change with speed is one of depth, a strength that does not
            # with strain is p_m
            reached = _reached(place.knots, most)[int(place.least > -math.inf) :]
            laws.append(FreeLaw(place, place.knots, reached, (0.0, most)))
    return tuple(laws)


def _list_radii(problem: Problem) -> FloatArray:
    """Of all tips, mm, rising."""
    return np.unique([1e3 * group.projectile.tip_radius for group in problem.groups])


def _reached(knots: Sequence[float], most: float) -> tuple[float, ...]:
    """Those whose hats begin before ``most``."""
    return (knots[0], *(knot for before, knot in pairwise(knots) if before < most))


def make_hats(law: FreeLaw, deepest: Mapping[DropSetting, float] | None = None) -> dict[str, Effect]:
    """Every hat of a law as an effect with one amplitude, in the unit of its values: null changes nothing, bit for bit.

    deepest : depth (m) of drops without a law; a force that such a drop does not meet leaves its setting, so no run is made.
    """
    hats = {}
    for name, knot in zip(law.hats, law.knots, strict=True):
        unit = tuple((place, 1.0 if place == knot else 0.0) for place in law.grid)
        step = STEP * law.scale
        # a force along the motion is for the fit to ask for; a strength that is left is for the simulation
        lowest = law.place.least if -math.inf < law.place.least < 0.0 else -1e5
        unit_name, prior = law.place.value_unit, Normal(0.0, law.scale)
        parameter = Parameter("amplitude", unit_name, 0.0, (lowest, 1e5), prior, step, "of one hat")
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
        depth, radius = deepest.get(setting, math.inf), setting.projectile.tip_radius
        if law.over != "depth":  # dust is crushed before the tip is there
            depth += BEFORE * radius
        reached = {"tip radii": depth / radius, "mm": 1e3 * depth, "m/s": FALLING * setting.impact_speed}
        if reached.get(law.place.unit, math.inf) <= begins:
            return setting
        assert law.place.add is not None
        return law.place.add(setting, tuple((knot, amplitude * height) for knot, height in unit))

    return change


def add_terms(
    problem: Problem, laws: Sequence[FreeLaw] = ()
) -> tuple[Problem, dict[str, Term], dict[str, float]]:
    """The problem with all terms that may be at work here among its effects; these; and of each the coefficient that changes as
    much as the law's scale where it is largest.

    laws : whose hats have runs; without any, the terms that need none. Not those that a cause of that name stands for, or which
    the data do not reach.
    """
    places = {law.name: law for law in laws if law.knots}
    radii = _list_radii(problem)
    terms, units = {}, {}
    for name, term in list_terms().items():
        if name in problem.effects:
            continue
        if term.place in places:
            largest = find_peak(term, places[term.place])
            if term.at is not None and not THIN * radii[0] <= term.at <= places[term.place].reach[1]:
                continue
        elif term.acts.over == "radius of the tip" and radii.size > 1:
            largest = 0.5 * float(np.ptp(term.shape(radii)))  # what all tips have in common is p_m
        elif term.acts.see and any(isinstance(model, DropModel) for model in problem.tracks.models):
            largest = 1.0
        else:
            continue
        if largest > 0.0 and term.limits[0] < term.limits[1]:
            terms[name], units[name] = term, term.acts.scale / largest
    effects = {name: make_effect(term, units[name]) for name, term in terms.items()}
    return replace(problem, effects={**problem.effects, **effects}), terms, units


def find_peak(term: Term, law: FreeLaw) -> float:
    """The largest value of a term's shape between what the data reach, which may lie between knots or before the last."""
    return float(np.max(np.abs(shape_at(term, law, term.sample(*law.reach)))))


def fit_without_runs(problem: Problem, nominal: Fit) -> dict[str, Fit]:
    """Every term that costs no runs, fitted: of the strength by the tip's radius, of the camera's clock. One whose fit leaves the
    range of the runs is left out."""
    free, terms, _ = add_terms(problem)
    fits = {}
    for name in terms:
        with suppress(ExtrapolationError):
            fits[name] = fit_hypothesis(free, (name,), (nominal.log_p_m, {}), nuisances=nominal)
    return fits


def shape_at(term: Term, law: FreeLaw, places: FloatArray) -> FloatArray:
    """A term at places of a law; it takes compaction where the law goes with the filling factor."""
    return term.shape(places - law.grid[0] if law.over == "filling factor" else places)


def make_effect(term: Term, unit: float) -> Effect:
    """A term as an effect of one campaign. unit : coefficient that changes as much as the free law's unit where it is largest."""
    low, high = (min(max(limit, -1e9), 1e9) for limit in term.limits)
    parameter = Parameter(
        "coefficient", term.unit, 0.0, (low, high), Cauchy(0.0, USUAL * unit), STEP * unit, "of the free law's unit",
        # a strength that is left, not one that is more, is what can be many times another
        doubles=unit if -1.0 < term.acts.least < 0.0 else math.inf,
    )  # fmt: skip

    def change(setting: DropSetting, values: Mapping[str, float], place: object) -> DropSetting:
        return add_term(setting, term, values["coefficient"])

    def see(instrument: Instrument, values: Mapping[str, float], place: Place) -> Instrument:
        return see_term(instrument, term, values["coefficient"], place)

    of_camera = term.acts.see is not None
    return Effect(
        term.name, term.title, "measurement" if of_camera else "material", (parameter,), "", (term.source,), {},
        Path(__file__), lambda campaign: "", None if of_camera else change, see if of_camera else None,
        partial(_give, (parameter,)),
    )  # fmt: skip


def _give(parameters: tuple[Parameter, ...], campaign: Campaign) -> tuple[Parameter, ...]:
    """The parameters of one hat or term, the same in every campaign."""
    return parameters
