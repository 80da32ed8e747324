"""The tables of docs/seed-study.md from the runs in docs/seed-study.csv; ``benchmarks.seed.study`` makes that file.

Outputs of runs are interpolated in logarithms: nominal ones with splines over p_m and speed, effects as what they add to
the nominal logarithm. Without gravity, and with no length or time in the material, lengths and times of a drop scale with
the radius at equal speed, so one radius serves both sizes in the nominal model (``scaling`` in the file checks it).
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator, RectBivariateSpline

from benchmarks.seed.study import (
    GLASS,
    LARGE,
    LEVELS,
    MOMENTA,
    P_M_EFFECT,
    SMALL,
    TOGETHER,
    name_together,
    speed_at,
)

Row = dict[str, str]
DROPS = tuple((radius, speed_at(momentum, radius)) for radius in (SMALL, LARGE) for momentum in MOMENTA)
PLANAR = 8.0 / (3.0 * math.pi)

# the five facts as nine numbers. Published: 3.0, 6.2 and 0.1 ms, 8e-4, one volume. Assumed: 5 % of the depth law (half of the
# variance common to both sizes), 0.09 of its exponent (5 % between m v/A 1 and 1.75), 0.3 sphere volumes, 2 % of the runs.
NAMES = ("T1", "T1 slope", "T3", "T3 slope", "C1", "C1 slope", "C3", "C3 slope", "V")
LONG = {"T1": "T_s of 1 mm, ms", "T3": "T_s of 3 mm, ms", "C1": "D/(m v/A) of 1 mm, 1e-4 m² s/kg",
        "C3": "D/(m v/A) of 3 mm", "V": "volume at φ 0.20-0.25, spheres"}  # fmt: skip
OBSERVED = np.array(
    [math.log(3.0e-3), 0.0, math.log(6.2e-3), 0.0, math.log(8e-4), 0.0, math.log(8e-4), 0.0, 1.0]
)
SPAN = math.log(MOMENTA[1] / MOMENTA[0])


def covariance(numerical: float = 0.02) -> np.ndarray:
    """Of the nine numbers, (9, 9); logarithms except the volume."""
    t1, t3, law = 0.1 / 3.0, 0.1 / 6.2, 0.05
    found = (
        np.diag(
            [
                t1,
                math.sqrt(2) * t1 / SPAN,
                t3,
                math.sqrt(2) * t3 / SPAN,
                law,
                law / SPAN,
                law,
                law / SPAN,
                0.3,
            ]
        )
        ** 2
    )
    found[4, 6] = found[6, 4] = 0.5 * law**2
    for pair in ((0, 2), (4, 6)):  # the same spacing per radius: the numerical error is common
        for i in pair:
            for j in pair:
                found[i, j] += numerical**2
    return found


@dataclass(frozen=True)
class Outputs:
    """ln T_s (s) and ln D (m) of the four DROPS, (..., 4), and the compacted volume of the scanned bead, (...)."""

    log_time: np.ndarray
    log_depth: np.ndarray
    volume: np.ndarray

    def figures(self) -> np.ndarray:
        """The nine numbers, (..., 9)."""
        coefficient = self.log_depth - np.log([MOMENTA * 2])
        t, c = self.log_time, coefficient
        return np.stack(
            [
                t[..., :2].mean(-1), (t[..., 1] - t[..., 0]) / SPAN, t[..., 2:].mean(-1), (t[..., 3] - t[..., 2]) / SPAN,
                c[..., :2].mean(-1), (c[..., 1] - c[..., 0]) / SPAN, c[..., 2:].mean(-1), (c[..., 3] - c[..., 2]) / SPAN,
                self.volume,
            ],
            axis=-1,
        )  # fmt: skip


def read(table: Path) -> list[Row]:
    with table.open(newline="") as stream:
        return list(csv.DictReader(stream))


class Grid:
    """Splines of the nominal model over ln p_m and ln speed; ``planar`` or round. Lengths and times per radius."""

    def __init__(self, rows: Iterable[Row], group: str = "nominal") -> None:
        own = [row for row in rows if row["group"] == group]
        self.p_m = np.array(sorted({float(row["p_m_Pa"]) for row in own}))
        self.speed = np.array(sorted({float(row["speed_m_s"]) for row in own}))
        place = self._place = {(float(row["p_m_Pa"]), float(row["speed_m_s"])): row for row in own}
        self._splines, self._shares = {}, {}
        for name in own[0]:
            try:
                values = np.array([[float(place[p, v][name]) for v in self.speed] for p in self.p_m])
            except (ValueError, KeyError):
                continue
            if name.startswith("time_below"):  # nought where the drop begins slower than that: as a share
                whole = np.array(
                    [[float(place[p, v]["stopping_time_ms"]) for v in self.speed] for p in self.p_m]
                )
                self._shares[name] = RectBivariateSpline(
                    np.log(self.p_m), np.log(self.speed), values / whole, kx=1, ky=1, s=0
                )
            elif np.all(values > 0) and np.ptp(values) > 0:
                values = values / (0.5 if name.endswith(("_ms", "_mm")) else 1.0)  # per mm of radius
                degree = min(3, len(self.p_m) - 1)
                self._splines[name] = RectBivariateSpline(
                    np.log(self.p_m), np.log(self.speed), np.log(values), kx=degree, ky=3, s=0
                )

    def nearest(self, row: Row) -> Row:
        """The run at the p_m and speed of another."""
        p_m = self.p_m[np.argmin(np.abs(self.p_m - float(row["p_m_Pa"])))]
        speed = self.speed[np.argmin(np.abs(np.log(self.speed / float(row["speed_m_s"]))))]
        return self._place[p_m, speed]

    def log(self, name: str, p_m: np.ndarray | float, speed: np.ndarray | float) -> np.ndarray:
        """ln of a column, times in ms and depths in mm for a radius of 1 mm; beyond the runs the edge's tangent in p_m."""
        x = np.log(np.asarray(p_m, float))
        inside = np.clip(x, np.log(self.p_m[0]), np.log(self.p_m[-1]))
        y = np.log(np.asarray(speed, float))
        if name in self._shares:
            share = np.maximum(self._shares[name].ev(inside, y), 1e-3)
            return self.log("stopping_time_ms", p_m, speed) + np.log(share)
        spline = self._splines[name]
        return spline.ev(inside, y) + (x - inside) * spline.ev(inside, y, dx=1)

    def drops(self, p_m: np.ndarray, time: str = "stopping_time_ms") -> tuple[np.ndarray, np.ndarray]:
        """ln T_s (s) and ln D (m) of DROPS, p_m (..., 1) or (..., 4)."""
        radius = np.array([r for r, _ in DROPS])
        speed = np.array([v for _, v in DROPS])
        p_m = np.asarray(p_m, float) * np.ones(4)
        return (
            self.log(time, p_m, speed * np.ones_like(p_m)) + np.log(radius),
            self.log("depth_mm", p_m, speed * np.ones_like(p_m)) + np.log(radius),
        )


