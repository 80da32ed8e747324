"""Which way the projectile falls: whether down the picture at all, and the rows along a fall that is aslant."""

from __future__ import annotations

import numpy as np

from ...errors import MeasurementError
from ...records import FloatArray, Measured
from ..frames import Frames
from ..motion.checks import measure_alikeness
from ..projectile.outline import Outline


def check_direction(frames: Frames, outlines: tuple[list[Outline | None], float, float]) -> None:
    """The projectile must fall towards growing rows."""
    steps = []
    for name in ("tip", "top"):
        spots = [
            (i, getattr(o, name), getattr(o, f"column_{name}"))
            for i, o in enumerate(outlines[0])
            if o is not None and getattr(o, name) is not None
        ]
        if len(spots) >= 5:
            i, y, x = np.array(spots).T
            if np.ptp(y) > 3 or np.ptp(x) > 3:
                early = i <= i[0] + 0.5 * np.ptp(i)
                steps.append(
                    (
                        np.polyfit(i[early], y[early], 1)[0],
                        np.polyfit(i[early], x[early], 1)[0],
                        np.ptp(y),
                        np.ptp(x),
                    )
                )
    if not steps:
        return
    dy, dx, range_y, range_x = max(steps, key=lambda s: s[2] + s[3])
    if range_x > 1.5 * range_y:
        turn = 270 if dx > 0 else 90
        raise MeasurementError(
            frames.path,
            "video",
            f"the projectile moves sideways; give --rotate {turn} if the camera stood on its side",
        )
    if dy < 0:
        raise MeasurementError(
            frames.path,
            "video",
            "the largest thing that moves goes upwards: a shadow, a hand or thrown-up dust, or the picture is upside down "
            "(--rotate 180); use only the frames with the projectile alone (--frames)",
        )


def straighten(
    row: FloatArray,
    x: FloatArray,
    valid: np.ndarray,
    radius: float,
    surface: float | None,
    level: float | None,
    warnings: list[str],
) -> tuple[FloatArray, Measured | None]:
    """Rows along the line of the fall: a camera that is rotated by θ shortens rows by cos θ."""
    good = valid & np.isfinite(x)
    if good.sum() < 8 or np.ptp(row[good]) < 10:
        return row, None
    y0 = surface if surface is not None else float(np.mean(row[good]))
    keep = good.copy()
    for _ in range(3):
        slope, offset = np.polyfit(row[keep], x[keep], 1)
        misfit = x - slope * row - offset
        keep = good & (np.abs(misfit) < 4 * max(1.4826 * float(np.median(np.abs(misfit[keep]))), 0.02))
    # what a codec, or air, does to a frame it does to its neighbours: the slope knows less than so many frames would tell
    alike = float(np.sqrt(measure_alikeness(misfit[keep], 2)))
    spread = alike * float(np.std(misfit[keep])) / (np.std(row[keep]) * np.sqrt(max(keep.sum() - 2, 1)))
    angle = float(np.arctan(slope))
    if level is not None and abs(angle) > np.radians(0.3) and abs(level - angle) > abs(angle) / 2:
        if abs(slope) > 5 * spread:
            warnings.append(f"the projectile falls {np.degrees(angle):+.2f}° aslant of the surface's normal")
        return row, Measured(level, spread)
    if abs(angle) > np.radians(0.5) and abs(slope) > 5 * spread:
        warnings.append(f"the fall is {np.degrees(angle):+.2f}° off the columns: rows are measured along it")
    # the tip's circle moves along the fall; its lowest point lies one radius below its centre in either direction
    return y0 + (row - radius - y0) * np.hypot(1.0, slope) + radius, Measured(angle, spread)
