"""What people read on the terminal: the same numbers as in the JSON files, in mm, ms and kPa."""

from __future__ import annotations

from typing import Any

from ..diagnosis.published.campaign import SummaryDiagnosis
from ..diagnosis.published.prediction import Prediction, people
from ..inference.published.calibrate import REFERENCE_P_M, SummaryCalibration
from ..inference.published.planar import ALPHA, READINGS
from .pages.phrases import state_p_value

VERDICTS = {
    "none": "what was not calibrated is predicted within its errors",
    "unknown": "something is wrong; published figures alone carry no search for its cause",
}


def calibration_lines(calibration: SummaryCalibration) -> str:
    """The posterior of p_m, every other reading beside it, and the numerical error."""
    q = calibration.quantiles
    used = " and ".join(kind.replace("_", " ") for kind in calibration.use)
    drops = ", ".join(dict.fromkeys(figure.drop for figure in calibration.figures))
    lines = [
        f"p_m = {q['q50'] / 1e3:.2f} kPa, 90 % between {q['q05'] / 1e3:.2f} and {q['q95'] / 1e3:.2f} kPa, from the {used} "
        f"of {drops} (K0 {calibration.bulk_modulus / 1e3:g} kPa"
        + (f", {READINGS[calibration.depth_reading]})" if "depth" in calibration.use else ")"),
    ]
    if len(calibration.readings) > 1:
        lines += ["", "What other readings of the same figures give (p_m in kPa, 90 %; χ² of the best p_m):"]
        moduli = sorted({r.bulk_modulus for r in calibration.readings}, reverse=True)
        head = (
            "  "
            + f"{'figures, planar factor':40s}"
            + "".join(f"{f'K0 {k0 / 1e3:g} kPa':>26s}" for k0 in moduli)
        )
        lines.append(head)
        keys = list(dict.fromkeys((r.use, r.depth_reading) for r in calibration.readings))
        for use, reading in keys:
            name = " + ".join(use).replace("_", " ") + (f", {reading}" if "depth" in use else "")
            row = f"  {name:40s}"
            for k0 in moduli:
                r = next(
                    r
                    for r in calibration.readings
                    if (r.use, r.depth_reading, r.bulk_modulus) == (use, reading, k0)
                )
                misfit = f" χ² {r.misfit:.1f}" if len(use) > 1 else ""
                row += f"{f'{r.q50 / 1e3:.2f} ({r.q05 / 1e3:.2f}-{r.q95 / 1e3:.2f}){misfit}':>26s}"
            lines.append(row)
    lines += [
        "",
        f"Raw planar drop at p_m = {REFERENCE_P_M / 1e3:g} kPa, α = {ALPHA:g}, and its change when the spacing is halved:",
    ]
    for k0, error in sorted(calibration.numerical.items(), reverse=True):
        (d1, d2), (t1, t2) = error.depth, error.stopping_time
        lines.append(
            f"  K0 {k0 / 1e3:5g} kPa: D {d1 * 1e3:.3f} -> {d2 * 1e3:.3f} mm ({d2 / d1 - 1:+.1%}), "
            f"T_s {t1 * 1e3:.2f} -> {t2 * 1e3:.2f} ms ({t2 / t1 - 1:+.1%}), dlnD/dlnp_m {calibration.slopes[k0]:+.2f}"
        )
    return "\n".join(lines + warning_lines(calibration.warnings))


def diagnosis_lines(diagnosis: SummaryDiagnosis) -> str:
    """What is missed in words, and the table."""
    lines = [
        diagnosis.sentence,
        "",
        f"  {'figure':26s}{'published':>22s}{'simulation':>22s}{'deviation':>12s}",
    ]
    for row in diagnosis.predictions:
        mark = "calibrated on" if row.used else "MISSED" if row.missed else "kept"
        lines.append(
            f"  {row.name:26s}{value_text(row, 'observed'):>22s}{value_text(row, 'predicted'):>22s}"
            f"{row.deviation:>+10.1f} σ  {mark}"
        )
    if further := scaling_lines(diagnosis):
        lines += ["", *(f"  {line}" for line in further)]
    lines += ["", verdict_text(diagnosis)]
    return "\n".join(lines + warning_lines(diagnosis.warnings))


def scaling_lines(diagnosis: SummaryDiagnosis) -> list[str]:
    """How depth and stopping time scale with size and speed, beside what is published."""
    lines = []
    if (scaling := diagnosis.scaling) is not None:
        small, large = 2e3 * scaling.small, 2e3 * scaling.large
        lines.append(
            f"T_s({large:g} mm)/T_s({small:g} mm): published {scaling.observed:.2f} ± {scaling.observed_sigma:.2f}; simulation "
            f"{scaling.ratio_equal_speed:.2f} at {scaling.speed:.2f} m/s for both, "
            f"{scaling.ratio_equal_momentum:.2f} ± {scaling.ratio_equal_momentum_sigma:.2f} at equal m v/A"
        )
    if diagnosis.exponents:
        found = ", ".join(f"{n:.2f} ± {s:.2f} ({2e3 * r:g} mm)" for r, (n, s) in diagnosis.exponents.items())
        lines.append(f"D ∝ (m v/A)^n: published n = 1; simulation {found}")
    return lines


