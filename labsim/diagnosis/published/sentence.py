"""What a diagnosis of published figures says in a few sentences, made of its numbers."""

from __future__ import annotations

from collections.abc import Sequence

from ...inference.published.calibrate import SummaryCalibration
from ...inference.published.readings import Reading
from .prediction import Prediction
from .sizes import SizeScaling

OWN_LENGTH = 0.02  # from how much the exponent of T_s ∝ R^n is off one that the simulation is said to have a length of its own


def say_summary(
    calibration: SummaryCalibration,
    rows: Sequence[Prediction],
    scaling: SizeScaling | None,
    conflict: tuple[Reading, Reading, float] | None,
) -> str:
    """What is missed and kept, how the stopping time grows with size, and what depth and stopping time ask for."""
    used = " and ".join(dict.fromkeys(kind.replace("_", " ") for kind in calibration.use))
    drops = ", ".join(dict.fromkeys(figure.drop for figure in calibration.figures))
    q = calibration.quantiles
    others = [row for row in rows if not row.used]
    missed = sorted((row for row in others if row.missed), key=lambda row: -abs(row.deviation))
    names = [f"{row.name} ({row.deviation:+.1f} σ)".replace("-", "−") for row in missed]
    said = [
        f"Calibrated on the {used} of {drops} (p_m = {q['q50'] / 1e3:.2f} kPa, 90 %: {q['q05'] / 1e3:.2f} to "
        f"{q['q95'] / 1e3:.2f}), the simulation misses {len(missed) or 'none'} of {len(others)} other figures"
        + (f": {'; '.join(names)}." if names else ".")
    ]
    if scaling is not None:
        none = ": it has no length of its own" if abs(scaling.exponent - 1.0) < OWN_LENGTH else ""
        said.append(
            f"From {2e3 * scaling.small:g} to {2e3 * scaling.large:g} mm its stopping time grows {scaling.ratio_equal_speed:.2f} "
            f"times at equal speed{none}; {scaling.observed:.2f} ± {scaling.observed_sigma:.2f} was measured."
        )
    if conflict is not None:
        depth, stop, sigma = conflict
        relation = "overlap" if _overlap(depth, stop) else "exclude each other"
        said.append(
            f"The depth asks for p_m = {depth.q50 / 1e3:.2f} kPa, the stopping time for {stop.q50 / 1e3:.2f} kPa: their 90 % "
            f"intervals {relation} ({abs(sigma):.1f} σ)."
        )
    return " ".join(said)


def _overlap(a: Reading, b: Reading) -> bool:
    return a.q05 <= b.q95 and b.q05 <= a.q95
