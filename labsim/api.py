"""The verbs of labsim for scripts and notebooks: records in, records out, nothing written but stored runs.

Each function is a few lines over the layer that does the work; the command line does the same and writes files. In a script
(not in a notebook) long work belongs under ``if __name__ == "__main__":``, since worker processes import the script again; or
say ``workers=1``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import CampaignError
from .records import Campaign, CompressedVolume, DecelerationCurve, Drop, FloatArray, Measured, Scan, Track

if TYPE_CHECKING:  # pragma: no cover
    import pandas as pd

    from .ct import ReducedScan
    from .diagnosis.campaign import Diagnosis
    from .diagnosis.summary import SummaryDiagnosis
    from .inference.calibrate import Calibration
    from .inference.runs import RunStore
    from .inference.summary import SummaryCalibration
    from .sph import DropRun, DropSetting
    from .video.following import Progress


def track(
    source: Path | str | Drop,
    *,
    frame_rate: float | None = None,
    pixel_size: float | None = None,
    pixel_size_sigma: float = 0.0,
    rod_diameter: float | None = None,
    rod_diameter_sigma: float = 0.0,
    ruler: Path | str | None = None,
    ruler_step: float = 1e-3,
    surface_row: float | None = None,
    surface_row_sigma: float = 0.15,
    row_sigma: float | None = None,
    rotate: int = 0,
    frames: tuple[int, int] | None = None,
    columns: Mapping[str, str] | None = None,
    particle: str | None = None,
    progress: Progress | None = None,
) -> tuple[Track, DecelerationCurve | None]:
    """Follow a projectile, or read a finished track, and fit its motion.

    source : a drop of a campaign, its folder, a video, a folder of pictures, or a track file of any format labsim reads.
    frame_rate : Hz. pixel_size and its sigma : m. rod_diameter and its sigma : m, of a rod or bead that gives the scale.
    ruler : picture of one, with ticks every ruler_step (m). surface_row, surface_row_sigma, row_sigma : px, rows grow downwards.
    rotate : degrees, anticlockwise. frames : first and last picture to use. columns : what a table's columns are, as
    {"time_ms": "t", "depth_mm": "z"}. particle : which of several tracks. What is left out comes from the drop, or for a video
    from its own pictures (surface).

    Returns the track (rows, px) and the deceleration curve (SI, time zero at contact); of a video without scale, surface or
    contact the track and None, with the reason among its warnings. Raises MeasurementError where something is not known or
    nothing can be tracked.
    """
    from .tracking import measure, read_request

    tracked = measure(
        read_request(
            source,
            frame_rate=frame_rate,
            pixel_size=None if pixel_size is None else Measured(pixel_size, pixel_size_sigma),
            rod_diameter=None if rod_diameter is None else Measured(rod_diameter, rod_diameter_sigma),
            ruler=None if ruler is None else Path(ruler),
            ruler_step=ruler_step,
            surface_row=surface_row,
            surface_row_sigma=surface_row_sigma,
            row_sigma=row_sigma,
            rotate=rotate,
            frames=frames,
            columns=columns,
            particle=particle,
        ),
        progress,
    )
    return tracked.track, tracked.curve


def reduce_scan(source: Path | str | Scan, **settings: Any) -> ReducedScan:
    """Slices to the axisymmetric map of the filling factor; its ``map`` is a FillingMap.

    source : a scan of a campaign or its folder. settings : as ``labsim.ct.reduce_scan`` takes them (cell, guard …).
    Raises CampaignError, MeasurementError.
    """
    from . import ct
    from .campaign import read_scan

    scan = source if isinstance(source, Scan) else read_scan(source)
    if not isinstance(scan, Scan):
        raise CampaignError(
            source, "scan.slices", "gives published figures, not slices; there is nothing to reduce"
        )
    return ct.reduce_scan(scan, **settings)


def simulate(
    setting: DropSetting | Sequence[DropSetting],
    *,
    store: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Any:
    """Simulate one drop, or many at once; what the store holds is read, not run.

    setting : labsim.DropSetting. store : folder of the stored runs (default: LABSIM_STORE or the user's cache). workers :
    processes (default: one a core). scheduler : address of a Dask scheduler. Returns a DropRun, or a list in the same order.
    Raises SimulationError for a setting outside the solver's limits or a run that failed.
    """
    from .inference.runs import require_runs
    from .sph import DropSetting, check_setting

    single = isinstance(setting, DropSetting)
    wanted = [setting] if isinstance(setting, DropSetting) else list(setting)
    for each in wanted:
        check_setting(each)
    runs: list[DropRun] = require_runs(_open(store).get_many(wanted, workers=workers, scheduler=scheduler))
    return runs[0] if single else runs


def calibrate(
    campaign: Campaign | Path | str,
    parameters: Sequence[str] = ("p_m",),
    *,
    store: Path | str | None = None,
    **settings: Any,
) -> Calibration | SummaryCalibration:
    """The posterior of p_m (Pa), and of effects named in ``parameters``.

    settings : workers, scheduler, seed, progress, and what ``labsim.inference.calibrate.calibrate`` takes for tracks and
    ``labsim.inference.summary.calibrate_summary`` for published figures. Raises LabsimError.
    """
    read = _read(campaign)
    if read.has_records:
        from .inference.calibrate import calibrate as calibrate_tracks

        return calibrate_tracks(read, parameters, store=_open(store), **settings)
    from .inference.summary import calibrate_summary

    return calibrate_summary(read, _open(store), **settings)


def diagnose(
    campaign: Campaign | Path | str, *, store: Path | str | None = None, **settings: Any
) -> Diagnosis | SummaryDiagnosis:
    """What the calibrated simulation gets wrong about a campaign, why, and what an extended model gains.

    settings : workers, scheduler, progress, and for tracks what ``labsim.diagnosis.campaign.diagnose_campaign`` takes
    (seed, cells). Raises LabsimError.
    """
    read, opened = _read(campaign), _open(store)
    if read.has_records:
        from .diagnosis.campaign import diagnose_campaign

        return diagnose_campaign(read, opened, **settings)
    from .diagnosis.summary import diagnose_summary
    from .inference.summary import calibrate_summary

    return diagnose_summary(calibrate_summary(read, opened, **settings), opened, **settings)


def write_report(
    found: Diagnosis | Calibration | SummaryDiagnosis | SummaryCalibration,
    folder: Path | str,
    formats: Sequence[str] = (),
) -> Path:
    """Write what ``labsim diagnose`` or ``labsim calibrate`` writes of a result: report, numbers, posterior and pictures.

    Parameters
    ----------
    found : Diagnosis, Calibration, SummaryDiagnosis or SummaryCalibration
        What ``labsim.diagnose`` or ``labsim.calibrate`` returned.
    folder : Path or str
        It is made where it is missing; ``labsim.load`` reads it again.
    formats : sequence of str, optional
        Of pictures beside PNG: ``"pdf"``, ``"svg"``.

    Returns
    -------
    Path
        The folder. ``report.html`` in it is one file with all pictures (of published figures: of a diagnosis only).
    """
    from .report.formats import further_formats
    from .report.outputs import write_result
    from .results import SAID

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    token = further_formats.set(tuple(formats))
    try:
        _, lines = write_result(found, folder)
    finally:
        further_formats.reset(token)
    (folder / SAID).write_text(lines + "\n", encoding="utf-8")
    return folder


def tabulate(thing: Track | DecelerationCurve | CompressedVolume | DropRun) -> pd.DataFrame:
    """A pandas table, one line a frame, instant or threshold; its columns are those of the CSV files, with units.

    Maps are not tables: ``labsim.ct.make_dataset(reduced)`` gives xarray. Raises TypeError for anything else.
    """
    import pandas as pd

    if isinstance(thing, Track):
        from .video import tabulate_track

        return tabulate_track(thing)
    if isinstance(thing, DecelerationCurve):
        from .video import tabulate_curve

        return tabulate_curve(thing)
    if isinstance(thing, CompressedVolume):
        return pd.DataFrame({"phi": thing.filling_factor, "volume_m3": thing.volume, "sigma": thing.sigma})
    from .sph import DropRun

    if isinstance(thing, DropRun):
        force = (
            "force_N_m" if thing.setting.geometry == "planar" else "force_N"
        )  # planar: per metre of cylinder
        columns: dict[str, FloatArray] = {"time_s": thing.time, "depth_m": thing.depth}
        return pd.DataFrame({**columns, "velocity_m_s": thing.velocity, force: thing.force})
    raise TypeError(
        f"{type(thing).__name__} is no table; give a Track, DecelerationCurve, CompressedVolume or DropRun"
    )


def _read(campaign: Campaign | Path | str) -> Campaign:
    if isinstance(campaign, Campaign):
        return campaign
    from .campaign import read_campaign

    return read_campaign(campaign)


def _open(store: Path | str | None) -> RunStore:
    from .inference.runs import RunStore

    return RunStore(store)
