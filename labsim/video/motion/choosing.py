"""Which motion a track shows: rest or rebound and the degree of its deceleration, and what the choice leaves open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...errors import MeasurementError
from ...records import FloatArray
from .outliers import OUTLIER, fit_without_outliers, follow_median, guess_spikes
from .segments import HIGHEST_DEGREE, Ending, Motion
from .variable_projection import fit_motion

AFTER_END = 3  # frames used beyond the end of the deceleration
LEAST_STRIDE = 4  # frames over which a speed is guessed
ODDS = {  # of an ending, beside rest and rebound, before the rows are looked at
    "ease": 0.05,  # a push that has faded to nothing at the stop: dust has strength
    "bounce": 0.05,  # thrown back by more than the push at the stop: something else than dust
}
LEAST_WEIGHT = 1e-3  # of the best model's: below, a model is forgotten
FAR = 80.0  # -2 ln(evidence) behind the best at its degree: of 70 tracks no ending came back from 30
PULL = 1.0  # of the mean deceleration: dust does not pull a projectile in, but a polynomial rings a little at contact
NOISE_KNOWN = 20.0  # frames that the stated error bars are worth when the noise level is judged


@dataclass(frozen=True)
class Candidate:
    """A fitted motion and the frames it stands on, (n,) bool of those offered."""

    motion: Motion
    used: np.ndarray
    chi_square: float  # with OUTLIER² for each frame left out

    def judge(self, noise: float) -> float:
        """Schwarz's criterion, -2 ln(evidence), for a noise level of ``noise`` times the error bars, squared."""
        odds = -2.0 * np.log(ODDS.get(self.motion.ending, 1.0))
        return self.chi_square / noise + np.log(len(self.used)) * len(self.motion.parameters) + odds


@dataclass(frozen=True)
class Choice:
    """Models that explain the rows, best first, and their weights, which add up to one."""

    candidates: tuple[Candidate, ...]
    weights: FloatArray
    goes_on: bool  # whether frames follow the greatest depth

    @property
    def best(self) -> Candidate:
        return self.candidates[0]

    def propagate(
        self, quantity: Callable[[Motion, FloatArray], FloatArray | float], growth: float
    ) -> tuple[FloatArray, FloatArray]:
        """Mean over the models and its standard uncertainty: theirs, times √growth, and what they disagree.

        ``quantity`` (motion, parameters) gives a number or an array; a model without it is left out.
        """
        values, variances, weights = [], [], []
        for candidate, weight in zip(self.candidates, self.weights, strict=True):
            motion = candidate.motion
            value, sigma = motion.propagate(partial(quantity, motion))
            if np.all(np.isfinite(value)):
                values.append(value)
                variances.append(growth * sigma**2)
                weights.append(weight)
        if not values:
            return np.full(1, np.nan)[0], np.full(1, np.nan)[0]
        share = np.array(weights) / np.sum(weights)
        mean = np.tensordot(share, np.array(values), 1)
        variance = np.tensordot(share, np.array(variances) + (np.array(values) - mean) ** 2, 1)
        return mean, np.sqrt(variance)


def guess_ends(time: FloatArray, depth: FloatArray, name: object) -> tuple[float, float]:
    """Rough contact (first crossing of the surface) and rough stop (first time near the greatest depth)."""
    depth = follow_median(depth)
    below = np.flatnonzero(depth > 0)
    i = int(below[0])
    if i == 0:
        if depth[0] > 0.2 * np.max(depth):
            raise MeasurementError(
                name, "tip_row_px", "starts below the surface; the free flight before contact is needed"
            )
        t0 = float(time[0])
    else:
        t0 = float(np.interp(0.0, depth[i - 1 : i + 1], time[i - 1 : i + 1]))
    return t0, _guess_stop(time, depth, i, t0)


