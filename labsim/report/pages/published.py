"""report.html of published figures: one file with everything in it, readable without labsim or a network."""

from __future__ import annotations

from pathlib import Path

from ...diagnosis.published.campaign import SummaryDiagnosis
from ..provenance import trace_origin
from ..tables import calibration_lines, scaling_lines, value_text, verdict_text
from .page import read_picture, show_number, write_html

PICTURES = {
    "penetration": "Raw penetration against time for five p_m, and the two published figures.",
    "depth_law": "Penetration depth against m v/A: the published law and the calibrated simulation.",
    "compacted_volume": "Dust compacted beyond a filling factor, and the published statement.",
    "density_field": "Filling factor under the projectile at the stop.",
    "fit": "Depth and stopping time against p_m, and p_m from every reading of the figures.",
    "corner": "Posterior of p_m, and of the depth and stopping time that go with it.",
}
BADGES = {"none": "What was not calibrated is predicted", "unknown": "Something is wrong"}


def write_page(diagnosis: SummaryDiagnosis, folder: Path) -> Path:
    """report.html from a diagnosis and the pictures that lie in the folder."""
    calibration = diagnosis.calibration
    campaign = calibration.campaign
    missed = sum(row.missed and not row.used for row in diagnosis.predictions)
    tested = sum(not row.used for row in diagnosis.predictions)
    q = calibration.quantiles
    sample = campaign.sample
    error = calibration.numerical[calibration.bulk_modulus]
    contents = [
        ("measurement", "What was measured", ""),
        ("predicted", "Figures predicted", str(tested)),
        ("calibration", "Calibration", ""),
        ("causes", "Causes", ""),
        ("numerics", "Numerical error", ""),
        ("warnings", "Warnings", str(len(diagnosis.warnings)) if diagnosis.warnings else ""),
        ("made", "Versions and hashes", ""),
    ]
    runs = f"{calibration.runs_new + diagnosis.runs_new} new, {calibration.runs_reused + diagnosis.runs_reused} from the store"
    return write_html(
        folder / "report.html",
        "summary.html",
        {},
        name=campaign.name,
        description=campaign.description,
        page_title="what the simulation gets wrong",
        tone=diagnosis.verdict.word,
        badge=BADGES[diagnosis.verdict.word],
        sentence=diagnosis.sentence,
        tiles=[
            ("p_m", f"{q['q50'] / 1e3:.2f} kPa", f"90 %: {q['q05'] / 1e3:.2f} to {q['q95'] / 1e3:.2f} kPa"),
            ("figures missed", f"{missed} of {tested}", "of those not calibrated on"),
            ("p-value of all predictions", show_number(diagnosis.p_value, "{:.2g}"), ""),
        ],
        contents=contents,
        measurement=f"{len(campaign.drops)} drops and {len(campaign.published_scans)} compaction figures as published, into dust "
        f"of filling factor {sample.filling_factor:g} ± {sample.filling_factor_sigma:g}. The simulation is {campaign.geometry}.",
        assumed=list(campaign.source.items()),
        verdict=verdict_text(diagnosis),
        rows=diagnosis.predictions,
        drops=diagnosis.drop_predictions,
        further=scaling_lines(diagnosis),
        value=value_text,
        pictures={name: read_picture(folder / f"{name}.png", text) for name, text in PICTURES.items()},
        calibration=calibration_lines(calibration),
        numerics=f"Halving the spacing from {error.spacings[0] * 1e6:.3g} µm changes the raw depth by "
        f"{100 * error.relative('depth'):.2g} % and the stopping time by {100 * error.relative('stopping_time'):.2g} %; both "
        "changes are part of the errors.",
        warnings=diagnosis.warnings,
        made=trace_origin(
            campaign, [("runs", runs), ("wall time", f"{calibration.wall + diagnosis.wall:.0f} s")]
        ),
    )
