"""What ``calibrate`` and ``diagnose`` write of a result into a folder: summary, posterior, model, pictures and page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .. import text_files
from ..campaign_tables import MATERIAL_KEYS
from ..diagnosis.campaign import Diagnosis
from ..diagnosis.published.campaign import SummaryDiagnosis
from ..effects import Model, list_effects, write_model
from ..inference.calibrate import Calibration
from ..inference.fits.fitting import Fit
from ..inference.fits.posterior import Posterior
from ..inference.published.calibrate import SummaryCalibration
from .campaign_tables import (
    campaign_calibration_lines,
    campaign_calibration_summary,
    campaign_diagnosis_lines,
    campaign_diagnosis_summary,
    extended_model,
    state_numerical_error,
)
from .figures import campaign as figures
from .figures.laws import draw_laws
from .figures.published import (
    draw_compacted_volume,
    draw_corner,
    draw_depth_law,
    draw_fit,
    draw_penetration,
)
from .figures.runs import draw_density_field
from .figures.strengths import draw_tests, find_tests
from .pages.campaign import write_calibration_page, write_campaign_page
from .pages.drop_views import DropView, list_fits, list_posteriors, view_drops
from .pages.map_views import MapView, measure_maps, view_maps
from .pages.published import write_page
from .pages.pushes import lay_misfit, lay_pushes, view_pushes, write_push_calibration, write_push_diagnosis
from .tables import calibration_lines, calibration_summary, diagnosis_lines, diagnosis_summary

Found = Calibration | Diagnosis | SummaryCalibration | SummaryDiagnosis
Write = Callable[[Path, dict[str, Any]], Path]


def write_result(
    found: Found, folder: Path, write_json: Write = text_files.write_json
) -> tuple[dict[str, Any], str]:
    """Write all files of a result into a folder that exists.

    Parameters
    ----------
    found : Calibration, Diagnosis, SummaryCalibration or SummaryDiagnosis
    folder : Path
    write_json : callable
        Writes the summary file; the command line puts in what made the result.

    Returns
    -------
    summary : dict
        What the JSON file holds, SI.
    lines : str
        The same for people.
    """
    if isinstance(found, Calibration):
        return _write_calibration(found, folder, write_json)
    if isinstance(found, Diagnosis):
        return _write_diagnosis(found, folder, write_json)
    if isinstance(found, SummaryCalibration):
        return _write_summary_calibration(found, folder, write_json)
    return _write_summary_diagnosis(found, folder, write_json)


def say_result(found: Any) -> str | None:
    """What the command prints of a result; None of what is none."""
    if isinstance(found, Calibration):
        return campaign_calibration_lines(found)
    if isinstance(found, Diagnosis):
        return campaign_diagnosis_lines(found)
    if isinstance(found, SummaryCalibration):
        return calibration_lines(found)
    return diagnosis_lines(found) if isinstance(found, SummaryDiagnosis) else None


def plot_drops(found: Calibration | Diagnosis, figure: Figure | None = None) -> list[tuple[Axes, Axes]]:
    """Every drop measured and simulated, and below it what is left; of pushes all at once and their misfit. Pairs of axes."""
    fits = list_fits(found)
    if found.problem.pushed:
        pushes = view_pushes(found.problem, fits)
        drawn = plt.figure(figsize=(12.0, 4.6), layout="constrained") if figure is None else figure
        left, right = drawn.subplots(1, 2)
        lay_pushes(pushes, left)
        lay_misfit(pushes, right)
        return [(left, right)]
    views = view_drops(found.problem, fits)
    drawn = plt.figure(figsize=figures.size_drops(views)) if figure is None else figure
    return figures.lay_drops(views, drawn)


def _write_calibration(found: Calibration, folder: Path, write_json: Write) -> tuple[dict, str]:
    summary = campaign_calibration_summary(found)
    write_json(folder / "calibration.json", summary)
    _write_posterior(found.posterior, folder)
    if found.problem.pushed:
        write_push_calibration(found, folder)
        return summary, campaign_calibration_lines(found)
    figures.draw_posterior(found.posterior, folder / "corner.png")
    views, maps = _draw_fits(found, list_fits(found), folder)
    (folder / "drops.png").rename(folder / "fit.png")
    figures.draw_p_m([("calibrated", found.posterior)], folder / "posterior.png")
    write_calibration_page(found, summary, state_numerical_error(found.problem), views, maps, folder)
    return summary, campaign_calibration_lines(found)


def _write_diagnosis(found: Diagnosis, folder: Path, write_json: Write) -> tuple[dict, str]:
    summary = campaign_diagnosis_summary(found)
    write_json(folder / "diagnosis.json", summary)
    write_model(folder / "model.toml", extended_model(found), list_effects(found.campaign))
    _write_posterior(found.posterior_extended, folder)
    if found.problem.pushed:
        write_push_diagnosis(found, summary, folder)
        return summary, campaign_diagnosis_lines(found)
    fits = list_fits(found)
    views, maps = _draw_fits(found, fits, folder)
    figures.draw_causes(found, folder / "causes.png")
    (folder / "law.png").unlink(missing_ok=True)
    if found.verdict.word == "unknown" and found.unknown.laws:
        learned = found.learned.best if found.learned else None
        draw_laws(found.unknown.laws, folder / "law.png", learned)
    figures.draw_held_out(found, [name for name, _ in fits], folder / "held_out.png")
    figures.draw_p_m(list_posteriors(found), folder / "posterior.png")
    figures.draw_posterior(found.posterior_extended, folder / "corner.png")
    write_campaign_page(found, summary, views, maps, folder)
    return summary, campaign_diagnosis_lines(found)


def _write_summary_calibration(
    found: SummaryCalibration, folder: Path, write_json: Write
) -> tuple[dict, str]:
    summary = calibration_summary(found)
    write_json(folder / "calibration.json", summary)
    _write_posterior(found.posterior, folder)
    draw_corner(found, folder / "corner.png")
    draw_fit(found, folder / "fit.png")
    return summary, calibration_lines(found)


def _write_summary_diagnosis(found: SummaryDiagnosis, folder: Path, write_json: Write) -> tuple[dict, str]:
    calibration = found.calibration
    _write_summary_calibration(calibration, folder, write_json)
    summary = diagnosis_summary(found)
    write_json(folder / "diagnosis.json", summary)
    q = calibration.quantiles
    material = calibration.campaign.material.replace(bulk_modulus=calibration.bulk_modulus)
    fields = [field for field, _low, _high in MATERIAL_KEYS.values()]
    write_model(
        folder / "model.toml",
        Model(q["q50"], material=tuple((field, getattr(material, field)) for field in fields)),
        comments=[
            f"{calibration.campaign.name}: p_m calibrated on {' and '.join(calibration.use)}, planar, "
            f"90 % between {q['q05']:.0f} and {q['q95']:.0f} Pa"
        ],
    )
    draw_penetration(calibration, folder / "penetration.png")
    draw_depth_law(found, folder / "depth_law.png")
    draw_compacted_volume(found, folder / "compacted_volume.png")
    draw_density_field(calibration.finest_run, folder / "density_field.png")
    write_page(found, folder)
    return summary, diagnosis_lines(found)


def _write_posterior(posterior: Posterior, folder: Path) -> None:
    (folder / "posterior.nc").unlink(missing_ok=True)
    posterior.data.to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")


def _draw_fits(
    found: Calibration | Diagnosis, fits: list[tuple[str, Fit]], folder: Path
) -> tuple[list[DropView], list[MapView]]:
    """Pictures of drops and scans with each named fit, and the views that the page shows of them."""
    views = view_drops(found.problem, fits)
    figures.draw_drops(views, folder / "drops.png")
    figures.draw_misfit(views, folder / "misfit.png")
    maps = measure_maps(found.campaign, view_maps(found.problem, fits))
    if maps:
        figures.draw_maps(maps, folder / "maps.png")
    (folder / "tests.png").unlink(missing_ok=True)
    if find_tests(found.problem, [])[0]:
        draw_tests(found.problem, fits, folder / "tests.png")
    if found.problem.undisturbed:
        figures.draw_undisturbed(found.problem, folder / "undisturbed.png")
    return views, maps
