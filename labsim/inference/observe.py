"""What a campaign measured, as the likelihood sees it: positions with their errors, maps with theirs.

Input: a Campaign. Output: Observed. Positions are never differentiated; the only things fitted here are the
starting values of each drop's contact time and impact speed, from its own free fall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import MeasurementError
from ..records import Campaign, Drop, FloatArray, Track
from ..video.track_file import deviate_from_neighbours, read_track

STANDARD_GRAVITY = 9.81  # m/s^2, of every free fall, whatever the nominal model holds
OUTLIER = 5.0  # robust standard deviations from the neighbours
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
    sequence_fraction: float

    @property
    def name(self) -> str:
        return self.drop.name

    @property
    def pixel(self) -> float:
        assert self.drop.camera is not None
        return self.drop.camera.pixel_size


def observe_drop(drop: Drop, track: Track, sequence_fraction: float) -> ObservedDrop:
    """Depths on the stated scale up to the stop, outliers removed. Raises MeasurementError where nothing is left."""
    assert drop.camera is not None
    pixel = drop.camera.pixel_size
    good = track.valid & np.isfinite(track.tip_row)
    time, row, sigma = track.time[good], track.tip_row[good], track.sigma[good]
    sigma_px = float(np.median(sigma))
    for _ in range(3):  # outliers hide one another
        deviation, factor = deviate_from_neighbours(time, row)
        if deviation.size == 0:
            break
        bad = np.abs(deviation) > OUTLIER * sigma_px * factor + 0.25
        if not bad.any():
            break
        # of neighbouring suspects only the worst goes at a time: an outlier drags its neighbours along
        worst = bad & (np.abs(deviation / factor) >= _maximum_nearby(np.abs(deviation / factor), 2))
        time, row = time[~worst], row[~worst]
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
        sequence_fraction=sequence_fraction,
    )


def _maximum_nearby(values: FloatArray, reach: int) -> FloatArray:
    padded = np.pad(values, reach)
    return np.max([padded[k : k + values.size] for k in range(2 * reach + 1)], axis=0)


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


def sequence_fractions(drops: tuple[Drop, ...]) -> dict[str, float]:
    """Place of each drop in the order they were made, -0.5 for the first to +0.5 for the last."""
    order = sorted(drops, key=lambda drop: drop.sequence)
    span = max(len(order) - 1, 1)
    return {drop.name: place / span - 0.5 for place, drop in enumerate(order)}


def read_observed_track(drop: Drop) -> Track:
    """The track of a drop, from its file or from its video."""
    assert drop.camera is not None and drop.record.path is not None
    if drop.record.kind == "track":
        return read_track(drop.record.path, drop.camera, drop.record.row_sigma)
    from ..video import open_frames, track_projectile  # the readers of pixels are only needed here

    return track_projectile(open_frames(drop.record.path), frame_rate=drop.camera.frame_rate)


def observe_drops(campaign: Campaign) -> list[ObservedDrop]:
    places = sequence_fractions(campaign.drops)
    return [
        observe_drop(drop, read_observed_track(drop), places[drop.name])
        for drop in campaign.drops
        if drop.record.kind != "summary"
    ]
