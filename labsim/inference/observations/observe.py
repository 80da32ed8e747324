"""What a campaign measured, as the likelihood sees it: positions with their errors, maps with theirs.

Input: a Campaign. Output: Observed. Positions are never differentiated. Each drop's own curve (video/motion/curve.py) only says
which frames belong to the motion, and where the search for contact time and impact speed starts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, replace
from itertools import chain, zip_longest

import numpy as np

from ...errors import MeasurementError
from ...records import Campaign, DecelerationCurve, Drop, FloatArray, Track
from ...runs.workers import explain_loss, open_executor
from ...video.motion.choosing import NOISE_KNOWN
from ...video.motion.curve import fit_deceleration
from ...video.track_file import read_track
from .observe_acceleration import ObservedImpact, observe_impact
from .observe_push import ObservedPush, observe_push

MARGIN = 4  # frames kept after the depth has stopped growing
ASTRAY = 3.0  # times the scatter of the middle film, from which on a film says nothing of the others
FLIGHT_PARAMETERS = 2  # that free fall tells of a motion: contact and speed
DUST_PARAMETERS = 3  # that the rows in the dust tell of it besides
NUMBER = re.compile(r"(?:(?<=[\s(])-)?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
NAMES_FRAMES = re.compile(r"frames? \d")
MOST_NAMED = 6  # drops of which the same is said
# Warnings of a curve that say nothing to who compares drops: frames left out are counted, g is judged for all drops together.
SAID_ELSEWHERE = ("left out (frame", "no position", "free flight falls")


@dataclass(frozen=True)
class FilmedDrop:
    """One drop on the stated scales. time, depth : (n,) s, m; depth is positive below the stated surface; sigma : m, of a depth
    in the dust; flight_sigma : m, above it."""

    drop: Drop
    time: FloatArray
    depth: FloatArray
    sigma: float
    flight_sigma: float

    @property
    def name(self) -> str:
        return self.drop.name

    @property
    def pixel(self) -> float:
        assert self.drop.camera is not None
        return self.drop.camera.pixel_size


@dataclass(frozen=True)
class ObservedDrop(FilmedDrop):
    """One that was filmed. rejected : frames left out; track, curve : what it comes from."""

    rejected: int
    track: Track
    curve: DecelerationCurve

    @property
    def contact_time(self) -> float:
        """s, a starting value."""
        return self.curve.contact_time.value

    @property
    def impact_speed(self) -> float:
        """m/s on the stated scales, a starting value."""
        return self.curve.impact_speed.value


Observed = ObservedDrop | ObservedImpact | ObservedPush  # what one instrument recorded of one drop or push


def _list_warnings(seen: Observed) -> tuple[str, ...]:
    if isinstance(seen, ObservedPush):
        return seen.warnings
    return (seen.impact if isinstance(seen, ObservedImpact) else seen.curve).warnings


def observe_drop(drop: Drop, track: Track) -> ObservedDrop:
    """Depths on the stated scale up to the stop, outliers removed. Raises MeasurementError where nothing is left."""
    assert drop.camera is not None
    pixel = drop.camera.pixel_size
    place = drop.record.path or drop.name
    good = track.valid & np.isfinite(track.tip_row)
    rows = track.tip_row[good]
    if rows.size < 12 or np.all(rows[:3] > drop.camera.surface_row):
        raise MeasurementError(place, "tip_row_px", "shows no free fall above the surface")
    if np.sum(rows < drop.camera.surface_row) < 4:
        raise MeasurementError(
            place, "tip_row_px", "has fewer than four frames of free fall above the surface"
        )
    curve = fit_deceleration(track, drop.camera, name=place)
    assert curve.used is not None and curve.clock is not None
    use = good & curve.used
    sigma_px = float(np.median(track.sigma[good]))
    time, depth = curve.clock[use], (track.tip_row[use] - drop.camera.surface_row) * pixel
    if depth.max() < 5 * sigma_px * pixel:
        raise MeasurementError(place, "tip_row_px", "never reaches the surface")
    # where it comes to rest, from the whole record: after a rebound that is above the deepest point
    rest = (rows - drop.camera.surface_row) * pixel
    rest = rest[rest > 0.8 * depth.max()]
    final = np.median(rest) if rest.size > 6 else depth.max()
    reached = np.nonzero(depth > final - 2 * sigma_px * pixel)[0]
    last = min(reached[0] + MARGIN, depth.size) if reached.size else depth.size
    return ObservedDrop(
        drop=drop,
        time=time[:last],
        depth=depth[:last],
        sigma=sigma_px * pixel,
        flight_sigma=sigma_px * pixel,
        rejected=int(np.sum(good & ~curve.used & (curve.clock <= time[-1]))),
        track=track,
        curve=curve,
    )


def judge_noise(seen: Sequence[Observed]) -> list[Observed]:
    """The drops with the noise that their rows have in free fall and in the dust, each by itself: light and focus change along a
    film. The stated one is that of all frames at best. Its error bars count as NOISE_KNOWN frames against all films, these as
    much against one. A film that scatters beyond the middle one by more than ASTRAY says nothing of the others: its motion was
    not found.
    """
    films = {each.name: each for each in seen if isinstance(each, ObservedDrop)}
    dust = _compare_noise({name: _scatter(each, in_dust=True) for name, each in films.items()})
    flight = _compare_noise({name: _scatter(each, in_dust=False) for name, each in films.items()})
    return [
        replace(each, sigma=each.sigma * dust[each.name], flight_sigma=each.flight_sigma * flight[each.name])
        if isinstance(each, ObservedDrop)
        else each
        for each in seen
    ]


def _compare_noise(scatter: Mapping[str, tuple[float, int]]) -> dict[str, float]:
    """What the stated noise of each film has to be multiplied by. scatter : χ² and its degrees of freedom."""
    shown = [(square + NOISE_KNOWN) / (free + NOISE_KNOWN) for square, free in scatter.values()]
    most = ASTRAY**2 * float(np.median(shown or 1.0))
    alike = [one for one, each in zip(scatter.values(), shown, strict=True) if each <= most]
    squares, freedom = np.sum([*alike, (0.0, 0)], axis=0)
    common = (squares + NOISE_KNOWN) / (freedom + NOISE_KNOWN)
    return {
        name: math.sqrt((square + NOISE_KNOWN * common) / (free + NOISE_KNOWN))
        for name, (square, free) in scatter.items()
    }


def _scatter(drop: ObservedDrop, *, in_dust: bool) -> tuple[float, int]:
    """χ² of the rows in the dust, or of those in free fall, about the motion that was fitted to them alone, and its degrees of
    freedom."""
    curve, sigma = drop.curve, float(np.median(drop.track.sigma))
    assert curve.used is not None and curve.clock is not None and curve.residual is not None
    inside = curve.used & (curve.clock >= drop.time[0]) & (curve.clock <= drop.time[-1])
    inside &= (curve.clock > drop.contact_time) == in_dust
    left = curve.residual[inside & np.isfinite(curve.residual)]
    own = DUST_PARAMETERS if in_dust else FLIGHT_PARAMETERS
    return float(np.sum((left / sigma) ** 2)), max(left.size - own, 0)


def read_observed_track(drop: Drop) -> Track:
    """The track of a drop, from its file or from its video."""
    assert drop.camera is not None and drop.record.path is not None
    if drop.record.kind == "track":
        return read_track(drop.record.path, drop.camera, drop.record.row_sigma, left_out=drop.record.left_out)
    from ...video import open_frames, track_projectile  # the readers of pixels are only needed here

    return track_projectile(
        open_frames(drop.record.path),
        frame_rate=drop.camera.frame_rate,
        region=drop.record.region,
        left_out=drop.record.left_out,
    )


def _observe_filmed(drop: Drop) -> ObservedDrop:
    return observe_drop(drop, read_observed_track(drop))


def observe_drops(campaign: Campaign, *, workers: int | None = 1) -> tuple[list[Observed], list[str]]:
    """Every drop that shows something; a line for each that does not, and for each thing that its track warns of.

    workers : processes that films and tracks are measured on; None for one a core.
    Raises MeasurementError where no drop shows anything: the first one's; InferenceError where a worker dies.
    """
    seen: list[Observed] = []
    failures: list[tuple[str, MeasurementError]] = []
    filmed = {drop.name: drop for drop in campaign.drops if drop.record.kind in ("track", "video")}
    with open_executor(workers, None, len(filmed), compile_first=False) as (executor, _):
        measured = {name: executor.submit(_observe_filmed, drop) for name, drop in filmed.items()}
        for drop in campaign.drops:
            try:
                if drop.gauge is not None:
                    seen.append(observe_push(drop, campaign))
                elif drop.accelerometer is not None:
                    seen.append(observe_impact(drop))
                elif drop.name in measured:
                    seen.append(measured[drop.name].result())
            except MeasurementError as error:
                failures.append((drop.name, error))
            except BrokenExecutor as trouble:
                raise explain_loss(executor, trouble, campaign.folder) or trouble from None
    if failures and not seen:
        raise failures[0][1]
    seen = judge_noise(seen)
    lines = [f"drop {name} left out: {error}" for name, error in failures]
    lines += join_alike(
        (drop.name, text)
        for drop in seen
        for text in _list_warnings(drop)
        if not any(words in text for words in SAID_ELSEWHERE)
    )
    return seen, lines


def join_alike(said: Iterable[tuple[str, str]]) -> list[str]:
    """One line for all drops of which the same is said, numbers aside: these from the least to the largest.

    said : name of a drop and a text. What names frames stays apart.
    """
    alike: dict[str, list[tuple[str, str]]] = {}
    for name, text in said:
        words = f"{name} {text}" if NAMES_FRAMES.search(text) else NUMBER.sub("#", text)
        alike.setdefault(words, []).append((name, text))
    lines = []
    for each in alike.values():
        names, texts = zip(*each, strict=True)
        columns = zip(*(NUMBER.findall(text) for text in texts), strict=True)
        spans = [" to ".join(dict.fromkeys((min(c, key=float), max(c, key=float)))) for c in columns]
        joined = "".join(chain(*zip_longest(NUMBER.split(texts[0]), spans, fillvalue="")))
        further = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        lines.append(f"drop{'s' * (len(names) > 1)} {', '.join(names[:MOST_NAMED])}{further}: {joined}")
    return lines