class Bead:
    """Compacted volume between φ 0.20 and 0.25 of the scanned bead against ln p_m, sphere volumes."""

    def __init__(self, rows: Iterable[Row], low: float = 0.20, high: float = 0.25) -> None:
        own = {float(r["p_m_Pa"]): _volume(r, low, high) for r in rows if r["group"] == "bead"}
        p_m = sorted(own)
        self._shape = PchipInterpolator(np.log(p_m), [own[p] for p in p_m], extrapolate=True)

    def __call__(self, p_m: np.ndarray) -> np.ndarray:
        return np.maximum(self._shape(np.log(p_m)), 0.0)


def _volume(row: Row, low: float = 0.20, high: float = 0.25) -> float:
    return float(row[f"volume_above_{low:g}"]) - float(row[f"volume_above_{high:g}"])


NULLS = {
    "gravity": 0.0, "shear_strength": 1.0, "strength_rate": 0.0, "surface_crust": 0.0,
    "density_gradient": 0.0, "side_friction": 0.0, "contact_friction": 0.0, "strength_slope": 0.58,
    "pore_gas": 0.0, "hard_floor": 0.02, "bulk_modulus": 45e3, "artificial_viscosity": 0.5, "strength_ceiling": 0.58,
    "filling_factor": 0.15, "projectile_mass": 1.0, "tensile_strength": 1.0,
}  # fmt: skip
_ROOT = (np.sqrt, np.square)
_LOG = (np.log, np.exp)
STRAIGHT: dict[str, tuple[Callable, Callable]] = {  # in what an effect's levels are interpolated, and back
    "strength_rate": _ROOT, "pore_gas": _ROOT, "side_friction": _ROOT,
    "hard_floor": (np.reciprocal, np.reciprocal), "shear_strength": _LOG, "bulk_modulus": _LOG,
    "artificial_viscosity": _LOG, "projectile_mass": _LOG, "tensile_strength": _LOG,
}  # fmt: skip


