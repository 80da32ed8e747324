"""Track files: ``track.csv``, one row per frame, written by hand, by another tracker or by labsim itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..errors import MeasurementError
from ..records import Camera, DecelerationCurve, FloatArray, Track
from ..tracks import find_format, read_rows


def read_track(path: Path | str, camera: Camera, row_sigma: float | None) -> Track:
    """Read ``frame,tip_row_px`` (and, where present, ``time_s``, ``sigma_px``) into a Track.

    Missing frames stay missing: time = frame / frame rate unless the file brings its own ``time_s``. An empty
    tip_row_px is a frame without a position (valid = False). Outliers are kept; ``fit_deceleration`` finds them.
    ``row_sigma`` (px) holds for every frame that the file gives no ``sigma_px`` for; where there is neither, the
    scatter about the local motion is measured and used. Files of other programs (labsim/tracks) are read alike.
    Raises MeasurementError.
    """
    path = Path(path)
    if find_format(path) is not None:
        return _make_track(path, camera, row_sigma)
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True, encoding_errors="replace")
    except FileNotFoundError:
        raise MeasurementError(path, "track", "does not exist; name a CSV file frame,tip_row_px") from None
    except (
        pd.errors.ParserError,
        pd.errors.EmptyDataError,
        UnicodeDecodeError,
        OSError,
        ValueError,
    ) as trouble:
        raise MeasurementError(path, "track", f"is no table ({trouble}); write frame,tip_row_px") from None
    table.columns = [str(name).strip() for name in table.columns]
    for name in ("frame", "tip_row_px"):
        if name not in table.columns:
            raise MeasurementError(
                path, name, f"no such column among {list(table.columns)}; write frame,tip_row_px"
            )
    numbers = {}
    for name in ("frame", "tip_row_px", "time_s", "sigma_px"):
        if name in table.columns:
            column = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
            blank = table[name].isna().to_numpy()
            wrong = np.flatnonzero(~np.isfinite(column) & ~blank)
            if wrong.size:
                value = table[name].iloc[wrong[0]]
                raise MeasurementError(
                    path, name, f"line {wrong[0] + 2} holds {value!r}; write a number or nothing"
                )
            numbers[name] = column
    frame = numbers["frame"]
    if len(frame) == 0:
        raise MeasurementError(path, "tip_row_px", "holds no frame; a track needs at least 8")
    if not np.all(np.isfinite(frame)) or np.any(frame != np.round(frame)):
        raise MeasurementError(path, "frame", "is not a whole number in every line; count frames 0, 1, 2 …")
    if np.any(np.diff(frame) <= 0):
        line = int(np.flatnonzero(np.diff(frame) <= 0)[0]) + 3
        raise MeasurementError(path, "frame", f"does not grow in line {line}; sort the frames, each once")
    row = numbers["tip_row_px"]
    time = numbers.get("time_s", frame / camera.frame_rate)
    time = np.where(np.isfinite(time), time, frame / camera.frame_rate)
    return _finish(path, frame, time, row, numbers.get("sigma_px"), row_sigma)


def _make_track(path: Path, camera: Camera, row_sigma: float | None) -> Track:
    """A Track from another program's file."""
    rows = read_rows(path, camera)
    sigma = rows.sigma if np.any(np.isfinite(rows.sigma)) else None
    return _finish(path, rows.frame, rows.frame / camera.frame_rate, rows.row, sigma, row_sigma)


def _finish(
    path: Path,
    frame: np.ndarray,
    time: FloatArray,
    row: FloatArray,
    own_sigma: FloatArray | None,
    row_sigma: float | None,
) -> Track:
    """Error bars and gaps, the same for every format."""
    valid = np.isfinite(row)
    warnings = []
    missing = int(frame[-1] - frame[0] + 1 - len(frame)) + int(np.sum(~valid))
    if missing:
        warnings.append("1 frame has no position" if missing == 1 else f"{missing} frames have no position")
    if row_sigma is None:
        row_sigma = measure_scatter(time[valid], row[valid])
        if not np.isfinite(row_sigma):
            raise MeasurementError(
                path, "tip_row_px", "too few frames to measure their scatter; give row_sigma_px"
            )
        if own_sigma is None:
            warnings.append(f"no error bar given; scatter about the local motion is {row_sigma:.3f} px")
    sigma = own_sigma if own_sigma is not None else np.full(len(row), np.nan)
    sigma = np.where(np.isfinite(sigma) & (sigma > 0), sigma, row_sigma)
    return Track(
        frame=frame.astype(np.int64),
        time=time,
        tip_row=row,
        sigma=sigma,
        valid=valid,
        reason=tuple("" if ok else "no position in the file" for ok in valid),
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


def measure_scatter(time: np.ndarray, row: np.ndarray) -> float:
    """Robust scatter (px, one position) about the parabola through each point's four neighbours; NaN below 8 points."""
    deviation, factor = deviate_from_neighbours(time, row)
    if len(deviation) == 0:
        return float("nan")
    scaled = deviation / factor
    return float(1.4826 * np.median(np.abs(scaled)))


def deviate_from_neighbours(time: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each position minus the parabola through two neighbours on either side, and the noise gain of that difference.

    Returns (n,) px and (n,) -, both empty below 8 points. The first and last two points use the nearest four.
    """
    n = len(row)
    if n < 8:
        return np.empty(0), np.empty(0)
    deviation, factor = np.empty(n), np.empty(n)
    for i in range(n):
        start = min(max(i - 2, 0), n - 5)
        near = np.array([k for k in range(start, start + 5) if k != i])
        x = time[near] - time[i]
        scale = np.max(np.abs(x))
        weights = np.linalg.pinv(np.vander(x / scale, 3, increasing=True))[0]
        deviation[i] = row[i] - weights @ row[near]
        factor[i] = np.sqrt(1.0 + weights @ weights)
    return deviation, factor