def _guess_stop(time: FloatArray, depth: FloatArray, contact: int, t0: float) -> float:
    """First time after contact at which the projectile goes on by less than 3 % of its free fall, or than noise hides."""
    spacing = float(np.median(np.diff(time)))
    noise = 1.4826 * float(np.median(np.abs(np.diff(depth, 3)))) / np.sqrt(20.0)
    fall = slice(max(contact - 50, 0), max(contact, 3))
    fast = (
        float(np.median(np.diff(depth[fall])) / spacing)
        if contact < 8
        else float(np.polyfit(time[fall], depth[fall], 1)[0])
    )
    stride = int(
        np.clip(
            30.0 * noise / max(fast * spacing, 1e-300), LEAST_STRIDE, max(len(time) // 40, 2 * LEAST_STRIDE)
        )
    )
    pace = (depth[stride:] - depth[:-stride]) / (time[stride:] - time[:-stride])
    slow = max(0.03 * fast, 2.0 * noise / (stride * spacing))
    still = pace < slow
    rests = np.flatnonzero(still[contact:] & np.append(still[contact + 1 :], True))
    if rests.size == 0:
        return float(time[-1])
    return max(float(time[contact + rests[0]]) + 0.5 * spacing, t0 + 3 * spacing)


def choose_motion(
    time: FloatArray,
    depth: FloatArray,
    error: FloatArray,
    start: tuple[float, float],
    endings: tuple[Ending, ...] = ("rebound", "bounce", "rest", "ease"),
) -> Choice | None:
    """Every model that explains the rows, weighed by Schwarz's criterion (Kass & Raftery 1995); None if none does.

    The ``endings`` of all degrees; if nothing stops, an open end. Every frame left out costs a model OUTLIER² of χ², so that
    models with different outliers can be compared.
    """
    stops = time[-1] > start[1] + 2.5 * float(np.median(np.diff(time)))
    first = ~guess_spikes(depth, error)
    found: list[Candidate] = []
    best: Candidate | None = None
    for ending in endings if stops else ("open",):
        lead: Candidate | None = None
        for degree in range({"ease": 1, "open": 1}.get(ending, 0), HIGHEST_DEGREE + 1):
            if lead is None:
                begin = _find_start(time[first], depth[first], error[first], degree, ending, start)
            else:
                begin = tuple(lead.motion.ends)
            here: Candidate | None = None
            # a poor model leaves out frames that a better one explains: begin again from the first guess too
            begins = [first] if lead is None or np.array_equal(lead.used, first) else [lead.used, first]
            for used in begins:
                fitted = fit_without_outliers(time, depth, error, degree, ending, begin, used)
                if fitted is None or (stops and not _is_sound(fitted[0], time[fitted[1]])):
                    continue
                candidate = _weigh_outliers(*fitted, time)
                if here is None or candidate.judge(1.0) < here.judge(1.0):
                    here = candidate
            if here is None:
                continue
            found.append(here)
            if lead is None or here.judge(1.0) < lead.judge(1.0):
                lead = here
            if best is None or here.judge(1.0) < best.judge(1.0):
                best = here
            behind = here.judge(1.0) - best.judge(1.0)
            if degree > lead.motion.degree + 2 or (degree >= best.motion.degree and behind > FAR):
                break
    if best is None:
        return None
    noise = (best.motion.chi_square + NOISE_KNOWN) / (best.motion.freedom + NOISE_KNOWN)
    found.sort(key=lambda candidate: candidate.judge(noise))
    criteria = np.array([candidate.judge(noise) for candidate in found])
    weights = np.exp(-0.5 * (criteria - criteria[0]))
    kept = weights > LEAST_WEIGHT
    return Choice(
        tuple(each for each, keep in zip(found, kept, strict=True) if keep),
        weights[kept] / weights[kept].sum(),
        stops,
    )


def _find_start(
    time: FloatArray,
    depth: FloatArray,
    error: FloatArray,
    degree: int,
    ending: Ending,
    start: tuple[float, float],
) -> tuple[float, ...]:
    """Of several first guesses, the ends that explain the frames best."""
    fits = [fit_motion(time, depth, error, degree, ending, each) for each in _guess_starts(start, ending)]
    found = [fit for fit in fits if fit is not None]
    return tuple(min(found, key=lambda fit: fit.chi_square).ends) if found else start


def _guess_starts(start: tuple[float, float], ending: Ending) -> list[tuple[float, ...]]:
    """Ends to begin from: a later end, or of a rebound more time to unload, than the first guess."""
    t0, te = start
    if ending == "rebound":
        return [(t0, te, share * (te - t0)) for share in (0.02, 0.1, 0.4)]
    return [(t0, t0 + factor * (te - t0)) for factor in (1.0, 1.2, 1.5)]


def _weigh_outliers(motion: Motion, used: np.ndarray, time: FloatArray) -> Candidate:
    """OUTLIER² for each frame left out, and for each that is wanting of AFTER_END beyond the end of the deceleration:

    where so few frames show rest or rebound, one spike can make them.
    """
    spread = max(1.0, motion.chi_square / max(motion.freedom, 1))
    beyond = int(np.sum(time[used] > motion.loose)) if motion.ending != "open" else AFTER_END
    many = int(np.sum(~used)) + max(AFTER_END - beyond, 0)
    return Candidate(motion, used, motion.chi_square + OUTLIER**2 * spread * many)


def _is_sound(motion: Motion, time: FloatArray) -> bool:
    """Whether a fitted motion is one of a projectile: stops inside the record, and does not turn back before its rest.

    At least one frame lies beyond the end of the deceleration.
    """
    stop = motion.find_stop()
    t0, te, v0 = motion.parameters[:3]
    if (
        not np.isfinite(stop)
        or motion.loose >= time[-1]
        or v0 <= 0
        or not np.all(np.isfinite(motion.covariance))
    ):
        return False
    _, speed, acceleration = motion.evaluate(t0 + np.linspace(0.0, 0.999, 200) * stop)
    if np.any(speed < -0.01 * v0) or np.any(speed > 1.1 * v0):
        return False
    free = motion.parameters[3]
    if np.any(acceleration > free + PULL * v0 / stop):
        return False
    error = np.sqrt(motion.covariance[1, 1])
    return bool(error < 0.5 * (te - t0) and np.all(np.diag(motion.covariance) >= 0))