class EffectGrid:
    """What one effect adds to ln T_s, ln D and the volume: (p_m of the runs, levels) -> interpolated."""

    def __init__(self, rows: list[Row], case: str, nominal: Grid, bead: Bead) -> None:
        made: dict[float, list[Row]] = {}
        for row in rows:
            if row["group"] == case:
                made.setdefault(float(row["case"]), []).append(row)
        whole = {level: found for level, found in made.items() if len(found) == len(P_M_EFFECT) * len(DROPS)}
        self.case, self.null = case, NULLS[case]
        self._straight, self._back = STRAIGHT.get(case, (np.asarray, np.asarray))
        self.p_m, self.levels = np.array(sorted(P_M_EFFECT)), np.array(sorted({*whole, self.null}))
        added = np.zeros((len(self.levels), len(self.p_m), 9))
        time, depth = nominal.drops(self.p_m[:, None])
        between = math.log(0.8 / DROPS[0][1]) / math.log(
            DROPS[1][1] / DROPS[0][1]
        )  # where the bead's speed lies
        for i, level in enumerate(self.levels):
            for row in whole.get(float(level), []):
                j = int(np.argmin(np.abs(self.p_m - float(row["p_m_Pa"]))))
                k = min(range(4), key=lambda k: abs(math.log(1e-3 * float(row["radius_mm"]) / DROPS[k][0])) + abs(
                    math.log(float(row["speed_m_s"]) / DROPS[k][1])))  # fmt: skip
                added[i, j, k] = math.log(1e-3 * float(row["stopping_time_ms"])) - time[j, k]
                added[i, j, 4 + k] = math.log(1e-3 * float(row["depth_mm"])) - depth[j, k]
                if k < 2:  # the volume under a bead changes as that under a rod does
                    share = between if k == 1 else 1.0 - between
                    added[i, j, 8] += share * (_volume(row) - _volume(nominal.nearest(row)))
        x = self._straight(self.levels)
        order = np.argsort(x)
        self._shape = PchipInterpolator(x[order], added[order], axis=0)

    def added(self, value: float, p_m: np.ndarray) -> np.ndarray:
        """(n, 9): four ln T_s, four ln D, the volume; p_m beyond the runs takes the edge's."""
        at = self._shape(self._straight(value))  # (p_m, 9)
        x = np.clip(np.log(p_m), np.log(self.p_m[0]), np.log(self.p_m[-1]))
        if len(self.p_m) == 1:
            return np.repeat(at, len(p_m), axis=0)
        return PchipInterpolator(np.log(self.p_m), at, axis=0)(x)

    def values(self, count: int = 41) -> np.ndarray:
        """Values between the extreme levels, evenly in what they are interpolated in; null among them."""
        x = self._straight(self.levels)
        between = self._back(np.linspace(x.min(), x.max(), count))[1:-1]
        return np.unique(np.concatenate([between, self.levels]))


P_M_FIT = np.geomspace(40.0, 6000.0, 240)


@dataclass(frozen=True)
class Fit:
    """Best p_m and amplitude of one hypothesis, and what it reaches."""

    name: str
    p_m: float
    value: float
    chi2: float
    figures: np.ndarray
    at_limit: bool = False


def fit(name: str, values: Iterable[float], outputs: Callable[[float, np.ndarray], Outputs],
        used: Iterable[int] = range(9)) -> Fit:  # fmt: skip
    """Least squares over p_m and one amplitude by a grid; ``used`` are the numbers that are fitted."""
    used = list(used)
    weight = np.linalg.inv(covariance()[np.ix_(used, used)])
    best = None
    values = list(values)
    for value in values:
        figures = outputs(value, P_M_FIT).figures()
        residual = (figures - OBSERVED)[:, used]
        chi2 = np.einsum("ni,ij,nj->n", residual, weight, residual)
        k = int(np.nanargmin(chi2))
        if best is None or chi2[k] < best.chi2:
            best = Fit(name, float(P_M_FIT[k]), float(value), float(chi2[k]), figures[k],
                       (len(values) > 1 and value in (values[0], values[-1])) or k in (0, len(P_M_FIT) - 1))  # fmt: skip
    assert best is not None
    return best


