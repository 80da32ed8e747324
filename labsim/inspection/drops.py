"""One drop: its track fitted or its video decoded, and what that says of the drop."""

from __future__ import annotations

import math

import numpy as np

from ..acceleration import SEEN, find_impact, read_acceleration
from ..errors import LabsimError
from ..force import ForceRecord, read_force
from ..inference.observations.observe import read_observed_track
from ..inference.observations.observe_push import observe_push
from ..inference.surface_rows import doubt_surface_row
from ..records import STANDARD_GRAVITY, Campaign, DecelerationCurve, Drop, Measured, Track
from ..video import open_frames
from ..video.motion.curve import fit_deceleration
from ..video.track_file import find_left_out
from .found import Found, is_odd
from .frames import count_missing, judge_frames
from .scales import TOO_FAST

LEAST_FRAMES = 5  # of free fall above the surface
LOST_SHARE = 0.2  # of the frames
NARROW = 6.0  # container over tip diameter below which walls are felt
LIFTED_SHARE = 0.02  # of the rows of a push, that are no deeper than one before
GAP = 5.0  # steps of depth
FLAT = 5  # rows at one largest value
AIR = 2.0  # tip radii without resistance that a push may begin with
SOFT = 0.02  # of the resistance in the middle: less is none
SAID_HERE = ("left out (frame", "no position")  # warnings of the curve that judge_frames says in other words


def inspect_drop(drop: Drop, campaign: Campaign) -> Found:
    projectile = drop.projectile
    size = f"{2e3 * projectile.tip_radius:.3g} mm {projectile.tip}, {projectile.mass * 1e6:.3g} mg"
    if drop.gauge is not None:
        return _inspect_push(drop, campaign)
    if drop.record.kind == "summary":
        return Found(drop.name, f"{size}: published figures")
    if drop.record.kind == "video":
        return _inspect_video(drop, size)
    if drop.accelerometer is not None:
        return _inspect_acceleration(drop, size)
    assert drop.camera is not None and drop.record.path is not None
    try:
        track = read_observed_track(drop)
        curve = fit_deceleration(track, drop.camera, name=drop.record.path)
    except LabsimError as trouble:
        return Found(drop.name, f"{size}: no motion can be fitted", trouble=trouble)
    found = _describe(drop, size, track, curve)
    found.odd += [text for text in curve.warnings if not any(words in text for words in SAID_HERE)]
    found.odd += (torn := judge_frames(track, curve))
    _judge_fall(drop, track, curve, found)
    # where frames are torn apart, they put contact anywhere
    if not torn and (doubt := doubt_surface_row(drop, track, curve)) is not None:
        found.odd.append(doubt)
    if curve.penetration_depth.value > 0.5 * campaign.sample.depth:
        found.odd.append(
            f"comes to {curve.penetration_depth.value * 1e3:.2g} mm, more than half of the dust's depth: the floor is felt"
        )
    if campaign.sample.diameter < NARROW * 2 * projectile.tip_radius:
        found.odd.append(
            f"the container is only {campaign.sample.diameter / 2 / projectile.tip_radius:.2g} tips wide: walls are felt"
        )
    return found


def find_air(record: ForceRecord, radius: float, noise: float) -> float:
    """How far (m) the tip goes before something resists it all along a tip radius; nought where all of the record does, or none.

    Something is more than noise (Pa, of a row) and SOFT of what resists in the middle.
    """
    something = record.pressure > max(5.0 * noise, SOFT * float(np.median(record.pressure)))
    rows = max(int(radius / record.step), 1)
    held = np.convolve(something, np.ones(rows), "full")[rows - 1 :] >= 0.9 * rows
    if not held.any():
        return 0.0
    first = int(np.argmax(held))
    first += int(np.argmax(something[first:]))
    return float(record.depth[first] - record.depth[0])


