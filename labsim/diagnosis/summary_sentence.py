"""What a diagnosis of published figures says in one sentence, made of its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..inference.readings import Reading
from ..inference.summary import SummaryCalibration
from .prediction import Prediction, describe
from .published_sizes import SizeScaling


def say_summary(
    calibration: SummaryCalibration,
    rows: Sequence[Prediction],
    scaling: SizeScaling | None,
    conflict: tuple[Reading, Reading, float] | None,
) -> str:
    """The one sentence, made of the numbers."""
    used = " and ".join(dict.fromkeys(kind.replace("_", " ") for kind in calibration.use))
    q = calibration.quantiles
    open_rows = [row for row in rows if not row.used]
    missed = sorted((row for row in open_rows if row.missed), key=lambda row: -abs(row.deviation))
    kept = [row for row in open_rows if not row.missed]
    begin = (
        f"Calibrated on the {used} of {', '.join(dict.fromkeys(f.drop for f in calibration.figures))} "
        f"(p_m = {q['q50'] / 1e3:.2f} kPa, 90 % between {q['q05'] / 1e3:.2f} and {q['q95'] / 1e3:.2f}), the simulation "
    )
    if missed:
        begin += "misses " + "; ".join(describe(row) for row in missed)
    else:
        begin += "misses none of the other figures"
    if kept:
        begin += "; it keeps " + " and ".join(
            f"the {row.name}" if row.kind == "compacted_volume" else row.name for row in kept
        )
    parts = [begin]
    if scaling is not None:
        away = (scaling.ratio_equal_speed - scaling.observed) / math.hypot(
            scaling.ratio_equal_speed_sigma, scaling.observed_sigma
        )
        parts.append(
            f"from {2e3 * scaling.small:g} to {2e3 * scaling.large:g} mm at equal speed its stopping time grows "
            f"{scaling.ratio_equal_speed:.2f} times (T_s ∝ R^{scaling.exponent:.2f}: it has no length of its own), "
            f"at equal m v/A {scaling.ratio_equal_momentum:.2f} times, where {scaling.observed:.2f} ± "
            f"{scaling.observed_sigma:.2f} was measured ({abs(away):.0f} σ at equal speed)"
            if abs(scaling.exponent - 1.0) < 0.02
            else f"from {2e3 * scaling.small:g} to {2e3 * scaling.large:g} mm at equal speed its stopping time grows "
            f"{scaling.ratio_equal_speed:.2f} times, at equal m v/A {scaling.ratio_equal_momentum:.2f} times, where "
            f"{scaling.observed:.2f} ± {scaling.observed_sigma:.2f} was measured"
        )
    if conflict is not None:
        depth, stop, sigma = conflict
        relation = "exclude each other" if not _overlap(depth, stop) else "overlap"
        parts.append(
            f"the depth asks for p_m = {depth.q50 / 1e3:.2f} kPa and the stopping time for {stop.q50 / 1e3:.2f} kPa: "
            f"their 90 % intervals {relation} ({abs(sigma):.1f} σ)"
        )
    return "; ".join(parts) + "."


def _overlap(a: Reading, b: Reading) -> bool:
    return a.q05 <= b.q95 and b.q05 <= a.q95
