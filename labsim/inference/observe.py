"""What a campaign measured, as the likelihood sees it: positions with their errors, maps with theirs.

Input: a Campaign. Output: Observed. Positions are never differentiated; the only things fitted here are the
starting values of each drop's contact time and impact speed, from its own free fall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import MeasurementError
from ..records import STANDARD_GRAVITY, Campaign, Drop, FloatArray, Track
from ..video.track_file import read_track

OUTLIER = 5.0  # standard deviations from the neighbours
WINDOW = 4  # neighbours on either side
MARGIN = 4  # frames kept after the depth has stopped growing


@dataclass(frozen=True)
class ObservedDrop:
    """One drop on the stated scales. time, depth, sigma : (n,) s, m, m; depth is positive below the stated surface."""

    drop: Drop
    time: FloatArray
    depth: FloatArray
    sigma: float
    contact_time: float  # s, starting value
    impact_speed: float  # m/s, starting value on the stated scales
    rejected: int

    @property
    def name(self) -> str:
        return self.drop.name

    @property
    def pixel(self) -> float:
        assert self.drop.camera is not None
        return self.drop.camera.pixel_size


def observe_drop(drop: Drop, track: Track) -> ObservedDrop:
    """Depths on the stated scale up to the stop, outliers removed. Raises MeasurementError where nothing is left."""
    assert drop.camera is not None
    pixel = drop.camera.pixel_size
    good = track.valid & np.isfinite(track.tip_row)
    time, row, sigma = track.time[good], track.tip_row[good], track.sigma[good]
    sigma_px = float(np.median(sigma))
    stray = np.abs(deviate_robustly(time, row, sigma_px)) > OUTLIER * sigma_px * 1.2 + 0.25
    time, row = time[~stray], row[~stray]
    depth = (row - drop.camera.surface_row) * pixel
    if depth.size < 12 or depth[0] > 0:
        raise MeasurementError(
            drop.record.path or drop.name, "tip_row_px", "shows no free fall above the surface"
        )
    if depth.max() < 5 * sigma_px * pixel:
        raise MeasurementError(drop.record.path or drop.name, "tip_row_px", "never reaches the surface")
    contact, speed = _fit_free_fall(time, depth)
    final = (
        np.median(depth[depth > 0.8 * depth.max()]) if (depth > 0.8 * depth.max()).sum() > 6 else depth.max()
    )
    reached = np.nonzero(depth > final - 2 * sigma_px * pixel)[0]
    last = min(reached[0] + MARGIN, depth.size) if reached.size else depth.size
    return ObservedDrop(
        drop=drop,
        time=time[:last],
        depth=depth[:last],
        sigma=sigma_px * pixel,
        contact_time=contact,
        impact_speed=speed,
        rejected=int(good.sum() - row.size),
    )


def deviate_robustly(time: FloatArray, row: FloatArray, sigma: float) -> FloatArray:
    """Each row minus the parabola through its WINDOW neighbours on either side, (n,) px; outliers among them count little.

    Reweighted least squares, first with the weights of absolute deviations, then Tukey's: outliers side by side would hide
    one another from a plain fit, and get their neighbours thrown out.
    """
    places = np.arange(row.size)[:, None] + np.delete(np.arange(-WINDOW, WINDOW + 1), WINDOW)
    real = (places >= 0) & (places < row.size)  # the first and the last have fewer neighbours
    near = np.clip(places, 0, row.size - 1)
    x = np.where(real, time[near] - time[:, None], 0.0)
    x /= np.abs(x).max(axis=1, keepdims=True)
    design = np.stack([np.ones_like(x), x, x**2], axis=2)  # (n, neighbours, 3), all parabolas at once
    weight = real.astype(float)
    best = np.zeros((row.size, 3))
    for turn in range(12):
        inverse = np.linalg.pinv(design * weight[:, :, None])
        best = np.einsum("nkj,nj->nk", inverse, row[near] * weight)
        left = np.abs(row[near] - np.einsum("njk,nk->nj", design, best))
        if turn < 8:
            weight = real / np.sqrt(np.maximum(left, 0.3 * sigma))
        else:
            weight = real * np.clip(1 - (left / (8 * sigma + 0.2)) ** 2, 1e-3, 1.0)
    return np.asarray(row - best[:, 0])


def _fit_free_fall(time: FloatArray, depth: FloatArray) -> tuple[float, float]:
    """Contact time and impact speed from the frames above the surface, g known."""
    before = depth < 0
    first = int(np.argmin(before)) if not before.all() else depth.size
    t, z = time[:first], depth[:first]
    if t.size < 4:
        raise MeasurementError(
            "track", "tip_row_px", "has fewer than four frames of free fall above the surface"
        )
    middle = t.mean()
    slope, level = np.polyfit(t - middle, z - 0.5 * STANDARD_GRAVITY * (t - middle) ** 2, 1)
    # level + slope s + g s^2 / 2 = 0 at contact
    root = (-slope + math.sqrt(max(slope**2 - 2 * STANDARD_GRAVITY * level, 0.0))) / STANDARD_GRAVITY
    return middle + root, slope + STANDARD_GRAVITY * root


def read_observed_track(drop: Drop) -> Track:
    """The track of a drop, from its file or from its video."""
    assert drop.camera is not None and drop.record.path is not None
    if drop.record.kind == "track":
        return read_track(drop.record.path, drop.camera, drop.record.row_sigma)
    from ..video import open_frames, track_projectile  # the readers of pixels are only needed here

    return track_projectile(open_frames(drop.record.path), frame_rate=drop.camera.frame_rate)


def observe_drops(campaign: Campaign) -> tuple[list[ObservedDrop], list[str]]:
    """Every drop that shows something, and one line for each that does not.

    Raises MeasurementError where none does: the first one's.
    """
    seen: list[ObservedDrop] = []
    failures: list[tuple[str, MeasurementError]] = []
    for drop in campaign.drops:
        if drop.record.kind == "summary":
            continue
        try:
            seen.append(observe_drop(drop, read_observed_track(drop)))
        except MeasurementError as error:
            failures.append((drop.name, error))
    if failures and not seen:
        raise failures[0][1]
    return seen, [f"drop {name} left out: {error}" for name, error in failures]