def _inspect_push(drop: Drop, campaign: Campaign) -> Found:
    """What the gauge says by itself: depths, resistance, and what of it can be no push."""
    assert drop.record.path is not None and drop.gauge is not None
    radius, speed = drop.projectile.tip_radius, dict(drop.motion.values).get("speed")
    size = f"{2e3 * radius:.3g} mm {drop.projectile.tip}" + (f" at {1e3 * speed:g} mm/s" if speed else "")
    try:
        record = read_force(drop.record.path, drop.gauge, radius)
        seen = observe_push(drop, campaign)
    except LabsimError as trouble:
        return Found(drop.name, f"{size}: no push can be read", trouble=trouble)
    middle, largest = float(np.median(record.pressure)), float(record.pressure.max())
    found = Found(
        drop.name,
        f"{size}: {record.depth.size} rows from {1e3 * record.depth[0]:.1f} to {1e3 * record.depth[-1]:.1f} mm, "
        f"{middle / 1e3:.4g} kPa in the middle, {largest / 1e3:.4g} kPa at most; {seen.windows.size} windows compared",
        {
            "rows": int(record.depth.size),
            "rows_lost": record.lost,
            "depth_from_m": float(record.depth[0]),
            "depth_to_m": float(record.depth[-1]),
            "pressure_median_Pa": middle,
            "pressure_largest_Pa": largest,
            "speed_m_s": speed,
            "windows": int(seen.windows.size),
        },
    )
    found.odd += seen.warnings
    ratios = seen.friction_ratio[np.isfinite(seen.friction_ratio)]
    if ratios.size:
        ratio, friction = float(np.median(ratios)), float(np.nanmedian(record.sleeve))
        use = "compared" if drop.gauge.sleeve.compared else "not compared"
        found.line += f"; sleeve {friction / 1e3:.3g} kPa, {100 * ratio:.2g} % of the net resistance, {use}"
        found.numbers |= {"sleeve_median_Pa": friction, "friction_ratio": ratio}
        if ratio <= 0.0:
            found.odd.append(
                f"the sleeve reads {friction / 1e3:.3g} kPa in the middle: friction is positive; correct its zero or sign"
            )
    if record.lost:
        found.odd.append(f"{record.lost} rows have no number")
    if record.lifted > LIFTED_SHARE * record.depth.size:
        found.odd.append(
            f"{record.lifted} rows are no deeper than one before: the tip was lifted, or depth was lost"
        )
    steps = np.diff(record.depth)
    gaps = steps > GAP * record.step
    if gaps.any():
        at = int(np.argmax(steps))
        found.odd.append(
            f"{int(gaps.sum())} gap{'s' * (gaps.sum() > 1)} in the depth, the largest {steps[at] * 1e3:.3g} mm at "
            f"{record.depth[at]:.4g} m"
        )
    nothing = find_air(record, radius, drop.gauge.sigma / drop.gauge.per_pressure(math.pi * radius**2))
    if nothing > AIR * radius:
        ends = record.depth[0] + nothing
        found.odd.append(
            f"the first {1e3 * nothing:.3g} mm meet nothing: where that is air, write surface_mm = "
            f"{1e3 * (ends + drop.gauge.surface):.4g}"
        )
    flat = np.sum(record.pressure >= largest * (1.0 - 1e-9))
    if flat > FLAT:
        found.odd.append(
            f"{int(flat)} rows read the same largest value, {largest / 1e3:.4g} kPa: the gauge was at its limit"
        )
    low, high = float(record.pressure.min()), float(np.quantile(record.pressure, 0.99))
    if low < -0.05 * high:
        at = int(np.argmin(record.pressure))
        found.odd.append(
            f"resistance falls to {low / 1e3:.4g} kPa at {record.depth[at]:.4g} m: nothing pulls"
        )
    if record.depth[-1] > campaign.sample.depth:
        found.odd.append(
            f"goes to {record.depth[-1]:.4g} m, below the sample, which is {campaign.sample.depth:.4g} m deep"
        )
    return found