class Study:
    """Everything that is read from the file of runs."""

    def __init__(self, table: Path, always: dict[str, float] | None = None) -> None:
        """always: effects that every hypothesis holds, as ``{"gravity": 9.81}``."""
        self.always = always or {}
        self.rows = read(table)
        self.round = Grid(self.rows)
        self.planar = Grid(self.rows, "planar")
        self.bead = Bead(self.rows)
        self.effects = {
            case: EffectGrid(self.rows, case, self.round, self.bead)
            for case in LEVELS
            if sum(r["group"] == case for r in self.rows) >= len(P_M_EFFECT) * len(DROPS)
        }

    def nominal(self, p_m: np.ndarray, time: str = "stopping_time_ms") -> Outputs:
        return self._add(Outputs(*self.round.drops(p_m[:, None], time), self.bead(p_m)), self.always, p_m)

    def with_effects(self, chosen: dict[str, float], p_m: np.ndarray) -> Outputs:
        """Effects together: their logarithms added."""
        return self._add(self.nominal(p_m), chosen, p_m)

    def _add(self, base: Outputs, chosen: dict[str, float], p_m: np.ndarray) -> Outputs:
        added = sum((self.effects[case].added(x, p_m) for case, x in chosen.items()), np.zeros((len(p_m), 9)))
        volume = np.maximum(base.volume + added[:, 8], 0.0)
        return Outputs(base.log_time + added[:, :4], base.log_depth + added[:, 4:8], volume)

    def hypotheses(self) -> dict[str, tuple[Iterable[float], Callable[[float, np.ndarray], Outputs]]]:
        """Name -> amplitudes to try and the outputs they give."""
        found: dict = {"nominal": ([0.0], lambda _, p: self.nominal(p))}
        for case, effect in self.effects.items():
            if case in self.always:
                continue
            found[case] = (effect.values(), lambda x, p, case=case: self.with_effects({case: x}, p))
        found["trigger_offset"] = (np.linspace(-1.5e-3, 1.5e-3, 61), self._offset_time)
        found["contact_offset"] = (np.linspace(-1.0e-3, 1.5e-3, 51), self._contact)
        found["surface_offset"] = (np.linspace(-0.4e-3, 0.4e-3, 81), self._offset_depth)
        found["stop_threshold"] = (np.linspace(0.0, 0.15, 31), self._threshold)
        found["sine_fit"] = ([0.0, 1.0], self._sine)
        found["frame_rate"] = (np.geomspace(0.7, 1.4, 29), self._frame_rate)
        found["pixel_scale"] = (np.geomspace(0.7, 1.4, 29), self._pixel_scale)
        found["sizes_differ"] = (np.geomspace(0.05, 20, 61), self._sizes)
        found["rate_power"] = (np.linspace(-1.5, 1.5, 61), self._rate_power)
        return found

    def _offset_time(self, shift: float, p_m: np.ndarray) -> Outputs:
        base = self.nominal(p_m)
        return Outputs(np.log(np.maximum(np.exp(base.log_time) + shift, 1e-5)), base.log_depth, base.volume)

    def _offset_depth(self, shift: float, p_m: np.ndarray) -> Outputs:
        base = self.nominal(p_m)
        return Outputs(base.log_time, np.log(np.maximum(np.exp(base.log_depth) + shift, 1e-6)), base.volume)

    def _threshold(self, speed: float, p_m: np.ndarray) -> Outputs:
        base = self.nominal(p_m)
        stops = [0.0, 0.01, 0.02, 0.05, 0.1, 0.15]
        times = [base.log_time, *(self.nominal(p_m, f"time_below_{s:g}_ms").log_time for s in stops[1:])]
        k = min(max(int(np.searchsorted(stops, speed)), 1), len(stops) - 1)
        part = (speed - stops[k - 1]) / (stops[k] - stops[k - 1])
        return Outputs((1 - part) * times[k - 1] + part * times[k], base.log_depth, base.volume)

    def _sine(self, on: float, p_m: np.ndarray) -> Outputs:
        return self.nominal(p_m, "sine_time_ms") if on else self.nominal(p_m)

    def _contact(self, shift: float, p_m: np.ndarray) -> Outputs:
        """Zero of time and of depth taken together, this long before contact."""
        base, flown = self.nominal(p_m), shift * np.array([v for _, v in DROPS])
        return Outputs(
            np.log(np.maximum(np.exp(base.log_time) + shift, 1e-5)),
            np.log(np.maximum(np.exp(base.log_depth) + flown, 1e-6)),
            base.volume,
        )

    def _frame_rate(self, factor: float, p_m: np.ndarray) -> Outputs:
        base = self.nominal(p_m)
        return Outputs(base.log_time + math.log(factor), base.log_depth, base.volume)

    def _pixel_scale(self, factor: float, p_m: np.ndarray) -> Outputs:
        base = self.nominal(p_m)
        return Outputs(base.log_time, base.log_depth - math.log(factor), base.volume)

    def _sizes(self, factor: float, p_m: np.ndarray) -> Outputs:
        """p_m of the dust under 3 mm over that under 1 mm: drift from drop to drop at its largest, or a size effect."""
        each = p_m[:, None] * np.array([1.0, 1.0, factor, factor])
        return self._add(Outputs(*self.round.drops(each), self.bead(p_m)), self.always, p_m)

    def _rate_power(self, power: float, p_m: np.ndarray) -> Outputs:
        """p_m (rate / 1000 per s)^power with the rate v/R: hardening, or softening where negative."""
        rate = np.array([v / r for r, v in DROPS]) / 1000.0
        own = Outputs(*self.round.drops(p_m[:, None] * rate**power), self.bead(p_m * 1.6**power))
        return self._add(own, self.always, p_m)


def people(figures: np.ndarray) -> list[str]:
    """The nine numbers as people see them."""
    f = figures
    return [f"{1e3 * math.exp(f[0]):.2f}", f"{f[1]:+.2f}", f"{1e3 * math.exp(f[2]):.2f}", f"{f[3]:+.2f}",
            f"{1e4 * math.exp(f[4]):.2f}", f"{1 + f[5]:.2f}", f"{1e4 * math.exp(f[6]):.2f}", f"{1 + f[7]:.2f}",
            f"{f[8]:.2f}"]  # fmt: skip


