"""A gauge's record of a push as the likelihood sees it: the net resistance of each window of depth, and how the ground differs.

Net is what remains when the weight of the ground above is taken off: q = qt - ρ g z. Its logarithm is compared, so that a ground
that is stronger by a share is so at every depth. A window is as long as the way over which a tip feels the ground about it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import helmert
from scipy.optimize import minimize

from ...errors import MeasurementError
from ...force import ForceRecord, read_force
from ...records import Campaign, Drop, FloatArray, Gauge, Measured

WINDOW = 56.0  # tip radii; clays are felt over some 10 to 30 (Lunne, Robertson & Powell 1997)
DEEP = 10.0  # tip radii, from which on a push is deep: its resistance no longer depends on the surface
FEWEST = 5  # rows in a window
USUAL_GROUND = (0.02, 5.0)  # of ln resistance, and in windows: where too few records say it
LONGEST = 0.5  # of the depths compared: what stays alike over more is a record's factor, whose size contrasts do not show
ROUGH = 0.003  # of ln resistance: what a median over a window is good to, at best


@dataclass(frozen=True)
class ObservedPush:
    """One record in windows. depth : (n,) m, middle of each; windows : (n,) their numbers, the same for all records of a tip;
    resistance, sigma : (n,) ln of net resistance over 1 Pa, and its own error; speeds : m/s as stated; friction_ratio,
    friction_sigma : (n,) of the sleeve over the net resistance, and its own error, NaN where too few rows have a sleeve, empty
    where the record has none."""

    drop: Drop
    record: ForceRecord
    depth: FloatArray
    windows: np.ndarray
    resistance: FloatArray
    sigma: FloatArray
    weight: float  # Pa/m, of the ground
    speeds: tuple[Measured, ...]
    rejected: int
    warnings: tuple[str, ...] = ()
    curve: None = None
    friction_ratio: FloatArray = field(default_factory=lambda: np.empty(0))
    friction_sigma: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def compares_sleeve(self) -> bool:
        """Whether its sleeve counts, and says something."""
        assert self.drop.gauge is not None
        return self.drop.gauge.sleeve.compared and bool(np.isfinite(self.friction_ratio).any())

    @property
    def name(self) -> str:
        return self.drop.name

    @property
    def feels_shaft(self) -> bool:
        assert self.drop.gauge is not None
        return self.drop.gauge.feels_shaft

    @property
    def impact_speed(self) -> float:
        """m/s, of the push."""
        return self.speeds[0].value


@dataclass(frozen=True)
class Ground:
    """How ln resistance differs from place to place beside what all records share and one factor a record: standard deviation,
    and the length (m) over which it stays alike."""

    size: float
    length: float


def observe_push(drop: Drop, campaign: Campaign) -> ObservedPush:
    """Windows of one record. Raises MeasurementError where no window is left."""
    assert drop.gauge is not None and drop.record.path is not None
    path, radius = drop.record.path, drop.projectile.tip_radius
    record = read_force(path, drop.gauge, radius)
    noise = drop.gauge.sigma / drop.gauge.per_pressure(math.pi * radius**2)
    weight = campaign.gravity * campaign.sample.filling_factor * campaign.sample.monomer_density
    net = record.pressure - weight * record.depth
    width = WINDOW * radius
    number = np.floor(record.depth / width).astype(int)
    low, high = record.depth[0], record.depth[-1]
    whole = [
        n
        for n in np.unique(number)
        if n * width >= max(low - record.step, DEEP * radius) and (n + 1) * width <= high + record.step
    ]
    kept, values, errors = [], [], []
    for n in map(int, whole):
        inside = net[number == n]
        if inside.size < FEWEST or np.median(inside) <= 0.0:
            continue
        middle = float(np.median(inside))
        kept.append(n)
        values.append(math.log(middle))
        errors.append(math.hypot(ROUGH, noise / middle / math.sqrt(inside.size)))
    if not kept:
        raise MeasurementError(
            path,
            "record.window_mm",
            f"holds no window of {width * 1e3:.3g} mm ({WINDOW:g} tip radii), deeper than {DEEP:g} tip radii, in which the tip "
            "resists more than the weight of the ground; record deeper, or correct unit and density",
        )
    dropped = len(whole) - len(kept)
    ratio, ratio_sigma = _read_sleeve(drop.gauge, record, net, number, kept, noise)
    return ObservedPush(
        drop,
        record,
        (np.array(kept) + 0.5) * width,
        np.array(kept),
        np.array(values),
        np.array(errors),
        weight,
        (Measured(dict(drop.motion.values)["speed"], drop.motion.speed_sigma),),
        record.lost + record.lifted,
        (f"{dropped} windows without a net resistance are left out",) * bool(dropped),
        friction_ratio=ratio,
        friction_sigma=ratio_sigma,
    )


def _read_sleeve(
    gauge: Gauge, record: ForceRecord, net: FloatArray, number: np.ndarray, kept: Sequence[int], noise: float
) -> tuple[FloatArray, FloatArray]:
    """Median of sleeve friction over net resistance in each window, and its own error; empty where the record has no sleeve."""
    if not record.sleeve.size:
        return np.empty(0), np.empty(0)
    values, errors = np.full((2, len(kept)), math.nan)
    for k, n in enumerate(kept):
        inside = (number == n) & np.isfinite(record.sleeve) & (net > 0.0)
        if inside.sum() < FEWEST:
            continue
        values[k] = np.median(record.sleeve[inside] / net[inside])
        # relative errors of the resistance are those of the ratio; its own rows scatter by the sleeve's noise
        own = math.hypot(gauge.sleeve.sigma, values[k] * noise) / float(np.median(net[inside]))
        errors[k] = math.hypot(ROUGH * values[k], own / math.sqrt(inside.sum()))
    return values, errors


def measure_ground(pushes: Sequence[ObservedPush]) -> Ground:
    """How the ground differs along the depth from record to record, by restricted maximum likelihood (Patterson & Thompson 1971):
    what all records share in a window, and a factor for each record, are free.

    The windows that all records have are taken. Too few of them or of records leave it at USUAL_GROUND.
    """
    common = sorted(set.intersection(*({int(n) for n in push.windows} for push in pushes)))
    width = WINDOW * pushes[0].drop.projectile.tip_radius
    size, length = USUAL_GROUND[0], USUAL_GROUND[1] * width
    if len(pushes) < 4 or len(common) < 4:
        return Ground(size, length)
    seen = np.array([[push.resistance[list(push.windows).index(n)] for n in common] for push in pushes])
    own = np.array([[push.sigma[list(push.windows).index(n)] ** 2 for n in common] for push in pushes]).mean(
        axis=0
    )
    contrast = helmert(len(common))  # what a factor of the record leaves alone
    left = (helmert(len(pushes)) @ seen) @ contrast.T
    apart = np.abs(np.subtract.outer(common, common)) * width

    def lose(u: FloatArray) -> float:
        size, length = np.exp(u)
        covariance = contrast @ (size**2 * np.exp(-apart / length) + np.diag(own)) @ contrast.T
        lower = np.linalg.cholesky(covariance)
        white = np.linalg.solve(lower, left.T)
        return float(0.5 * np.sum(white**2) + len(left) * np.sum(np.log(np.diag(lower))))

    bounds = [(math.log(1e-4), 0.0), (math.log(0.2 * width), math.log(LONGEST * apart.max()))]
    length = min(length, LONGEST * float(apart.max()))
    found = minimize(lose, np.log([size, length]), method="Nelder-Mead", bounds=bounds)
    return Ground(*map(float, np.exp(found.x)))