def _inspect_acceleration(drop: Drop, size: str) -> Found:
    """What the record says by itself: contact, speed, and the depth that it integrates to."""
    assert drop.record.path is not None and drop.accelerometer is not None
    try:
        record = read_acceleration(drop.record.path, drop.accelerometer)
        impact = find_impact(record, drop)
    except LabsimError as trouble:
        return Found(drop.name, f"{size}: no impact can be read", trouble=trouble)
    peak = float(record.felt.max())
    depth, stopped = impact.penetration_depth, math.isfinite(impact.stopping_time)
    back = impact.rebound_speed  # NaN where it is not seen, and then no comparison holds
    found = Found(
        drop.name,
        f"{size}: {record.time.size} samples, {impact.impact_speed.value:.3f} m/s at contact ({impact.speed_source}), at most "
        f"{peak / STANDARD_GRAVITY:.3g} g, {depth.value * 1e3:.3f} ± {depth.sigma * 1e3:.3f} mm deep "
        + (f"after {impact.stopping_time * 1e3:.2f} ms" if stopped else "where it ends")
        + (
            f", up again with {back.value:.3f} ± {back.sigma:.3f} m/s"
            if back.value > SEEN * back.sigma
            else ""
        ),
        {
            "samples": int(record.time.size),
            "samples_saturated": record.saturated,
            "samples_missing": record.lost,
            "impact_speed_m_s": impact.impact_speed.value,
            "largest_acceleration_m_s2": peak,
            "penetration_depth_m": depth.value if stopped else None,
            "penetration_depth_sigma_m": depth.sigma if stopped else None,
            "stopping_time_s": impact.stopping_time if stopped else None,
            "rebound_speed_m_s": None if math.isnan(back.value) else back.value,
            "rebound_speed_sigma_m_s": None if math.isnan(back.value) else back.sigma,
        },
    )
    found.odd += impact.warnings
    return found


def _inspect_video(drop: Drop, size: str) -> Found:
    """Every picture is decoded; what is in them is the business of ``labsim track``."""
    assert drop.record.path is not None
    try:
        frames = open_frames(drop.record.path)
        for _ in frames:
            pass
        if drop.record.region is not None:
            frames.cut(drop.record.region)
        find_left_out(drop.record.path, frames.numbers, drop.record.left_out)
    except LabsimError as trouble:
        return Found(drop.name, f"{size}: the video cannot be read", trouble=trouble)
    line = f"{size}: video of {len(frames)} frames, its motion is not read here (labsim track)"
    return Found(
        drop.name, line, {"frames": len(frames)}, [text for text in frames.warnings if "truncated" in text]
    )


def _describe(drop: Drop, size: str, track: Track, curve: DecelerationCurve) -> Found:
    frames, lost = int(track.valid.sum()), count_missing(track)
    depth, stop, speed = curve.penetration_depth, curve.stopping_time, curve.impact_speed
    found = Found(
        drop.name,
        f"{size}: {frames} frames, {speed.value:.3f} m/s at contact, "
        + (f"{depth.value * 1e3:.3f} mm deep after {stop.value * 1e3:.2f} ms" if math.isfinite(depth.value) else "never stops"),
        {
            "frames": frames,
            "frames_missing": lost,
            "impact_speed_m_s": speed.value,
            "penetration_depth_m": depth.value,
            "stopping_time_s": stop.value,
        },
    )  # fmt: skip
    if lost > LOST_SHARE * (frames + lost):
        found.odd.append(f"{lost} of {frames + lost} frames have no position")
    return found


def _judge_fall(drop: Drop, track: Track, curve: DecelerationCurve, found: Found) -> None:
    """Free fall above the surface: enough frames, and gravity and speed as they should be."""
    clock = track.time if curve.clock is None else curve.clock
    free = int((clock[track.valid] < curve.contact_time.value).sum())
    if free < LEAST_FRAMES:
        found.odd.append(
            f"only {free} frames before contact; the speed at contact needs free fall above the surface"
        )
    if (g := curve.apparent_gravity) is not None:
        found.numbers["apparent_gravity_m_s2"] = g.value
        found.gravity = Measured(g.value / STANDARD_GRAVITY, g.sigma / STANDARD_GRAVITY)
    if drop.height is None or drop.height.value <= 0:
        return
    speed = curve.impact_speed
    expected = math.sqrt(2 * STANDARD_GRAVITY * drop.height.value)
    share = math.hypot(speed.sigma / expected, 0.5 * drop.height.sigma / drop.height.value)
    found.speed = Measured(speed.value / expected, share)
    found.numbers["speed_over_free_fall"] = speed.value / expected
    if is_odd(found.speed):
        found.odd.append(
            f"{speed.value:.3f} m/s {TOO_FAST} {drop.height.value * 1e3:.3g} mm of free fall give {expected:.3f} ± "
            f"{expected * 0.5 * drop.height.sigma / drop.height.value:.3f} m/s; check height_mm, pixel_size_um, frame_rate_Hz"
        )