def needed_p_m(log_outputs: np.ndarray, target: float) -> float:
    """p_m (Pa) at which falling outputs (len(P_M_FIT),) reach the target; nan where none does."""
    below = np.nonzero((log_outputs[:-1] - target) * (log_outputs[1:] - target) <= 0)[0]
    if below.size == 0:
        return math.nan
    k = int(below[-1])  # the volume has a second branch, of dust crushed past the range
    part = (log_outputs[k] - target) / (log_outputs[k] - log_outputs[k + 1])
    return float(np.exp((1 - part) * np.log(P_M_FIT[k]) + part * np.log(P_M_FIT[k + 1])))


def list_needed(study: Study) -> list[tuple[str, float, float, float, float, float]]:
    """Figure, m v/A, and the p_m (Pa) that it asks for: round; planar raw depth x 1, as the seed reads it, and the inverse."""
    found = []
    round_time, round_depth = study.round.drops(P_M_FIT[:, None])
    flat_time, flat_depth = study.planar.drops(P_M_FIT[:, None])
    for k, (radius, _) in enumerate(DROPS):
        momentum, size = (MOMENTA * 2)[k], f"{2e3 * radius:g} mm"
        time = math.log(3.0e-3 if radius == SMALL else 6.2e-3)
        flat = needed_p_m(flat_time[:, k], time)
        found.append((f"T_s, {size}", momentum, needed_p_m(round_time[:, k], time), flat, flat, flat))
        law = math.log(8e-4 * momentum)
        flats = [needed_p_m(flat_depth[:, k], law + math.log(f)) for f in (1.0, PLANAR, 1 / PLANAR)]
        found.append((f"D, {size}", momentum, needed_p_m(round_depth[:, k], law), *flats))
    volume = study.bead(P_M_FIT)
    found.append(("volume, 1 mm at 0.8 m/s", speed_momentum(0.8), needed_p_m(volume, 1.0), *[math.nan] * 3))
    return found


def speed_momentum(speed: float, radius: float = SMALL) -> float:
    """m v/A (kg/(m s)) of a glass bead."""
    return speed * 4.0 / 3.0 * GLASS * radius


def list_shapes(study: Study, p_m: float, flat_p_m: float) -> list[tuple[float, ...]]:
    """m v/A, then T_s (ms) of 1 and 3 mm, D over the law of 1 and 3 mm, v T_s/D of 1 and 3 mm: round, then planar (raw)."""
    found = []
    for momentum in (0.2, 0.35, 0.6, 1.0, 1.75, 3.0):
        row = [momentum]
        for grid, strength in ((study.round, p_m), (study.planar, flat_p_m)):
            values = []
            for radius in (SMALL, LARGE):
                v = speed_at(momentum, radius)
                t = 1e3 * radius * math.exp(grid.log("stopping_time_ms", strength, v))
                d = 1e3 * radius * math.exp(grid.log("depth_mm", strength, v))
                values.append((t, d / (0.8 * momentum), v * t / d))
            row += [values[i][j] for j in range(3) for i in range(2)]
        found.append(tuple(row))
    return found


def fit_all(study: Study, used: Iterable[int] = range(9)) -> list[Fit]:
    """Every hypothesis, best first."""
    used = list(used)
    fits = [fit(name, values, outputs, used) for name, (values, outputs) in study.hypotheses().items()]
    return sorted(fits, key=lambda each: each.chi2)


def fit_pairs(study: Study, names: Iterable[str], count: int = 13) -> list[tuple[str, str, Fit]]:
    """Pairs of effects with runs, their logarithms added, best first; ``value`` of the fit is that of the second."""
    names, found = [n for n in names if n in study.effects], []
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            for x in study.effects[first].values(count):
                best = fit(
                    f"{first} {x:.3g}",
                    study.effects[second].values(count),
                    lambda y, p, first=first, second=second, x=x: study.with_effects(
                        {first: x, second: y}, p
                    ),
                )
                found.append((first, second, best))
    found.sort(key=lambda each: each[2].chi2)
    kept: dict[tuple[str, str], tuple[str, str, Fit]] = {}
    for each in found:
        kept.setdefault(each[:2], each)
    return list(kept.values())


def fit_with_offset(study: Study) -> list[Fit]:
    """A time offset together with each other effect that has runs; ``name`` holds the offset, ``value`` is the effect's."""
    found = []
    for case, effect in study.effects.items():
        if case in study.always:
            continue
        best = None
        for shift in np.linspace(0.0, 1.6e-3, 33):

            def outputs(x: float, p_m: np.ndarray, case: str = case, shift: float = shift) -> Outputs:
                base = study.with_effects({case: x}, p_m)
                return Outputs(np.log(np.exp(base.log_time) + shift), base.log_depth, base.volume)

            each = fit(f"trigger {1e3 * shift:.2f} ms + {case}", effect.values(21), outputs)
            best = each if best is None or each.chi2 < best.chi2 else best
        assert best is not None
        found.append(best)
    return sorted(found, key=lambda each: each.chi2)


