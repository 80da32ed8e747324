"""How strong a hidden effect is: what the best nominal fit leaves of it, in standard deviations.

The hidden campaign is filmed without any noise and fitted by the nominal model as every campaign is: p_m, contacts, speeds and
all other nuisances move as far as they can, p_m a factor ROOM beyond its range too. If the range stopped it, the strength would
also count that the dust is stiffer or softer than stated, and that tells nothing of one cause from another.
χ² (of the residuals whitened by the covariance of that fit, so twice the loss of log likelihood) beyond what the nominal truth
leaves, which differs from the model in its spacing, is the square of the strength. It is by this number that χ² of a noisy
campaign is larger on average.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.truths.measured import QUIET, measure_hidden
from benchmarks.truths.table import Hidden, TruthTable
from labsim.effects import Effect
from labsim.errors import LabsimError
from labsim.inference.calibrate import prepare
from labsim.records import Campaign
from labsim.runs.store import RunStore

ROOM = 2.0  # factor on both ends of the stated range of p_m, for the fit that strengths are counted by; more costs many runs
RATIO = 2.0  # of amplitudes simulated, powers of it times the effect's step
STRIDE = 4.0  # at once, at most
MOST_NODES = 5  # amplitudes simulated on one side of null
HOPE = 1.5  # factor by which the strength at a limit may beat its projection
LOWEST = 2.5  # times the least strength looked for that the smallest amplitude simulated may have
SETTLED, ACCEPTED = 0.03, 0.1  # of a strength, off what is wanted: between runs, at a run
WORTHLESS = 0.25  # the same, at which nothing is found: it does not follow its amplitude
SIMULATED = 2  # amplitudes simulated for one strength
STEPS = 4  # of the search between runs
LEAST = 0.05  # standard deviations that logarithms are taken of
OFF_DEFAULT = 0.8  # hidden shapes are this share of the stated one


@dataclass
class StrengthCount:
    """Counts strengths in one campaign. reference : χ² that the noise-free nominal truth leaves, None until it is counted.

    Measurements at the truth's runs; between them its interpolation is what is measured.
    """

    campaign: Campaign
    store: RunStore
    truth: TruthTable
    reference: float | None = None

    def measure(self, hidden: Hidden) -> float:
        """Standard deviations. Raises SimulationError where runs fail."""
        if self.reference is None:
            self.reference = self._leave(Hidden(p_m=hidden.p_m))
        return math.sqrt(max(self._leave(hidden) - self.reference, 0.0))

    def _leave(self, hidden: Hidden) -> float:
        measurements = measure_hidden(self.truth, hidden, np.random.default_rng(0), laboratory=QUIET)
        low, high = self.campaign.p_m_range
        free = replace(self.campaign, p_m_range=(low / ROOM, high * ROOM))
        _, fit = prepare(free, self.store, workers=1, measurements=measurements)
        return fit.chi_square

    def simulate(self, effect: Effect, amplitude: float) -> float:
        """Strength at an amplitude that runs are made at."""
        hidden = hide(effect, amplitude)
        self.truth.prepare([hidden])
        return self.measure(hidden)

    def find(self, effect: Effect, side: int, wanted: Sequence[float]) -> Search:
        """Amplitudes on one side of null (+1, -1) that are as strong as wanted; those that no amplitude reaches are left out.

        Runs are made at powers of RATIO times the effect's step, the same for every campaign; between them what they change is
        interpolated, and what is found is simulated and counted itself.
        """
        strengths, end = self._walk(effect, side, min(wanted), max(wanted))
        found = {}
        for sigma in wanted:
            amplitude = self._search(effect, dict(strengths), sigma)
            if amplitude is not None:
                found[sigma] = amplitude
        return Search(found, strengths, end)

    def _walk(self, effect: Effect, side: int, least: float, most: float) -> tuple[dict[float, float], str]:
        """Strengths at amplitudes that enclose those looked for, as far as limits and runs allow, and where they ended."""
        strengths: dict[float, float] = {}
        power, end = 0, "at its limit"
        while True:
            amplitude, last = _rung(effect, side, power)
            if amplitude == 0.0:
                break
            try:
                sigma = self.simulate(effect, amplitude)
            except LabsimError:  # so much of it ends no run, no track or no fit
                end = f"runs or fits fail at {amplitude:.4g}"
                break
            strengths[amplitude] = sigma
            if last or sigma > most:
                break
            if HOPE * _project(effect, strengths) < least:
                end = "grows too little"
                break
            if len(strengths) == MOST_NODES:
                end = "not looked for further"
                break
            stride = min(max(most / max(sigma, LEAST), RATIO), STRIDE)
            power += math.ceil(math.log(stride) / math.log(RATIO) - 1e-9)
        power = 0
        while strengths and min(strengths.values()) > LOWEST * least and len(strengths) < MOST_NODES:
            excess = min(min(strengths.values()) / least, STRIDE)
            power -= max(math.floor(math.log(excess) / math.log(RATIO)), 1)
            amplitude, _ = _rung(effect, side, power)
            strengths[amplitude] = self.simulate(effect, amplitude)
        return strengths, end

    def _search(self, effect: Effect, strengths: dict[float, float], sigma: float) -> Found | None:
        """Secant steps in logarithms of amplitude and strength; the last one is simulated."""
        if not strengths or max(strengths.values()) < sigma:
            return None
        for _ in range(SIMULATED):
            for _ in range(STEPS):
                amplitude = _aim(strengths, sigma)
                hidden = hide(effect, amplitude)
                if not effect.affects_simulation:
                    self.truth.prepare([hidden])  # another blur of the maps
                strengths[amplitude] = self.measure(hidden)
                if abs(strengths[amplitude] / sigma - 1) < SETTLED:
                    break
            if effect.affects_simulation:
                strengths[amplitude] = self.simulate(effect, amplitude)
            if abs(strengths[amplitude] / sigma - 1) < ACCEPTED:
                break
        if abs(strengths[amplitude] / sigma - 1) > WORTHLESS:
            return None
        return Found(hide(effect, amplitude), strengths[amplitude])


@dataclass(frozen=True)
class Found:
    """What to hide, and how strong it is in standard deviations."""

    hidden: Hidden
    strength: float


@dataclass(frozen=True)
class Search:
    """found : by strength wanted; strengths : at the amplitudes tried; end : why no larger one was."""

    found: dict[float, Found]
    strengths: dict[float, float]
    end: str

    @property
    def most(self) -> float:
        """Of the strengths; 0 where null is the limit on this side."""
        return max(self.strengths.values(), default=0.0)


def hide(effect: Effect, amplitude: float, shapes: Mapping[str, float] | None = None) -> Hidden:
    """One effect; shapes that are not given are OFF_DEFAULT of the stated ones."""
    parameter = effect.amplitudes[0]
    values = {p.name: OFF_DEFAULT * p.null for p in effect.parameters if p.shape}
    return Hidden({effect.name: {parameter.name: parameter.hold(amplitude), **values, **(shapes or {})}})


def _aim(strengths: Mapping[float, float], sigma: float) -> float:
    """Where a line in logarithms through the two strengths about this one, or through the first and null, meets it."""
    rising = sorted(strengths.items(), key=lambda each: abs(each[0]))
    above = next(k for k, (_, value) in enumerate(rising) if value >= sigma)
    high, at_high = rising[above]
    low, at_low = rising[above - 1] if above else (0.5 * high, 0.5 * at_high)
    at_low = min(max(at_low, LEAST), 0.999 * at_high)
    share = math.log(sigma / at_low) / math.log(at_high / at_low)
    share = min(max(share, -2.0), 1.0)
    return float(f"{math.copysign(abs(low) ** (1 - share) * abs(high) ** share, high):.4g}")


def _project(effect: Effect, strengths: Mapping[float, float]) -> float:
    """Strength at the limit if it goes on as between the last two amplitudes; infinite after one."""
    if len(strengths) < 2:
        return math.inf
    (before, at_before), (last, at_last) = list(strengths.items())[-2:]
    parameter = effect.amplitudes[0]
    limit = parameter.limits[last > 0] - parameter.null
    slope = math.log(max(at_last, LEAST) / max(at_before, LEAST)) / math.log(last / before)
    return float(at_last * (limit / last) ** max(slope, 0.0))


def _rung(effect: Effect, side: int, power: int) -> tuple[float, bool]:
    """The amplitude of one power of RATIO, and whether it is the last inside the limits; 0 where null is the limit."""
    parameter = effect.amplitudes[0]
    low, high = (limit - parameter.null for limit in parameter.limits)
    amplitude = side * abs(parameter.step) * RATIO**power
    inside = min(max(amplitude, low), high)
    return (inside, True) if inside != amplitude else (amplitude, False)
