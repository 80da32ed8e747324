"""``labsim strength``: static tests become the law of the strengths."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..errors import CampaignError, LabsimError
from ..records import STRENGTH_KINDS
from ..text_files import load_json
from . import options


def strength(
    campaign: Annotated[Path, typer.Argument(help="Campaign folder with strength/NAME/strength.toml.")],
    out: options.Out = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", help="Output of labsim calibrate: its p_m is the dynamic strength."),
    ] = None,
    pictures: options.Pictures = None,
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Fit the curves of static compression, tension and shear tests, and compare them with the drops' p_m."""
    from ..inference.fits.fitting import REJECTED
    from ..inference.observations.linearised_drop import ErrorBudget
    from ..inference.observations.static_tests import PARAMETERS, fit_softness, fit_strength
    from ..report.figures.strengths import draw_strength

    read = read_campaign(campaign)
    if not read.strength_tests:
        raise CampaignError(
            read.folder / "strength", "", "holds no test; add strength/S01/strength.toml (docs: static tests)"
        )
    dynamic = None if calibration is None else _read_dynamic(calibration)
    scatter = ErrorBudget().scatter if read.sample.scatter is None else read.sample.scatter
    by_kind = {kind: [t for t in read.strength_tests if t.kind == kind] for kind in STRENGTH_KINDS}
    fits = [fit_strength(kind, tests, scatter) for kind, tests in by_kind.items() if tests]
    folder = options.make_output_folder(out, campaign, "strength")
    draw_strength(read, fits, folder / "strength.png", dynamic and dynamic[0])
    lines, warnings = [], []
    summary: dict[str, Any] = {"campaign": read.name, "scatter": scatter, "fits": {}}
    for fit in fits:
        sigma, units = fit.sigma, dict(PARAMETERS[fit.kind])
        summary["fits"][fit.kind] = {
            "tests": list(fit.tests),
            "points": fit.points,
            "parameters": {
                name: {"value": value, "sigma": sigma[name], "unit": units[name]}
                for name, value in fit.values.items()
            },
            "covariance": fit.covariance.tolist(),
            "chi_square": fit.chi_square,
            "p_value": fit.p_value,
        }
        said = ", ".join(_say(name, value, sigma[name], units[name]) for name, value in fit.values.items())
        lines.append(f"{fit.kind.replace('_', ' ')} ({', '.join(fit.tests)}, {fit.points} rows): {said}")
        if fit.p_value < REJECTED:
            warnings.append(
                f"{fit.kind}: the curve does not explain its rows (p = {fit.p_value:.2g}); relative_sigma is too small, or the "
                "dust has another law"
            )
    if tests := by_kind["compression_omnidirectional"]:
        p_m, sigma_ln, p_value = fit_softness(tests, read.material, scatter)
        summary["static_p_m"] = {"value": p_m, "sigma": p_m * sigma_ln, "unit": "Pa", "p_value": p_value}
        lines.append(
            f"with φ1, φ2 and Δ of campaign.toml: p_m = {p_m / 1e3:.3g} ± {p_m * sigma_ln / 1e3:.2g} kPa (p = {p_value:.2g})"
        )
        if dynamic is not None:
            ratio, width = p_m / dynamic[0], math.hypot(sigma_ln, dynamic[1])
            ends = [ratio * math.exp(side * 1.645 * width) for side in (-1, 1)]
            summary["static_over_dynamic"] = {"q05": ends[0], "q50": ratio, "q95": ends[1]}
            lines.append(f"static over dynamic p_m: {ratio:.3g} (90 %: {ends[0]:.3g} to {ends[1]:.3g})")
    summary["warnings"] = warnings
    options.write_json(folder / "strength.json", summary)
    text = "\n".join([*lines, *(f"  warning: {each}" for each in warnings)])
    options.finish(
        summary,
        f"{text}\n\nwritten to {options.shorten_path(folder)}",
        as_json=as_json,
        quiet=quiet,
        folder=folder,
    )


def _say(name: str, value: float, sigma: float, unit: str) -> str:
    factor, shown = (1e-3, " kPa") if unit == "Pa" else (1.0, "")
    return f"{name} = {value * factor:.4g} ± {sigma * factor:.2g}{shown}"


def _read_dynamic(path: Path) -> tuple[float, float]:
    """p_m (Pa) of a calibration, and the standard deviation of its logarithm."""
    file = path / "calibration.json" if path.is_dir() else path
    found = load_json(file, LabsimError, "give the output folder of labsim calibrate")
    try:
        mean, sd = (float(found["p_m_Pa"][key]) for key in ("mean", "sd"))
    except (KeyError, TypeError, ValueError):
        raise LabsimError(file, "p_m_Pa", "is missing; give the output folder of labsim calibrate") from None
    return mean, sd / mean
