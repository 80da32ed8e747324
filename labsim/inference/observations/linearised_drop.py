"""Everything the likelihood knows of one drop about one point: residual, errors of its own, what it shares with others."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist

from ...effects import Instrument
from ...records import STANDARD_GRAVITY, FloatArray
from ...sph import DropSetting
from ..emulation.forward import Instant
from .acceleration_model import AccelerationModel
from .drop_model import ALONG, FREE, REACH, SPEED_WIDTH, DropModel
from .push_model import PushModel

RecordModel = DropModel | AccelerationModel | PushModel  # of what one instrument records of one drop or push
SPEED_SLACK = 0.002  # of the speed, beside the stated error of the height (guide, release)
USUAL_DEPTH = 0.5  # ln of depth over tip radius, where p_m makes up for all of the solver's error
# d ln p_m that mimics d ln m, d ln a: D and T_s go alike, as m^0.5 to m^0.6, a^-0.4 to a^-0.8, p_m^-0.3. The ratios are 1.7 to
# 2.0 and 1.6 to 2.7, more the deeper the drop, in labsim and on a mesh (tests/inference/test_scatter.py)
MASS_TO_STRENGTH, RADIUS_TO_STRENGTH = 1.85, 2.1
LEAST_SCATTER = 1e-9
# ln of final depth over tip radius, of radius, of mass over its cube: so far two codes differ alike
ALIKE = (REACH, 2.0, 1.5)


@dataclass(frozen=True)
class ErrorBudget:
    """Sizes of the error terms; zero switches one off."""

    scatter: float = 0.02  # of ln p_m from sample to sample
    pixel_scale: float = 0.001  # relative, common to all drops of one camera setting, where nothing is stated
    frame_scale: float = 0.0002
    contact_offset: float = 0.015  # numerical offset of the contact, in tip radii, common to all drops
    numerical: float = 0.005  # of the depth, smooth
    numerical_change: float = 0.03  # of what an effect changes of a depth or of a push's resistance, smooth
    # of what an effect changes of the compaction: two codes differ by 14 % in what a shear factor of 0.6 adds under a bead
    zone_change: float = 0.15
    # of ln p_m, common to all drops: what another code asks for; and how much wider than that p_m is told, for codes that differ
    # by more (docs/error-budget.md)
    numerical_strength: float = 0.04
    other_codes: float = 0.045
    # of what a cause of the material changes ln p_m by: what another code asks for beside it
    change_of_strength: float = 0.4
    numerical_slope: float = 0.01  # of the depth, per e-fold of depth over tip radius, common to all drops
    heights: bool = True


class Perturbation(NamedTuple):
    """A neighbouring point. amplitudes : effect -> amplitude; instruments, log_offsets (of ln p_m) : by name of drop or scan;
    setting : (name of drop or scan) -> what would be simulated there, for those whose data need no run; step : by how much one
    global differs there."""

    amplitudes: Mapping[str, float]
    instruments: Mapping[str, Instrument]
    log_offsets: Mapping[str, float]
    setting: Callable[[str], DropSetting]
    step: float


@dataclass(frozen=True)
class NumericalError:
    """The solver's error of one drop. size : (n,) m; fraction : (n,) of the time to the stop; drops are alike by reach (ln of
    final depth over tip radius), radius and mass (logarithms). length : over which share of the stopping time, changes : over
    how many e-folds of depth over tip radius it changes."""

    size: Float[np.ndarray, " n"]
    fraction: Float[np.ndarray, " n"]
    reach: float
    radius: float
    mass: float
    unit: str = "m"
    length: float = ALONG
    changes: float = REACH


@dataclass(frozen=True)
class LinearisedDrop:
    """One drop about one point. residual, white (variance) : (n,); local : (n, nuisances) scaled by their prior widths;
    pull : (nuisances,) current nuisances over prior widths; tangents : name -> (n,); shared : name -> (n,), errors with one
    value for several drops; scatter : prior width of its own ln p_m, the fourth nuisance, 0 where that is shared."""

    residual: Float[np.ndarray, " n"]
    white: Float[np.ndarray, " n"]
    local: Float[np.ndarray, "n k"]
    pull: Float[np.ndarray, " k"]
    tangents: Mapping[str, Float[np.ndarray, " n"]]
    shared: Mapping[str, Float[np.ndarray, " n"]]
    numerical: NumericalError
    scatter: float


def measure_distances(drops: Sequence[tuple[float, float, float]]) -> FloatArray:
    """Squared distances (k, k) of drops, by which the solver errs alike in them: it does to exp(-½) at one.

    drops : ln of final depth over tip radius, ln radius, ln of mass over radius cubed, of each.
    """
    return np.asarray(cdist(np.array(drops), np.array(drops), "seuclidean", V=np.square(ALIKE)) ** 2)


def linearise_drop(
    model: RecordModel,
    instant: Instant,
    log_p_m: float,
    nominal: Perturbation,
    budget: ErrorBudget,
    perturbations: Mapping[str, Perturbation],
    *,
    with_others: bool = False,
) -> LinearisedDrop:
    """Residual, errors and tangents of one drop; instant : its nuisances; nominal : the point itself (its step means nothing);
    with_others : other records are of the same drop, and have the strength of its dust in common with it."""
    observed = model.observed
    name, n = observed.name, model.data.size
    instrument = nominal.instruments[name]
    lp = log_p_m + nominal.log_offsets.get(name, 0.0) + instant.strength
    response = model.table.at(lp, instant.log_speed)
    features = response.features(nominal.amplitudes)
    here = model.predict(features, instrument, instant)
    by_contact = model.by_contact(features, instrument, instant)
    faster = instant._replace(log_speed=instant.log_speed + 1e-3)
    fast_features = model.table.features(lp, faster.log_speed, nominal.amplitudes)
    by_speed = (model.predict(fast_features, instrument, faster) - here) / 1e-3
    strong_features = model.table.features(lp + 1e-2, instant.log_speed, nominal.amplitudes)
    by_strength = (model.predict(strong_features, instrument, instant) - here) / 1e-2

    tangents = {"ln_p_m": by_strength}
    for perturbation, point in perturbations.items():
        there = log_p_m + point.log_offsets.get(name, 0.0) + instant.strength
        at = response if there == lp else model.table.at(there, instant.log_speed)
        moved = at.features(point.amplitudes)
        if np.array_equal(moved, features) and point.instruments[name] == instrument:
            tangents[perturbation] = np.zeros(n)
        else:
            tangents[perturbation] = (
                model.predict(moved, point.instruments[name], instant) - here
            ) / point.step

    body = observed.drop.projectile
    scatter = max(budget.scatter, LEAST_SCATTER)
    own_errors, own_strength = model.own_errors, by_strength * scatter
    columns = [by_contact * FREE, by_speed * SPEED_WIDTH, own_errors[:, 0]]
    if not with_others:
        columns.append(own_strength)
    final, stop = np.exp(features[0]), np.exp(features[1])
    local = np.column_stack([*columns, own_errors[:, 1:]])
    pull = np.zeros(local.shape[1])
    pull[2] = instant.surface / model.surface_sigma
    if not with_others:
        pull[3] = instant.strength / scatter

    def differ(factor: str) -> FloatArray:
        changed = instrument.replace(**{factor: getattr(instrument, factor) * 1.001})
        return (model.predict(features, changed, instant) - here) / 1e-3

    # two codes part slowly from shallow to deep drops: the one is too deep at one end, too shallow at the other. Depth counts in
    # tip radii, thus in spacings: with it, drops of all sizes, speeds and hidden effects lie on one curve, with speed they do not
    reach = float(features[0]) - math.log(model.radius)
    clock = model.mean_time(instrument) - instant.contact_time
    shared = {
        **model.share(here, differ, (budget.pixel_scale, budget.frame_scale, budget.contact_offset)),
        "numerical slope": model.slope(features, instrument, instant, here)
        * (reach - USUAL_DEPTH)
        * budget.numerical_slope,
        "numerical strength": by_strength * budget.numerical_strength,
    }
    if body.mass_sigma > 0.0:  # it was weighed once
        shared[f"mass of {body}"] = by_strength * MASS_TO_STRENGTH * body.mass_sigma / body.mass
    if body.radius_sigma > 0.0:  # and measured once
        shared[f"radius of {body}"] = by_strength * RADIUS_TO_STRENGTH * body.radius_sigma / body.tip_radius
    for setting, (amplitude, sigma) in model.numerics.items():
        if model.table.knows(setting):
            moved = model.predict(features + response.change(setting, amplitude), instrument, instant)
            shared[f"numerical {setting}"] = (moved - here) * (sigma / amplitude)
    if with_others:
        shared[f"strength of {observed.drop.sample}"] = own_strength

    off, length, changes = model.find_solver_error(here, clock, final, instrument, budget.numerical)
    if model.changes_differ and features is not response.plain:
        change = here - model.predict(response.plain, instrument, instant)
        off = np.hypot(off, budget.numerical_change * change)
    numerical = NumericalError(
        off,
        np.clip(clock / stop, 0.0, 1.0),
        reach,
        math.log(model.radius),
        math.log(body.mass / model.radius**3),
        model.unit,
        length,
        changes,
    )
    drop = LinearisedDrop(
        model.data - here,
        model.data_variance,
        local,
        pull,
        tangents,
        shared,
        numerical,
        0.0 if with_others else scatter,
    )
    if budget.heights:
        drop = _add_speeds(drop, instant.log_speed, list_speeds(model))
    # nuisances are zero-mean about their priors, not about here
    return replace(drop, residual=drop.residual + drop.local @ pull)


def list_speeds(model: RecordModel) -> list[tuple[float, float]]:
    """ln of the impact speed with its error, from each thing beside the motion in the dust that says it."""
    drop, found = model.observed.drop, []
    height = drop.height
    if height is not None and height.value > 0:
        # the logarithm of a height known to some ten percent is not normal; its mean is lower
        expected = (
            0.5 * math.log(2 * STANDARD_GRAVITY * height.value) - 0.25 * (height.sigma / height.value) ** 2
        )
        found.append((expected, math.hypot(0.5 * height.sigma / height.value, SPEED_SLACK)))
    stated = (drop.impact_speed,) if isinstance(model, DropModel) else model.observed.speeds
    for speed in stated:
        if speed is not None:
            found.append((math.log(speed.value), math.hypot(speed.sigma / speed.value, SPEED_SLACK)))
    return found


def _add_speeds(
    drop: LinearisedDrop, log_speed: float, stated: Sequence[tuple[float, float]]
) -> LinearisedDrop:
    """One more datum each: ln v with its error."""
    more = np.zeros(len(stated))
    local = np.zeros((len(stated), drop.local.shape[1]))
    local[:, 1] = SPEED_WIDTH

    def pad(values: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {name: np.concatenate((column, more)) for name, column in values.items()}

    numerical = drop.numerical
    return replace(
        drop,
        residual=np.concatenate((drop.residual, [expected - log_speed for expected, _ in stated])),
        white=np.concatenate((drop.white, [sigma**2 for _, sigma in stated])),
        local=np.concatenate((drop.local, local)),
        tangents=pad(drop.tangents),
        shared=pad(drop.shared),
        numerical=replace(
            numerical,
            size=np.concatenate((numerical.size, more)),
            fraction=np.concatenate((numerical.fraction, more)),
        ),
    )
