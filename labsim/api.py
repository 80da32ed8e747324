"""The verbs of labsim for scripts and notebooks: records in, records out, nothing written but stored runs.

Each function is a few lines over the layer that does the work; the command line does the same and writes files. In a script
(not in a notebook) long work belongs under ``if __name__ == "__main__":``, since worker processes import the script again; or
say ``workers=1``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack, overload

import numpy as np
import numpy.typing as npt

from .errors import CampaignError, MeasurementError
from .records import Campaign, CompressedVolume, DecelerationCurve, Drop, FloatArray, Measured, Scan, Track

if TYPE_CHECKING:  # pragma: no cover
    import pandas as pd

    from .ct import ReducedScan
    from .diagnosis.campaign import Diagnosis
    from .diagnosis.published.campaign import SummaryDiagnosis
    from .effects.model import Model
    from .inference.calibrate import Calibration
    from .inference.fits.posterior import Posterior
    from .inference.published.calibrate import SummaryCalibration
    from .report.outputs import Axes, Figure
    from .runs.store import Progress as StudyProgress
    from .runs.store import RunStore
    from .sph import DropRun, DropSetting
    from .video.projectile.following import Progress


class ScanSettings(TypedDict, total=False):
    """What ``labsim.ct.reduce_scan`` takes besides the scan."""

    cell: int
    guard: float
    sample_filling_factor: float | None
    correct: bool
    progress: StudyProgress | None


class CalibrationSettings(TypedDict, total=False):
    """What calibration takes besides parameters and store: four for all, three for tracks, four for published figures."""

    workers: int | None
    scheduler: str | None
    seed: int
    progress: StudyProgress | None
    model: Model | None
    backend: Path | None
    use_scans: bool
    use: Sequence[str]
    depth_reading: str | None
    bulk_modulus: float | None
    other_readings: bool


def track(
    source: Path | str | Drop | npt.NDArray[np.generic],
    *,
    frame_rate: float | None = None,
    pixel_size: float | Measured | None = None,
    rod_diameter: float | Measured | None = None,
    ruler: Path | str | tuple[Path | str, float] | None = None,
    surface_row: float | Measured | None = None,
    row_sigma: float | None = None,
    rotate: int = 0,
    frames: tuple[int, int] | None = None,
    columns: Mapping[str, str] | None = None,
    particle: str | None = None,
    progress: Progress | None = None,
) -> tuple[Track, DecelerationCurve | None]:
    """Follow a projectile, or read a finished track, and fit its motion.

    What is left out comes from the drop, or for a video from its own pictures.

    Parameters
    ----------
    source : Drop, path or array
        A drop of a campaign, its folder, a video, a folder of pictures, a track file of any format labsim reads, or the
        pictures as an array (frames, rows, columns) of uint8 or uint16, row 0 at the top.
    frame_rate : float, optional
        Hz.
    pixel_size, rod_diameter : float or Measured, optional
        m; of a pixel in the plane of the fall, of a rod or bead that gives the scale. A Measured says how well it is known.
    ruler : path, or path and float, optional
        Picture of a ruler with ticks a millimetre apart, or that and the distance of its ticks in m.
    surface_row : float or Measured, optional
        px; rows grow downwards. A plain number is known to 0.15 px.
    row_sigma : float, optional
        px; how well the rows of a table are known.
    rotate : int
        Degrees, anticlockwise, in steps of 90.
    frames : (int, int), optional
        First and last picture to use.
    columns : mapping, optional
        What a table's columns are, as ``{"time_ms": "t", "depth_mm": "z"}``.
    particle : str, optional
        Which of several tracks.
    progress : callable, optional
        Called with what is done and what there is.

    Returns
    -------
    Track, DecelerationCurve or None
        Rows in px, and the curve in SI with time zero at contact. A video without scale, surface or contact has no curve; the
        reason is among the track's warnings.

    Raises
    ------
    MeasurementError
        Where something is not known or nothing can be tracked.
    """
    from .tracking import SURFACE_SIGMA, measure, read_request

    picture, step = ruler if isinstance(ruler, tuple) else (ruler, 1e-3)
    with _on_disk(source, "frames") as record:
        request = read_request(
            record,
            frame_rate=frame_rate,
            pixel_size=_with_error(pixel_size),
            rod_diameter=_with_error(rod_diameter),
            ruler=None if picture is None else (Path(picture), step),
            surface_row=_with_error(surface_row, SURFACE_SIGMA),
            row_sigma=row_sigma,
            rotate=rotate,
            frames=frames,
            columns=columns,
            particle=particle,
        )
        tracked = measure(request, progress)
    return tracked.track, tracked.curve


def reduce_scan(
    source: Path | str | Scan | npt.NDArray[np.generic],
    *,
    voxel: float | None = None,
    first_slice: str | None = None,
    grey_air: float | None = None,
    grey_per_density: float | None = None,
    solid_density: float | None = None,
    bead_radius: float | None = None,
    bead_mass: float | None = None,
    **settings: Unpack[ScanSettings],
) -> ReducedScan:
    """Slices to the axisymmetric map of the filling factor; its ``map`` is a FillingMap.

    Parameters
    ----------
    source : Scan, path or array
        A scan of a campaign, its folder, slices (a folder of images, a TIFF, an HDF5 file), or a volume as an array
        (slices, rows, columns) of uint8 or uint16.
    voxel, bead_radius, bead_mass : float, optional
        m, m, kg; like all that follow they stand over what scan.toml says, and in its place where there is none.
    first_slice : str, optional
        "top" or "bottom".
    grey_air, grey_per_density, solid_density : float, optional
        Grey level of air, grey levels per kg/m³, density of the grains' own material in kg/m³.
    settings
        As ``labsim.ct.reduce_scan`` takes them (cell, guard …).

    Returns
    -------
    ReducedScan
        Its ``map`` has filling factor and sigma on cells of r and z, in SI.

    Raises
    ------
    CampaignError, MeasurementError
    """
    from . import ct
    from .campaign import read_scan
    from .campaign_scans import NEEDED, complete_stack

    # key of scan.toml -> what was given, as the key has it, and what it is called here
    keys = {
        "radius_mm": (bead_radius and bead_radius * 1e3, "bead_radius"),
        "mass_mg": (bead_mass and bead_mass * 1e6, "bead_mass"),
        "voxel_um": (voxel and voxel * 1e6, "voxel"),
        "first_slice": (first_slice, "first_slice"),
        "grey_air": (grey_air, "grey_air"),
        "grey_per_density": (grey_per_density, "grey_per_density"),
        "density_solid_kg_m3": (solid_density, "solid_density"),
    }
    stated: dict[str, dict[str, Any]] = {"projectile": {}, "scan": {}, "calibration": {}}
    for key, (value, _) in keys.items():
        if value is not None:
            stated[NEEDED.get(key, "scan")][key] = value
    with _on_disk(source, "slices") as slices:
        if not isinstance(slices, Scan):
            names = {key: name for key, (_, name) in keys.items()}
            given = complete_stack(Path(slices), stated, names)
            slices = read_scan(slices, given=given, speed_required=False)
        elif any(stated.values()):
            raise CampaignError(
                slices.name, "scan", "is read already; give its folder to change what it says"
            )
        if not isinstance(slices, Scan):
            raise CampaignError(
                source, "scan.slices", "gives published figures, not slices; there is nothing to reduce"
            )
        return ct.reduce_scan(slices, **settings)


@overload
def simulate(
    setting: DropSetting,
    *,
    store: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> DropRun: ...


@overload
def simulate(
    setting: Sequence[DropSetting],
    *,
    store: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> list[DropRun]: ...


def simulate(
    setting: DropSetting | Sequence[DropSetting],
    *,
    store: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> DropRun | list[DropRun]:
    """Simulate one drop, or many at once; what the store holds is read, not run.

    Parameters
    ----------
    setting : DropSetting, or a sequence of them
        Drops or pushes.
    store : Path or str, optional
        Folder of the stored runs. Default: LABSIM_STORE, or the user's cache.
    workers : int, optional
        Processes. Default: one a core.
    scheduler : str, optional
        Address of a Dask scheduler, in place of processes.

    Returns
    -------
    DropRun or list of DropRun
        In the order of the settings.

    Raises
    ------
    SimulationError
        For a setting outside the solver's limits, or a run that failed.
    """
    from .runs.store import require_runs
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
    **settings: Unpack[CalibrationSettings],
) -> Calibration | SummaryCalibration:
    """The posterior of p_m (Pa), and of effects named in ``parameters``.

    Parameters
    ----------
    campaign : Campaign, Path or str
        One that was read, or its folder.
    parameters : sequence of str
        "p_m", and effects as "shear_strength" or "shear_strength.factor".
    store : Path or str, optional
        Folder of the stored runs. Default: LABSIM_STORE, or the user's cache.
    settings
        workers, scheduler, seed, progress, and what ``labsim.inference.calibrate.calibrate`` takes for tracks and
        ``labsim.inference.published.calibrate.calibrate_summary`` for published figures.

    Returns
    -------
    Calibration or SummaryCalibration
        Its ``posterior`` opens with ArviZ; the second for published figures.

    Raises
    ------
    LabsimError
        For an unknown parameter, and where measuring or simulating fails.
    """
    read = _read(campaign)
    # either refuses the settings that are the other's
    with _one_thread():
        if read.has_records:
            from .inference.calibrate import calibrate as calibrate_tracks

            return calibrate_tracks(read, parameters, store=_open(store), **settings)  # type: ignore[misc]
        from .inference.published.calibrate import calibrate_summary

        return calibrate_summary(read, _open(store), **settings)  # type: ignore[misc]


def diagnose(
    campaign: Campaign | Path | str,
    *,
    store: Path | str | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    seed: int = 1,
    progress: StudyProgress | None = None,
    use_scans: bool = True,
    cells: int | None = None,
) -> Diagnosis | SummaryDiagnosis:
    """What the calibrated simulation gets wrong about a campaign, why, and what an extended model gains.

    Parameters
    ----------
    campaign : Campaign or path
        Read, or its folder.
    store : path, optional
        Folder of the stored runs (default: LABSIM_STORE or the user's cache).
    workers : int, optional
        Processes; one a core where it is not given.
    scheduler : str, optional
        Address of a Dask scheduler.
    seed : int
        Of everything that is drawn.
    progress : callable, optional
        Takes work done, all work and what is done, now and then.
    use_scans, cells : bool, int
        Whether CT maps are compared, and spacings in a tip radius; published figures have no use for them.

    Returns
    -------
    Diagnosis or SummaryDiagnosis
        The latter of a campaign with published figures only.

    Raises
    ------
    LabsimError
    """
    read, opened = _read(campaign), _open(store)
    with _one_thread():
        if read.has_records:
            from .diagnosis.campaign import diagnose_campaign

            return diagnose_campaign(
                read,
                opened,
                workers=workers,
                scheduler=scheduler,
                seed=seed,
                progress=progress,
                use_scans=use_scans,
                cells=cells,
            )
        from .diagnosis.published.campaign import diagnose_summary
        from .inference.published.calibrate import calibrate_summary

        calibration = calibrate_summary(
            read, opened, workers=workers, scheduler=scheduler, seed=seed, progress=progress
        )
        return diagnose_summary(calibration, opened, workers=workers, scheduler=scheduler, progress=progress)


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
    from .report.figures.formats import further_formats
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


def summarise(found: object) -> str:
    """A record or a result in words: of a calibration or a diagnosis what the command prints, of a record its own summary.

    Parameters
    ----------
    found : Calibration, Diagnosis, or a record
        What a verb of labsim returned.

    Returns
    -------
    str
        Lines of text.

    Raises
    ------
    TypeError
        Of anything else.
    """
    from .records import Summarised

    if isinstance(found, Summarised):
        return found.summary()
    from .report.outputs import say_result

    said = say_result(found)
    if said is None:
        raise TypeError(f"{type(found).__name__} is neither a record nor a result of labsim")
    return said


def plot(found: object, ax: Axes | None = None) -> Axes:
    """Draw a record or a result on matplotlib axes.

    Parameters
    ----------
    found : DecelerationCurve, (Track, DecelerationCurve), DropRun, ReducedScan, Calibration or Diagnosis
        A curve or a run is drawn as depth (mm) against time (ms), a scan as its map of the filling factor (mm), a calibration or
        diagnosis as the posterior of what it calibrates, p_m of dust (kPa), beside the cause where one is found.
    ax : matplotlib Axes, optional
        The current axes by default.

    Returns
    -------
    matplotlib Axes
        For titles, limits and further lines.

    Raises
    ------
    TypeError
        Of anything else.
    """
    from .ct import ReducedScan
    from .report.figures import axes

    if isinstance(found, ReducedScan):
        from .ct import make_dataset

        return axes.plot_filling_factor(make_dataset(found), ax)
    if (posterior := _find_posterior(found)) is not None:
        return axes.plot_density(posterior.calibrated, posterior.names[0], ax)
    table = tabulate(found)
    if "depth_m" not in table:
        raise TypeError(f"{type(found).__name__} has no picture of its own; tabulate() gives its numbers")
    return axes.plot_depth(table, ax)


def plot_drops(found: Calibration | Diagnosis, figure: Figure | None = None) -> list[tuple[Axes, Axes]]:
    """Draw every drop, measured and simulated, and below each what is left.

    Parameters
    ----------
    found : Calibration or Diagnosis
        Of a diagnosis both models are drawn: nominal, and with the cause that was found.
    figure : matplotlib Figure, optional
        A new one of pyplot by default, of a size that suits the number of drops.

    Returns
    -------
    list of (Axes, Axes)
        Per drop its motion (mm against ms) and what is left of it (µm) with the band that is allowed for. Of pushes one pair: the
        net resistance against depth, and the misfit of every push against its speed.
    """
    from .report.outputs import plot_drops as draw

    return draw(found, figure)


def tabulate(thing: object) -> pd.DataFrame:
    """A pandas table, one line a frame, instant, threshold or draw; its columns are those of the CSV files, with units.

    Parameters
    ----------
    thing : Track, DecelerationCurve, CompressedVolume, DropRun, Calibration, Diagnosis, or what ``labsim.track`` returns
        Of the pair that ``labsim.track`` returns the curve is taken, the track where there is none; of a calibration or diagnosis
        the draws of its posterior. Maps are not tables: ``labsim.ct.make_dataset(reduced)`` gives xarray.

    Returns
    -------
    DataFrame
        With a unit in the name of each column.

    Raises
    ------
    TypeError
        Of anything else.
    """
    import pandas as pd

    if isinstance(thing, tuple) and len(thing) == 2:
        thing = thing[1] if thing[1] is not None else thing[0]

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
    if (posterior := _find_posterior(thing)) is not None:
        return pd.DataFrame({name: posterior.samples(name) for name in posterior.names})
    raise TypeError(
        f"{type(thing).__name__} is no table; give a track, curve, volume, run, calibration or diagnosis"
    )


def _with_error(value: float | Measured | None, sigma: float = 0.0) -> Measured | None:
    return value if value is None or isinstance(value, Measured) else Measured(value, sigma)


@contextmanager
def _on_disk(source: Any, what: str) -> Iterator[Any]:
    """The source itself; pictures in memory as pages of a TIFF, for as long as they are read."""
    if not isinstance(source, np.ndarray):
        yield source
        return
    import tifffile

    if source.ndim != 3 or source.dtype not in (np.uint8, np.uint16):
        raise MeasurementError(
            what,
            "array",
            f"is {source.dtype} of shape {source.shape}; give uint8 or uint16 as ({what}, rows, columns)",
        )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{what}.tif"
        tifffile.imwrite(path, np.ascontiguousarray(source), photometric="minisblack")
        yield path


def _find_posterior(found: object) -> Posterior | None:
    """Of a calibration or diagnosis: with the cause, where one is found."""
    found = getattr(found, "calibration", found)  # of published figures
    return getattr(found, "posterior_extended", None) or getattr(found, "posterior", None)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Linear algebra in one thread, as in the commands: the same sums on every machine, and no threads that fight the workers."""
    import scipy.linalg  # noqa: F401  (only what is loaded can be told)
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def _read(campaign: Campaign | Path | str) -> Campaign:
    if isinstance(campaign, Campaign):
        return campaign
    from .campaign import read_campaign

    return read_campaign(campaign)


def _open(store: Path | str | None) -> RunStore:
    from .runs.store import RunStore

    return RunStore(store)