NEXT = {
    "1 mm at 0.197 m/s": (2, 0, 1.0 / 3.0),
    "3 mm at 0.591 m/s": (0, 1, 3.0),
}  # column of figures at that speed, row, scale
LONELY = ("trigger_offset", "contact_offset", "surface_offset")  # act on what is read, not on the drop


def expected_information(means: np.ndarray, spread: np.ndarray, weight: np.ndarray) -> float:
    """Bits that a measurement is expected to tell, from below.

    means : (hypotheses, values) predictions; spread : (values, values) covariance of the measurement; weight :
    (hypotheses,) probabilities. Source: Kolchinsky & Tracey (2017), Entropy 19, 361: -Σ p_j ln Σ p_k exp(-D²_jk/8).
    """
    difference = means[:, None, :] - means[None, :, :]
    distance = np.einsum("jki,il,jkl->jk", difference, np.linalg.inv(spread), difference)
    return -float(weight @ np.log(np.exp(-distance / 8) @ weight)) / math.log(2)


def list_information(study: Study) -> list[tuple[str, float, str]]:
    """Further measurement, expected information (bits), and what hypotheses predict of it.

    For hypotheses without a length or time of their own in the dust, a drop at the speed of the other size is that drop,
    scaled. Weights are exp(-χ²/2) with χ² over the best's reduced one, since not even the best fits; bits are the lower
    bound of ``expected_information``.
    """
    brings = {
        "gravity",
        "strength_rate",
        "surface_crust",
        "density_gradient",
        "hard_floor",
        "sizes_differ",
        "rate_power",
    }
    known = study.hypotheses()
    standing = [each for each in fit_all(study) if each.name not in brings]
    unit = standing[0].chi2 / (len(NAMES) - 2)
    weight = np.exp(-0.5 * np.array([each.chi2 - standing[0].chi2 for each in standing]) / unit)
    weight /= weight.sum()
    found = []
    for name, (column, _, scale) in NEXT.items():
        means, said = [], []
        for each in standing:
            base = "nominal" if each.name in LONELY else each.name
            own = known[base][1](0.0 if base == "nominal" else each.value, np.array([each.p_m]))
            time, depth = (
                math.exp(own.log_time[0, column]) * scale,
                math.exp(own.log_depth[0, column]) * scale,
            )
            shift = each.value if each.name in ("trigger_offset", "contact_offset") else 0.0
            time += shift
            depth += each.value if each.name == "surface_offset" else 0.0
            depth += shift * DROPS[column][1] if each.name == "contact_offset" else 0.0
            means.append((time, depth))
            if each.name in ("nominal", standing[0].name, "contact_offset"):
                said.append(f"{each.name} T_s {1e3 * time:.2f} ms, D {1e3 * depth:.3f} mm")
        for what, part in (("T_s", [0]), ("D", [1]), ("both", [0, 1])):
            mean = np.array(means)[:, part]
            errors = np.array(
                [math.hypot(1e-4, 0.02 * (weight @ np.array(means))[0]), 0.05 * (weight @ np.array(means))[1]]
            )
            bits = expected_information(mean, np.diag(errors[part] ** 2), weight)
            found.append((f"{what} of {name}", bits, "; ".join(said)))
    shifts = np.array(
        [each.value if each.name in ("trigger_offset", "contact_offset") else 0.0 for each in standing]
    )
    bits = expected_information(shifts[:, None], np.array([[1e-8]]), weight)
    found.append(("instant of contact to 0.1 ms, any drop", bits, "offset of the best fit against none"))
    return sorted(found, key=lambda each: -each[1])


def list_thresholds(study: Study, p_m: float) -> list[tuple[float, float, float, float]]:
    """Threshold (m/s) and the T_s ratio 3 mm : 1 mm at m v/A 1 and 1.75 and at equal speed (0.591 m/s)."""
    found = []
    for stop in (0.0, 0.01, 0.02, 0.05, 0.1, 0.15):
        name = f"time_below_{stop:g}_ms" if stop else "stopping_time_ms"
        time = study.round.drops(np.array([p_m]), name)[0].ravel()
        found.append((stop, math.exp(time[2] - time[0]), math.exp(time[3] - time[1]), 3.0))
    return found


CALIBRATION = (0, 4)  # T_s and D of 1 mm, as the seed calibrated
HELD_OUT = tuple(k for k in range(9) if k not in CALIBRATION)


def list_gains(study: Study) -> list[tuple[str, float, float, float, float]]:
    """Hypotheses fitted to the 1 mm figures alone: name, p_m, amplitude, ln p of the other figures over the nominal's, χ².

    ln p is that of a normal law around the best fit with the assumed errors; nothing of it is integrated over p_m, so
    close to a limit it is the more favourable end.
    """
    keep = list(HELD_OUT)
    weight = np.linalg.inv(covariance()[np.ix_(keep, keep)])

    def misfit(each: Fit) -> float:
        residual = (each.figures - OBSERVED)[keep]
        return float(residual @ weight @ residual)

    fits = {each.name: each for each in fit_all(study, CALIBRATION)}
    base = misfit(fits["nominal"])
    found = [(n, f.p_m, f.value, 0.5 * (base - misfit(f)), misfit(f)) for n, f in fits.items()]
    return sorted(found, key=lambda each: -each[3])


