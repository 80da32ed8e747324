"""What is believed of a parameter before this campaign: five laws, frozen and small.

Each has logpdf, cdf, ppf (arrays in, arrays out), sd, sample(rng) and describe(). Parameter cuts them off at its limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, ndtri

Values = npt.ArrayLike
HALF_LOG_2_PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class Normal:
    """Gaussian about ``mean``."""

    mean: float
    sd: float

    def logpdf(self, x: Values) -> np.ndarray:
        return -0.5 * ((np.asarray(x) - self.mean) / self.sd) ** 2 - math.log(self.sd) - HALF_LOG_2_PI

    def cdf(self, x: Values) -> np.ndarray:
        return ndtr((np.asarray(x) - self.mean) / self.sd)

    def ppf(self, q: Values) -> np.ndarray:
        return self.mean + self.sd * ndtri(np.asarray(q))

    def sample(self, rng: np.random.Generator) -> float:
        return float(rng.normal(self.mean, self.sd))

    def describe(self) -> str:
        return f"{self.mean:.4g} ± {self.sd:.3g}"


@dataclass(frozen=True)
class Cauchy:
    """Nobody knows how large it is: half of it lies within ``sd`` of ``centre``, a sixteenth beyond ten times that."""

    centre: float
    sd: float

    def logpdf(self, x: Values) -> np.ndarray:
        return -np.log1p(((np.asarray(x) - self.centre) / self.sd) ** 2) - math.log(math.pi * self.sd)

    def cdf(self, x: Values) -> np.ndarray:
        return np.asarray(0.5 + np.arctan((np.asarray(x) - self.centre) / self.sd) / math.pi)

    def ppf(self, q: Values) -> np.ndarray:
        return np.asarray(self.centre + self.sd * np.tan(math.pi * (np.asarray(q) - 0.5)))

    def sample(self, rng: np.random.Generator) -> float:
        return self.centre + self.sd * float(rng.standard_cauchy())

    def describe(self) -> str:
        return f"{self.centre:.4g} ± {self.sd:.3g}, or many times that"


@dataclass(frozen=True)
class HalfNormal:
    """Upper half of a Gaussian about ``origin``; ``sd`` is the width of the whole one."""

    sd: float
    origin: float = 0.0

    def logpdf(self, x: Values) -> np.ndarray:
        x = np.asarray(x) - self.origin
        inside = -0.5 * (x / self.sd) ** 2 - math.log(self.sd) - HALF_LOG_2_PI + math.log(2.0)
        return np.where(x >= 0.0, inside, -np.inf)

    def cdf(self, x: Values) -> np.ndarray:
        return np.maximum(2.0 * ndtr((np.asarray(x) - self.origin) / self.sd) - 1.0, 0.0)

    def ppf(self, q: Values) -> np.ndarray:
        return self.origin + self.sd * ndtri(0.5 * (1.0 + np.asarray(q)))

    def sample(self, rng: np.random.Generator) -> float:
        return self.origin + abs(float(rng.normal(0.0, self.sd)))

    def describe(self) -> str:
        return f"{self.origin:.4g} + |0 ± {self.sd:.3g}|" if self.origin else f"|0 ± {self.sd:.3g}|"


@dataclass(frozen=True)
class LogNormal:
    """ln x is Gaussian about ln ``median`` with standard deviation ``sd_log``."""

    median: float
    sd_log: float

    @property
    def sd(self) -> float:
        """Of x where sd_log is small; the size of one step of sd_log at the median otherwise."""
        return self.median * self.sd_log

    def logpdf(self, x: Values) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.log(x)
            inside = (
                -0.5 * ((log - math.log(self.median)) / self.sd_log) ** 2
                - log
                - math.log(self.sd_log)
                - HALF_LOG_2_PI
            )
        return np.where(x > 0.0, inside, -np.inf)

    def cdf(self, x: Values) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside = ndtr((np.log(x) - math.log(self.median)) / self.sd_log)
        return np.where(x > 0.0, inside, 0.0)

    def ppf(self, q: Values) -> np.ndarray:
        return self.median * np.exp(self.sd_log * ndtri(np.asarray(q)))

    def sample(self, rng: np.random.Generator) -> float:
        return float(self.median * math.exp(rng.normal(0.0, self.sd_log)))

    def describe(self) -> str:
        return f"{self.median:.4g} ×/÷ {math.exp(self.sd_log):.3g}"


@dataclass(frozen=True)
class Uniform:
    """The same density everywhere from ``low`` to ``high``."""

    low: float
    high: float

    @property
    def sd(self) -> float:
        return (self.high - self.low) / math.sqrt(12.0)

    def logpdf(self, x: Values) -> np.ndarray:
        x = np.asarray(x)
        return np.where((x >= self.low) & (x <= self.high), -math.log(self.high - self.low), -np.inf)

    def cdf(self, x: Values) -> np.ndarray:
        return np.clip((np.asarray(x) - self.low) / (self.high - self.low), 0.0, 1.0)

    def ppf(self, q: Values) -> np.ndarray:
        return self.low + (self.high - self.low) * np.asarray(q)

    def sample(self, rng: np.random.Generator) -> float:
        return float(rng.uniform(self.low, self.high))

    def describe(self) -> str:
        return f"{self.low:.3g} to {self.high:.3g}"


Prior = Normal | Cauchy | HalfNormal | LogNormal | Uniform