def verdict_text(diagnosis: SummaryDiagnosis) -> str:
    return (
        f"verdict: {diagnosis.verdict.word} ({state_p_value(diagnosis.p_value)} for all predictions together): "
        f"{VERDICTS[diagnosis.verdict.word]}"
    )


def warning_lines(warnings: tuple[str, ...]) -> list[str]:
    return [f"warning: {warning}" for warning in warnings]


def calibration_summary(calibration: SummaryCalibration) -> dict[str, Any]:
    """calibration.json."""
    return {
        "format": 1,
        "campaign": calibration.campaign.name,
        "use": list(calibration.use),
        "planar_correction": calibration.depth_reading,
        "bulk_modulus_Pa": calibration.bulk_modulus,
        "p_m_Pa": calibration.quantiles,
        "r_hat": calibration.posterior.r_hat,
        "ess": calibration.posterior.ess,
        "readings": [
            {
                "use": list(r.use),
                "planar_correction": r.depth_reading,
                "bulk_modulus_Pa": r.bulk_modulus,
                "p_m_Pa": {"q05": r.q05, "q50": r.q50, "q95": r.q95},
                "misfit_chi2": r.misfit,
                "at_prior_limit": r.at_limit,
            }
            for r in calibration.readings
        ],
        "spacing_study": [
            {
                "bulk_modulus_Pa": e.bulk_modulus,
                "p_m_Pa": e.p_m,
                "spacings_m": list(e.spacings),
                "artificial_viscosity": ALPHA,
                "penetration_depth_m": list(e.depth),
                "stopping_time_s": list(e.stopping_time),
                "dlnD_dlnp_m": calibration.slopes[k0],
            }
            for k0, e in calibration.numerical.items()
        ],
        "runs_new": calibration.runs_new,
        "runs_reused": calibration.runs_reused,
        "wall_s": calibration.wall,
        "warnings": list(calibration.warnings),
    }


def diagnosis_summary(diagnosis: SummaryDiagnosis) -> dict[str, Any]:
    """diagnosis.json: the contract's keys, and the table and sentence of published figures."""
    calibration = diagnosis.calibration
    error = calibration.numerical[calibration.bulk_modulus]
    scaling = diagnosis.scaling
    return {
        "format": 1,
        "campaign": calibration.campaign.name,
        "verdict": diagnosis.verdict.word,
        "p_value": diagnosis.p_value,
        "causes": [
            {"causes": list(causes), "probability": probability, "parameters": {}}
            for causes, probability in diagnosis.verdict.probabilities
        ],
        "classes": [],
        "confusable": [],
        "p_m_Pa": {"nominal": calibration.quantiles},
        "sentence": diagnosis.sentence,
        "predictions": [_row(row) for row in diagnosis.predictions],
        "drops": [_row(row) for row in diagnosis.drop_predictions],
        "stopping_time_ratio": None
        if scaling is None
        else {
            "radii_m": [scaling.small, scaling.large],
            "published": scaling.observed,
            "published_sigma": scaling.observed_sigma,
            "equal_speed": scaling.ratio_equal_speed,
            "equal_speed_exponent_of_radius": scaling.exponent,
            "equal_momentum_per_area": scaling.ratio_equal_momentum,
            "equal_momentum_per_area_sigma": scaling.ratio_equal_momentum_sigma,
        },
        "depth_exponents": [{"radius_m": r, "n": n, "sigma": s} for r, (n, s) in diagnosis.exponents.items()],
        "numerical_error": {"depth_relative": error.relative("depth"), "spacing_m": error.spacings[0]},
        "runs_new": calibration.runs_new + diagnosis.runs_new,
        "runs_reused": calibration.runs_reused + diagnosis.runs_reused,
        "wall_s": calibration.wall + diagnosis.wall,
        "warnings": list(diagnosis.warnings),
    }


def _row(row: Prediction) -> dict[str, Any]:
    return {
        "figure": row.name,
        "unit": row.unit,
        "published": row.observed,
        "published_sigma": row.observed_sigma,
        "simulation": row.predicted,
        "simulation_sigma": row.predicted_sigma,
        "deviation_sigma": row.deviation,
        "missed": row.missed,
        "used": row.used,
        "note": row.note,
    }


def value_text(row: Prediction, which: str) -> str:
    """``observed`` or ``predicted`` of a row with its sigma, in the unit people use."""
    factor, unit, digits = people(row)
    value, sigma = getattr(row, which) * factor, getattr(row, f"{which}_sigma") * factor
    short = {"sphere volumes": "V", "1e-4 m² s/kg": "e-4"}.get(unit, unit)
    return f"{value:.{digits}f} ± {sigma:.{digits}f} {short}"