def compare_with_planar(study: Study) -> list[tuple[str, float, float]]:
    """χ² of the six numbers without the volume that are not calibrated on, planar models and round ones: name, p_m, χ².

    All are fitted to T_s and D of 1 mm; planar depths count over 8/(3π) (the paper), one, or π·3/8.
    """
    keep = [k for k in HELD_OUT if k != 8]
    found = []
    time, depth = study.planar.drops(P_M_FIT[:, None])
    known = study.hypotheses()
    models: dict[str, Callable[[float, np.ndarray], Outputs]] = {
        f"planar, raw depth / {factor:.3f}": lambda _, p, f=factor: Outputs(
            time, depth - math.log(f), np.ones(len(p))
        )
        for factor in (PLANAR, 1.0, 1.0 / PLANAR)
    }
    models["round"] = known["nominal"][1]
    weight = np.linalg.inv(covariance()[np.ix_(keep, keep)])
    fits = [fit(name, [0.0], outputs, CALIBRATION) for name, outputs in models.items()]
    fits.append(
        replace(fit("trigger_offset", *known["trigger_offset"], CALIBRATION), name="round, time offset")
    )
    for each in fits:
        residual = (each.figures - OBSERVED)[keep]
        found.append((each.name, each.p_m, float(residual @ weight @ residual)))
    return found


def list_errors(rows: list[Row], study: Study) -> list[tuple[str, float, float, float, float]]:
    """What a finer spacing changes: spacings a radius, speed, ln D and ln T_s of the spacing in use over it, volume ratio."""
    found = []
    for group, grid in (("error", study.round), ("planar_error", study.planar)):
        for row in rows:
            if row["group"] == group:
                p_m, v, radius = float(row["p_m_Pa"]), float(row["speed_m_s"]), float(row["radius_mm"])
                depth = float(grid.log("depth_mm", p_m, v)) - math.log(float(row["depth_mm"]) / radius)
                time = float(grid.log("stopping_time_ms", p_m, v)) - math.log(
                    float(row["stopping_time_ms"]) / radius
                )
                found.append((group, float(row["case"]), v, depth, time))
    return found


def list_checked(study: Study) -> list[tuple[str, float, float, float, np.ndarray]]:
    """Effects run together, or alone at their best: case, p_m (Pa), χ² interpolated, χ² of the runs, their nine numbers."""
    weight = np.linalg.inv(covariance())
    found = []
    for chosen, _ in TOGETHER:
        case = name_together(chosen)
        own = [row for row in study.rows if row["group"] == "together" and row["case"] == case]
        for p_m in sorted({float(row["p_m_Pa"]) for row in own}):
            rods: dict[tuple[float, float], Row] = {}
            volume = math.nan
            for row in own:
                if float(row["p_m_Pa"]) != p_m:
                    continue
                if row["tip"] == "sphere":
                    volume = _volume(row)
                else:
                    rods[1e-3 * float(row["radius_mm"]), float(row["speed_m_s"])] = row
            runs = [rods[radius, round(speed, 3)] for radius, speed in DROPS]
            time, depth = (
                np.log([1e-3 * float(row[name]) for row in runs]) for name in ("stopping_time_ms", "depth_mm")
            )
            direct = Outputs(time[None], depth[None], np.array([volume])).figures()[0]
            between = study.with_effects(chosen, np.array([p_m])).figures()[0]
            misfits = [float((f - OBSERVED) @ weight @ (f - OBSERVED)) for f in (between, direct)]
            found.append((case, p_m, misfits[0], misfits[1], direct))
    return found


def facts_met(figures: np.ndarray) -> str:
    """The facts met within two assumed standard deviations: R(atio), C(onstancy), D(epth), L(inearity), V(olume)."""
    sigma = np.sqrt(np.diag(covariance(0.0)))
    off = np.abs(figures - OBSERVED)
    ratio = abs(figures[2] - figures[0] - math.log(6.2 / 3.0)) <= 2 * math.hypot(sigma[0], sigma[2])
    met = (
        ("R", ratio), ("C", off[1] <= 2 * sigma[1] and off[3] <= 2 * sigma[3]),
        ("D", off[4] <= 2 * sigma[4] and off[6] <= 2 * sigma[6]), ("L", off[5] <= 2 * sigma[5] and off[7] <= 2 * sigma[7]),
        ("V", off[8] <= 2 * sigma[8]),
    )  # fmt: skip
    return "".join(letter for letter, yes in met if yes) or "-"


