"""Track files: ``track.csv``, one row per frame, written by hand, by another tracker or by labsim itself."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import MeasurementError
from ..records import Camera, DecelerationCurve, FloatArray, Track
from ..tracks import TrackRows, read_rows

LEFT_OUT = "left out in drop.toml"


def read_track(
    path: Path | str, camera: Camera, row_sigma: float | None, left_out: Sequence[int] = ()
) -> Track:
    """Read a track file of any format (labsim/tracks) into a Track.

    Missing frames stay missing, and a frame without a position is not valid. Time = frame / frame rate unless the file brings
    its camera's own ``time_s``. Outliers are kept; ``fit_deceleration`` finds them. ``row_sigma`` (px) holds for every frame
    that the file gives no ``sigma_px`` for; where there is neither, the scatter about the local motion is measured and used.
    left_out : numbers of frames whose rows are not used.
    Raises MeasurementError.
    """
    return make_track(path, read_rows(path, camera), row_sigma, left_out)


def find_left_out(path: Path | str, frame: np.ndarray, left_out: Sequence[int]) -> np.ndarray:
    """(n,) bool, which of the numbers ``frame`` are left out. Raises MeasurementError where one of these is no frame."""
    unknown = sorted(set(left_out) - set(frame.tolist()))
    if unknown:
        raise MeasurementError(
            path,
            "record.frames_left_out",
            f"{unknown[0]} is no frame of the record; its frames are {frame[0]} to {frame[-1]}",
        )
    return np.isin(frame, list(left_out))


def make_track(
    path: Path | str, rows: TrackRows, row_sigma: float | None, left_out: Sequence[int] = ()
) -> Track:
    """Rows of a file as a Track: error bars and gaps. ``row_sigma``, ``left_out`` as for ``read_track``.

    Raises MeasurementError.
    """
    frame, row = rows.frame, rows.row
    without = find_left_out(path, frame, left_out)
    placed = np.isfinite(row)
    valid = placed & ~without
    if not valid.any():
        raise MeasurementError(path, "tip_row_px", "stands in no row; export the whole track again")
    warnings = list(rows.warnings)
    missing = int(frame[-1] - frame[0] + 1 - len(frame)) + int(np.sum(~placed))
    if missing:
        warnings.append("1 frame has no position" if missing == 1 else f"{missing} frames have no position")
    stated = np.isfinite(rows.sigma) & (rows.sigma > 0)
    if row_sigma is None and not np.all(stated[valid]):
        row_sigma = measure_scatter(rows.time[valid], row[valid])
        if not np.isfinite(row_sigma):
            raise MeasurementError(
                path, "tip_row_px", "too few frames to measure their scatter; give row_sigma_px"
            )
        if not stated.any():
            warnings.append(f"no error bar given; scatter about the local motion is {row_sigma:.3f} px")
    return Track(
        frame=frame,
        time=rows.time,
        tip_row=row,
        sigma=np.where(stated, rows.sigma, np.nan if row_sigma is None else row_sigma),
        valid=valid,
        reason=tuple(
            LEFT_OUT if out else "" if ok else "no position in the file"
            for out, ok in zip(without, placed, strict=True)
        ),
        warnings=tuple(warnings),
    )


def tabulate_track(track: Track) -> pd.DataFrame:
    """frame, time_s, tip_row_px, sigma_px, reason; rows of rejected frames are NaN."""
    return pd.DataFrame(
        {
            "frame": track.frame,
            "time_s": track.time,
            "tip_row_px": np.where(track.valid, track.tip_row, np.nan),
            "sigma_px": np.where(track.valid, track.sigma, np.nan),
            "reason": track.reason,
        }
    )


def tabulate_curve(curve: DecelerationCurve) -> pd.DataFrame:
    """The columns of curve.csv: time_s, then depth_m, velocity_m_s, acceleration_m_s2, each followed by its sigma."""
    table = {"time_s": curve.time}
    for name, unit in (("depth", "m"), ("velocity", "m_s"), ("acceleration", "m_s2")):
        table[f"{name}_{unit}"] = getattr(curve, name)
        table[f"{name}_sigma_{unit}"] = getattr(curve, f"{name}_sigma")
    return pd.DataFrame(table)


def write_track(track: Track, path: Path | str) -> Path:
    """Write ``tabulate_track`` as CSV; rows of rejected frames stay empty."""
    path = Path(path)
    tabulate_track(track).to_csv(path, index=False, float_format="%.9g")
    return path


def write_curve(curve: DecelerationCurve, path: Path | str) -> Path:
    """Write ``tabulate_curve`` as CSV."""
    path = Path(path)
    tabulate_curve(curve).to_csv(path, index=False, float_format="%.8g")
    return path


def measure_scatter(time: FloatArray, row: FloatArray) -> float:
    """Robust scatter (px, one position) about the parabola through each point's four neighbours; NaN below 8 points.

    The first and last two points use the nearest four. A median: neither spikes nor the few frames of a hard stop move it.
    """
    n = len(row)
    if n < 8:
        return float("nan")
    first = np.clip(np.arange(n) - 2, 0, n - 5)
    near = first[:, None] + np.arange(5)
    near = near[near != np.arange(n)[:, None]].reshape(n, 4)
    x = time[near] - time[:, None]
    x /= np.abs(x).max(axis=1, keepdims=True)
    weights = np.linalg.pinv(np.stack([np.ones_like(x), x, x**2], axis=2))[:, 0]
    deviation = row - np.sum(weights * row[near], axis=1)
    return float(1.4826 * np.median(np.abs(deviation) / np.sqrt(1.0 + np.sum(weights**2, axis=1))))
