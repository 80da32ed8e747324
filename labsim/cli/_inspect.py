"""What ``labsim check`` sees beyond the files' form: every track fitted, every scan reduced, and what looks odd about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..ct.reduce import reduce_scan
from ..errors import LabsimError
from ..inference.observe import read_observed_track
from ..records import STANDARD_GRAVITY, Campaign, Drop, Measured, Scan
from ..video import open_frames
from ..video.curve import fit_deceleration
from .options import Progress

TOO_FAST = "at contact, but"
ODD = 3.0  # standard deviations
SMALL_SHARE = 0.01  # relative: what is smaller is not worth a word
LEAST_FRAMES = 5  # of free fall above the surface
LOST_SHARE = 0.2  # of the frames
NARROW = 6.0  # container over tip diameter below which walls are felt
GREY_SHARE = 0.005  # relative, of a filling factor whose grey calibration has no stated error


@dataclass
class Found:
    """One drop or scan: a line for people, numbers for --json, and what looks odd. gravity, speed : over what they should be."""

    name: str
    line: str
    numbers: dict[str, Any] = field(default_factory=dict)
    odd: list[str] = field(default_factory=list)
    gravity: Measured | None = None
    speed: Measured | None = None


def inspect_campaign(campaign: Campaign, progress: Progress) -> tuple[list[Found], list[Found], list[str]]:
    """(drops, scans, what looks odd of the campaign as a whole)."""
    total = len(campaign.drops) + len(campaign.scans)
    drops, scans = [], []
    for drop in campaign.drops:
        drops.append(inspect_drop(drop, campaign))
        progress(len(drops), total, "reading drops and scans")
    for scan in campaign.scans:
        scans.append(inspect_scan(scan, campaign))
        progress(len(drops) + len(scans), total, "reading drops and scans")
    return drops, scans, judge_scales(drops)


def inspect_drop(drop: Drop, campaign: Campaign) -> Found:
    projectile = drop.projectile
    size = f"{2e3 * projectile.tip_radius:.3g} mm {projectile.tip}, {projectile.mass * 1e6:.3g} mg"
    if drop.record.kind == "summary":
        return Found(drop.name, f"{size}: published figures")
    assert drop.camera is not None and drop.record.path is not None
    if drop.record.kind == "video":
        try:
            frames = len(open_frames(drop.record.path))
        except LabsimError as trouble:
            return Found(drop.name, f"{size}: the video cannot be read", odd=[str(trouble)])
        line = f"{size}: video of {frames} frames, not tracked yet (labsim track)"
        return Found(drop.name, line, {"frames": frames})
    try:
        track = read_observed_track(drop)
        curve = fit_deceleration(track, drop.camera, name=drop.record.path)
    except LabsimError as trouble:
        return Found(drop.name, f"{size}: no motion can be fitted", odd=[trouble.message])
    frames = int(track.valid.sum())
    depth, stop, speed = curve.penetration_depth, curve.stopping_time, curve.impact_speed
    found = Found(
        drop.name,
        f"{size}: {frames} frames, {speed.value:.3f} m/s at contact, "
        + (f"{depth.value * 1e3:.3f} mm deep after {stop.value * 1e3:.2f} ms" if math.isfinite(depth.value) else "never stops"),
        {
            "frames": frames,
            "impact_speed_m_s": speed.value,
            "penetration_depth_m": depth.value,
            "stopping_time_s": stop.value,
        },
    )  # fmt: skip
    lost = track.frame.size - frames
    if lost:
        found.line += f", {lost} without position"
    if lost > LOST_SHARE * track.frame.size:
        found.odd.append(f"{lost} of {track.frame.size} frames have no position")
    found.odd += [
        text for text in curve.warnings if "left out (frame" not in text and "no position" not in text
    ]
    free = int((track.time[track.valid] < curve.contact_time.value).sum())
    if free < LEAST_FRAMES:
        found.odd.append(
            f"only {free} frames before contact; the speed at contact needs free fall above the surface"
        )
    if (g := curve.apparent_gravity) is not None:
        found.numbers["apparent_gravity_m_s2"] = g.value
        found.gravity = Measured(g.value / STANDARD_GRAVITY, g.sigma / STANDARD_GRAVITY)
    if drop.height is not None and drop.height.value > 0:
        expected = math.sqrt(2 * STANDARD_GRAVITY * drop.height.value)
        share = math.hypot(speed.sigma / expected, 0.5 * drop.height.sigma / drop.height.value)
        found.speed = Measured(speed.value / expected, share)
        found.numbers["speed_over_free_fall"] = speed.value / expected
        if is_odd(found.speed):
            found.odd.append(
                f"{speed.value:.3f} m/s {TOO_FAST} {drop.height.value * 1e3:.3g} mm of free fall give {expected:.3f} ± "
                f"{expected * 0.5 * drop.height.sigma / drop.height.value:.3f} m/s; check height_mm, pixel_size_um, frame_rate_Hz"
            )
    if depth.value > 0.5 * campaign.sample.depth:
        found.odd.append(
            f"comes to {depth.value * 1e3:.2g} mm, more than half of the dust's depth: the floor is felt"
        )
    if campaign.sample.diameter < NARROW * 2 * projectile.tip_radius:
        found.odd.append(
            f"the container is only {campaign.sample.diameter / 2 / projectile.tip_radius:.2g} tips wide: walls are felt"
        )
    return found


def is_odd(ratio: Measured) -> bool:
    """Whether a ratio that should be one is not."""
    return abs(ratio.value - 1) > max(ODD * ratio.sigma, SMALL_SHARE)


def pool(ratios: Sequence[Measured]) -> Measured | None:
    """Weighted mean, its error raised where they scatter more than they say."""
    if not ratios:
        return None
    weights = [1 / max(each.sigma, 1e-6) ** 2 for each in ratios]
    mean = sum(w * each.value for w, each in zip(weights, ratios, strict=True)) / sum(weights)
    chi = sum(w * (each.value - mean) ** 2 for w, each in zip(weights, ratios, strict=True))
    return Measured(mean, math.sqrt(max(1.0, chi / max(len(ratios) - 1, 1)) / sum(weights)))


def judge_scales(drops: Sequence[Found]) -> list[str]:
    """Pixel size and frame rate against gravity and height, from all drops together: g ∝ pixel · rate², speed ∝ pixel · rate.

    What is said here of all drops is taken out of what looks odd of each.
    """
    lines = []
    gravity = pool([drop.gravity for drop in drops if drop.gravity is not None])
    speed = pool([drop.speed for drop in drops if drop.speed is not None])
    if gravity is not None and is_odd(gravity):
        g, sigma = gravity.value * STANDARD_GRAVITY, gravity.sigma * STANDARD_GRAVITY
        lines.append(
            f"free fall shows g = {g:.2f} ± {sigma:.2f} m/s² instead of {STANDARD_GRAVITY}; a pixel size of "
            f"{100 / gravity.value:.1f} % or a frame rate of {100 / math.sqrt(gravity.value):.1f} % of what is stated would "
            "put it right (g grows as pixel · rate²): check pixel_size_um and frame_rate_Hz"
        )
        _forget(drops, "free flight falls")
    if speed is not None and is_odd(speed):
        lines.append(
            f"the drops are {abs(speed.value - 1):.1%} {'faster' if speed.value > 1 else 'slower'} at contact than their heights "
            f"say (± {speed.sigma:.1%}): check pixel_size_um, frame_rate_Hz and from where height_mm is counted"
        )
        _forget(drops, TOO_FAST)
    if len(lines) == 2 and gravity is not None and speed is not None:
        pixel, rate = speed.value**2 / gravity.value, gravity.value / speed.value
        lines.append(
            f"both together ask for a pixel size of {100 / pixel:.1f} % and a frame rate of {100 / rate:.1f} % of what is stated"
        )
    return lines


def _forget(drops: Sequence[Found], words: str) -> None:
    for drop in drops:
        drop.odd = [text for text in drop.odd if words not in text]


def inspect_scan(scan: Scan, campaign: Campaign) -> Found:
    stated = campaign.sample
    try:
        reduced = reduce_scan(scan, sample_filling_factor=stated.filling_factor)
    except LabsimError as trouble:
        return Found(scan.name, "no map can be made", odd=[trouble.message])
    phi = reduced.undisturbed
    found = Found(
        scan.name,
        f"{2e3 * scan.projectile.tip_radius:.3g} mm bead, tip {reduced.map.tip_depth * 1e3:.3f} mm deep, undisturbed dust of "
        f"filling factor {phi.value:.5f} ± {phi.sigma:.5f}",
        {"filling_factor_undisturbed": phi.value, "tip_depth_m": reduced.map.tip_depth},
        list(reduced.map.warnings),
    )
    sigma = math.hypot(phi.sigma, stated.filling_factor_sigma, GREY_SHARE * stated.filling_factor)
    if abs(phi.value - stated.filling_factor) > ODD * sigma:
        found.odd.append(
            f"the undisturbed dust has filling factor {phi.value:.4f}, but campaign.toml states {stated.filling_factor:g} ± "
            f"{stated.filling_factor_sigma:g}; check the grey calibration or sample.filling_factor"
        )
    return found


def list_missing(campaign: Campaign) -> list[str]:
    """What a campaign could have and has not, and what is lost by it."""
    lines = []
    tracked = [drop for drop in campaign.drops if drop.record.kind != "summary"]
    if tracked and not campaign.scans:
        lines.append(
            "no CT scan: nothing is seen of the dust itself; scale of the CT, crust and gradient cannot be told"
        )
    if tracked and len({round(drop.projectile.tip_radius, 7) for drop in tracked}) == 1:
        lines.append("one tip radius only: causes that depend on size look like others")
    heights = [drop.height.value for drop in tracked if drop.height is not None]
    if heights and max(heights) < 4 * min(heights):
        lines.append("speeds within a factor of two: causes that depend on speed look like others")
    if 0 < len(tracked) < 4:
        lines.append(
            f"{len(tracked)} tracked drop{'s' * (len(tracked) > 1)}: p_m can be found, the scatter of samples and causes hardly"
        )
    blank = [drop.name for drop in tracked if drop.projectile.mass_sigma == 0]
    if blank:
        lines.append(f"mass_sigma_mg is 0 or not given in {shorten(blank)}: the mass is taken as exact")
    if campaign.sample.filling_factor_sigma == 0:
        lines.append("sample.filling_factor_sigma is 0: the filling factor is taken as exact")
    return lines


def shorten(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