def table(head: str, rows: Iterable[Iterable[object]]) -> str:
    lines = [f"| {head} |", "|" + "---|" * (head.count("|") + 1)]
    for row in rows:
        cells = [f"{x:.3g}" if isinstance(x, float) else str(x) for x in row]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def fits_table(fits: Iterable[Fit]) -> str:
    def line(best: Fit) -> list[str]:
        shown = people(best.figures)
        shown.insert(4, f"{math.exp(best.figures[2] - best.figures[0]):.2f}")
        return [best.name, f"{best.value:.3g}{' (limit)' if best.at_limit else ''}", f"{best.p_m:.0f}", *shown,
                f"{best.chi2:.1f}", facts_met(best.figures)]  # fmt: skip

    head = "hypothesis | amplitude | p_m, Pa | T1 | n(T1) | T3 | n(T3) | T3/T1 | C1 | n(D1) | C3 | n(D3) | V | χ² | met"
    return table(head, map(line, fits))


def list_departures(rows: list[Row]) -> list[tuple[str, float, float, float]]:
    """Effects with a length or a time: case, p_m, T_s and D of 3 mm over three times those of 1 mm, both at 0.197 m/s."""
    keys = ("p_m_Pa", "speed_m_s", "case")
    found = []
    for small in rows:
        case = small["group"].removesuffix("_next")
        if case != small["group"] and float(small["radius_mm"]) < 1.0:
            partners = [r for r in rows if r["group"] == case and all(r[k] == small[k] for k in keys)]
            large = next(r for r in partners if float(r["radius_mm"]) > 1.0)
            ratios = [float(large[k]) / 3.0 / float(small[k]) for k in ("stopping_time_ms", "depth_mm")]
            found.append((f"{case} {small['case']}", float(small["p_m_Pa"]), *ratios))
    return found


SINGLE = (
    "group",
    "case",
    "radius_mm",
    "speed_m_s",
    "p_m_Pa",
    "K0_Pa",
    "depth_mm",
    "stopping_time_ms",
    "viscous_share",
)
SINGLE_GROUPS = (
    "scaling",
    "bulk",
    "planar_K0",
    "planar_box",
    "planar_gravity",
    "planar_alpha",
    "planar_error",
    "wall",
    "K0",
)


def report(file: Path) -> str:
    """All tables as text."""
    study, heavy = Study(file), Study(file, {"gravity": 9.81})
    nominal = fit("nominal", *study.hypotheses()["nominal"])
    parts = [
        "p_m that each figure asks for, Pa",
        table(
            "figure | m v/A | round | planar raw | planar x 8/(3π) | planar / (8/(3π))", list_needed(study)
        ),
        f"Shapes: round p_m {nominal.p_m:.0f} Pa, planar 1300 Pa",
        table(
            "m v/A | T1 | T3 | D1/law | D3/law | s1 | s3 | planar T1 | T3 | D1/law | D3/law | s1 | s3",
            list_shapes(study, nominal.p_m, 1300.0),
        ),
        "Spacing in use over a finer one",
        table("runs | spacings a radius | speed | ln D | ln T_s", list_errors(study.rows, study)),
        "T_s ratio by the speed below which the projectile is called at rest",
        table("threshold, m/s | m v/A 1 | m v/A 1.75 | equal speed", list_thresholds(study, nominal.p_m)),
        "All hypotheses, p_m refitted, no gravity",
        fits_table(fit_all(study)),
        "All hypotheses, p_m refitted, with gravity",
        fits_table(fit_all(heavy)),
        "Pairs, no gravity",
        fits_table(
            replace(each, name=f"{each.name} + {b}") for _, b, each in fit_pairs(study, study.effects)[:8]
        ),
        "Run as they stand: χ² interpolated and of the runs",
        table(
            "effects | p_m, Pa | interpolated | runs | T1 | n(T1) | T3 | n(T3) | C1 | n(D1) | C3 | n(D3) | V | met",
            ((case, p_m, a, b, *people(f), facts_met(f)) for case, p_m, a, b, f in list_checked(study)),
        ),
        "A time offset and one effect, with gravity",
        fits_table(fit_with_offset(heavy)[:8]),
        "Fitted to T_s and D of 1 mm alone: gain in ln p of the other seven numbers, no gravity",
        table("hypothesis | p_m | amplitude | gain | χ² of the other seven", list_gains(study)),
        "Planar and round on the six of them that both have",
        table("model | p_m | χ² of six", compare_with_planar(study)),
        "The same, with gravity",
        table("hypothesis | p_m | amplitude | gain | χ² of the other seven", list_gains(heavy)),
        "A further measurement: expected information, bits (no gravity)",
        table("measurement | bits | predictions", list_information(study)),
        "At 0.197 m/s: T_s and D of 3 mm over three times those of 1 mm",
        table("effect | p_m | T_s | D", list_departures(study.rows)),
        "Single runs",
        table(
            " | ".join(SINGLE),
            ([row[k] for k in SINGLE] for row in study.rows if row["group"] in SINGLE_GROUPS),
        ),
    ]
    return "\n\n".join(parts)
