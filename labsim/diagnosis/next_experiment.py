"""Which further measurement would best tell the remaining causes apart: expected information, in bits.

Each hypothesis still standing predicts every candidate; candidates are drops of the groups at speeds on the grid, repeats
included. The expected information is bounded below by Kolchinsky & Tracey (2017), Entropy 19, 361, for Gaussians of equal
covariance: -Σ p_j ln Σ p_k exp(-D²_jk/8).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..calibrated import read_value
from ..inference.emulation.curves import FRACTIONS
from ..inference.fits.fitting import Fit
from ..inference.observations.observe import ObservedDrop
from ..inference.problem import Problem
from ..records import STANDARD_GRAVITY, FloatArray

USUAL_SIGMA = 2e-6  # m, of a camera where no drop had one
SEEN_BY_SPEED = (
    0.01  # of ln resistance, between the slowest and the fastest push: less is no cause that speed shows
)
DECIDED = 4.0  # standard deviations between two predictions that are told apart
WORTHWHILE = 0.01  # bits below which an experiment is not suggested
SMALLEST = 0.005  # probability below which a hypothesis is left out
POINTS = np.array([0.2, 0.4, 0.6, 0.8, 1.0])  # fractions of the stop that are compared


@dataclass(frozen=True)
class Suggestion:
    """change : what to do. tells : the causes that it is to tell apart, where it was made for two of them."""

    change: str
    information_bits: float
    tells: tuple[tuple[str, ...], tuple[str, ...]] | None = None

    @property
    def text(self) -> str:
        """What to do and what for."""
        return self.change + (
            f", to tell {' from '.join(' + '.join(names) for names in self.tells)}" if self.tells else ""
        )


def suggest(
    problem: Problem, fits: list[Fit], probabilities: dict[tuple[str, ...], float]
) -> list[Suggestion]:
    """Best first. fits: hypotheses with a prediction (the nominal one has the empty name)."""
    standing = [fit for fit in fits if probabilities.get(fit.hypothesis or ("none",), 0.0) > SMALLEST]
    found = [
        each
        for number, group in enumerate(problem.groups)
        if group.pushed
        for each in _suggest_pushes(problem, fits, probabilities, number)
    ]
    if len(standing) < 2:
        return found
    weight = np.array([probabilities[fit.hypothesis or ("none",)] for fit in standing])
    weight /= weight.sum()
    for number, group in enumerate(problem.groups):
        if group.is_scan or group.pushed:
            continue
        for speed in group.speeds[1:]:
            means = np.stack([_predict(problem, fit, number, speed) for fit in standing])
            spread = _spread(problem, standing, number, speed, means.mean(axis=0))
            bits = expected_information(means, spread, weight)
            p = group.projectile
            found.append(
                Suggestion(
                    f"one more drop with the {2e3 * p.tip_radius:.3g} mm tip of {p.mass * 1e6:.3g} mg at {speed:.2f} m/s "
                    f"(height {speed**2 / 2 / STANDARD_GRAVITY * 1e3:.1f} mm)",
                    round(bits, 3),
                )
            )
    worth = [each for each in found if each.information_bits >= WORTHWHILE]
    return sorted(worth, key=lambda each: -each.information_bits)[:5]


def _suggest_pushes(
    problem: Problem, fits: list[Fit], probabilities: dict[tuple[str, ...], float], number: int
) -> list[Suggestion]:
    """As many pushes at the slowest and at the fastest speed, near each other, as tell the first cause from the most
    probable other that speed shows by DECIDED standard deviations.

    What is calibrated and the profile of the ground fall out of the ratio of the two; the scatter of samples stays. A cause that
    was not fitted is taken as large as its prior expects.
    """
    pushes = sorted(
        (dict(drop.motion.values)["speed"], drop.name) for drop in problem.campaign.drops if drop.gauge
    )
    (slow, first), (fast, last) = pushes[0], pushes[-1]
    if slow == fast:
        return []
    fitted = {fit.hypothesis: fit.values for fit in fits}
    table, place = problem.tracks.features[number].table, next(iter(problem.places.values()))
    ratios, weights, names_of = [], [], []
    for hypothesis, probability in probabilities.items():
        if probability < SMALLEST or hypothesis == ("unknown",):
            continue
        names = () if hypothesis == ("none",) else hypothesis
        usual = {name: problem.effects[name].amplitudes[0].scale for name in names}
        own = fitted.get(names, usual)
        values = {name: own[name] if abs(own[name]) > 0.1 * usual[name] else usual[name] for name in names}
        ends = []
        for speed, push in ((slow, first), (fast, last)):
            state = problem.state(problem.groups[number], push)
            changed = state
            for name in names:
                if problem.rescales_p_m(name):
                    changed = problem.effects[name].apply(changed, problem.at(name, values[name]), place)
            shift = math.log(read_value(changed.material) / read_value(state.material))
            ends.append(table.features(fits[0].log_p_m + shift, math.log(speed), values)[0])
        ratios.append(ends[1] - ends[0])
        names_of.append(hypothesis)
        weights.append(probability)
    if not ratios:
        return []
    apart = np.abs(np.array(ratios) - ratios[int(np.argmax(weights))])
    likely = np.where(apart > SEEN_BY_SPEED, weights, 0.0)
    if not likely.any():
        return []
    rival = int(np.argmax(likely))
    count = max(1, math.ceil(2.0 * (DECIDED * problem.budget.scatter / apart[rival]) ** 2))
    best = int(np.argmax(weights))
    spread = np.array([[2.0 * problem.budget.scatter**2 / count]])
    bits = expected_information(np.array(ratios)[:, None], spread, np.array(weights) / sum(weights))
    return [
        Suggestion(
            f"{count} more push{'es' * (count > 1)} at {1e3 * slow:g} mm/s and as many at {1e3 * fast:g} mm/s, near each other",
            round(bits, 3),
            (names_of[best], names_of[rival]),
        )
    ]


def expected_information(means: FloatArray, spread: FloatArray, weight: FloatArray) -> float:
    """Bits that a measurement is expected to tell, from below.

    means : (hypotheses, values) predictions; spread : (values, values) covariance of the measurement; weight :
    (hypotheses,) probabilities. Source: Kolchinsky & Tracey (2017), as above.
    """
    difference = means[:, None, :] - means[None, :, :]
    distance = np.einsum("jki,il,jkl->jk", difference, np.linalg.inv(spread), difference)
    return -float(weight @ np.log(np.exp(-distance / 8) @ weight)) / math.log(2)


def _predict(problem: Problem, fit: Fit, number: int, speed: float, shift: float = 0.0) -> FloatArray:
    """Depths (m) on the stated scale at fractions of the stop that the fit itself predicts, and the stop (as a length, m).

    shift : of ln p_m from the fit's.
    """
    features = problem.tracks.features[number].table.features(
        fit.log_p_m + shift, math.log(speed), fit.values
    )
    instrument = next(iter(problem.instruments(fit.values).values()))
    depth, stop = math.exp(features[0]), math.exp(features[1])
    shape = np.interp(POINTS, FRACTIONS, features[2:])
    return np.append(depth * shape / instrument.pixel_factor, stop * instrument.rate_factor * speed)


def _spread(problem: Problem, fits: list[Fit], number: int, speed: float, mean: FloatArray) -> FloatArray:
    """Covariance of such a measurement: localisation, sample scatter, numerical error, uncertainty of p_m."""
    base, moved = (_predict(problem, fits[0], number, speed, shift) for shift in (0.0, 0.01))
    tangent = (moved - base) / 0.01
    cameras = [drop.sigma for drop in problem.drops if isinstance(drop, ObservedDrop)]
    white = np.median(cameras) if cameras else USUAL_SIGMA
    variance = problem.budget.scatter**2 + fits[0].covariance[0, 0]
    numerical = problem.budget.numerical * mean
    return (
        white**2 * np.eye(len(mean)) + variance * np.outer(tangent, tangent) + np.outer(numerical, numerical)
    )
