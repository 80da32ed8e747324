"""A bare bead or ball in flight: found among other moving things by its fall, fitted as a disc smeared by its motion.

A rod keeps its look, so a fixed template serves it best. A bead that is fast for its exposure does not: it grows longer
along the fall as it speeds up. Here every frame gets a disc of its own, drawn out over its smear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...records import FloatArray
from ..frames import Frames
from ..picture.scene import Scene
from .disc import REACH, Disc, fit_disc
from .outline import Body, Outline, Outliner

LEAST_ARC = 120.0  # degrees of the outline that must be seen for a centre
DISTURBED = "bead disturbed (hand, shadow?)"
MOST_KEPT_BYTES = 200_000_000
MOST_BODIES = 12  # per frame, the largest
SAMPLE = 16  # discs that say whether the smear changes
LEAST_SAMPLE = 4
MOST_CHANGE = 1.0  # px of smear that a fixed template can bear
FAR = 12  # frames beyond its neighbours in which a bead is still looked for


@dataclass(frozen=True)
class BeadTrack:
    """A bead over all frames, (n,) each: centre, error bar and smear, NaN where not seen; and what they share."""

    y: FloatArray
    x: FloatArray
    sigma: FloatArray
    smear: FloatArray
    reason: list[str]
    radius: float
    radius_sigma: float


def is_bead(outlines: list[Outline | None]) -> bool:
    """Whether the body may be a bare bead: about as high as wide, or the largest one jumps between several in view."""
    seen = [o for o in outlines if o is not None and o.top is not None and o.tip is not None]
    if len(seen) < 8:
        return False
    height = float(np.median([o.tip - o.top for o in seen]))  # type: ignore[operator]
    width = float(np.median([o.width for o in seen]))
    return height < 1.6 * width or (height < 3 * width and _jumps(outlines, width))


def _jumps(outlines: list[Outline | None], width: float) -> bool:
    """Whether the largest body is another one from frame to frame, three times or more."""
    tip = np.array([np.nan if o is None or o.tip is None else o.tip for o in outlines], float)
    step = np.diff(tip)
    step = step[np.isfinite(step)]
    return int(np.sum(np.abs(step - np.median(step)) > max(2 * width, 12.0))) >= 3


def _needs_disc(
    frames: Frames, scene: Scene, usable: np.ndarray, known: dict[int, Body], outlines: list[Outline | None]
) -> bool:
    """Whether a fixed template does not serve this bead: something else is in view, or its smear changes.

    The smear is told by some discs, evenly spread over the fall: fitting all of them takes longer than all the rest.
    """
    if _jumps(outlines, float(np.median([o.width for o in outlines if o is not None]))):
        return True
    chosen = sorted(known)[:: -(-len(known) // SAMPLE)]
    fall = _Fall(scene, usable, known, len(outlines))
    for i, picture in enumerate(frames):
        if i in chosen:
            fall.fit(i, picture, max(0.0, known[i].height - known[i].width))
    if not fall.settle_radius(least=LEAST_SAMPLE):
        return False
    for i in chosen:
        fall.judge(i)
    smear = [
        disc.smear for disc, good in zip(fall.discs, fall.fitted, strict=True) if disc is not None and good
    ]
    return len(smear) >= LEAST_SAMPLE and float(np.subtract(*np.percentile(smear, [95, 5]))) > MOST_CHANGE


def link_fall(bodies: list[list[Body]]) -> list[Body | None]:
    """The chain of bodies, at most one a frame, that falls furthest without a jump; None where it has no member.

    A step may differ from the one before by a third of it or 4 px, and sizes by a factor of 2; up to two frames may be
    missing in between. What stands still (a hand, a ghost in the background) earns nothing.
    """
    # states are links, not bodies: a first step to a wrong body must not hide the right one
    links: list[dict[tuple[int, int, int], tuple[float, float, tuple[int, int, int, int] | None]]] = []
    bodies = [sorted(here, key=lambda body: -body.area)[:MOST_BODIES] for here in bodies]
    for i, here in enumerate(bodies):
        links.append({})
        for k, body in enumerate(here):
            for back in range(1, min(3, i) + 1):
                for j, other in enumerate(bodies[i - back]):
                    step = (body.y - other.y) / back
                    if step < 0.5 or step > 4.0 * max(body.width, other.width):
                        continue
                    if abs(body.x - other.x) > back * max(6.0, 0.5 * step):
                        continue
                    if not 0.5 < body.area / other.area < 2.0:
                        continue
                    score, before = 0.0, None
                    for link, (earlier, speed, _) in links[i - back].items():
                        if link[0] == j and earlier > score and abs(step - speed) <= max(4.0, speed / 3.0):
                            score, before = earlier, (i - back, *link)
                    links[i][k, back, j] = (score + min(step, 10.0), step, before)
    chain: list[Body | None] = [None] * len(bodies)
    ends = [(value[0], (i, *link)) for i, here in enumerate(links) for link, value in here.items()]
    at = max(ends, default=(0.0, None))[1]
    while at is not None:
        i, k, back, j = at
        chain[i], chain[i - back] = bodies[i][k], bodies[i - back][j]
        at = links[i][k, back, j][2]
    return chain


def follow_bead(
    frames: Frames, scene: Scene, usable: np.ndarray, outlines: list[Outline | None]
) -> BeadTrack | None:
    """Fit the disc in every frame of the fall; None where nothing falls like a bead, or a fixed template serves as well."""
    outliner = Outliner(scene)
    bodies = [outliner.find_bodies(p, float(scene.brightness[i])) for i, p in enumerate(frames)]
    chain = link_fall(bodies)
    known = {i: body for i, body in enumerate(chain) if body is not None}
    if len(known) < 8 or not _needs_disc(frames, scene, usable, known, outlines):
        return None
    fall = _Fall(scene, usable, known, len(bodies))
    for i, picture in enumerate(frames):
        if i in known:
            fall.fit(i, picture, max(0.0, known[i].height - known[i].width))
        if fall.first <= i <= fall.last:
            fall.keep(i, picture)
    if not fall.settle_radius():
        return None
    for i in known:
        fall.judge(i)
    for order in (range(fall.first, fall.last + 1), range(fall.last, fall.first - 1, -1)):
        for i in order:
            if not fall.fitted[i]:
                fall.fit_from_neighbours(i)
    return fall.conclude()


class _Fall:
    """The fits of one fall while they are made: starting places, discs and what was found wrong with them."""

    def __init__(self, scene: Scene, usable: np.ndarray, known: dict[int, Body], count: int) -> None:
        self.scene, self.usable = scene, usable
        self.y, self.x = np.full(count, np.nan), np.full(count, np.nan)
        for i, body in known.items():
            self.y[i], self.x[i] = body.y, body.x
        places = np.array([(b.y, b.x) for b in known.values()])
        tall = np.ptp(places[:, 0]) > 10
        self.slope = float(np.polyfit(places[:, 0], places[:, 1], 1)[0]) if tall else 0.0
        self.radius = 0.5 * float(np.median([b.width for b in known.values()]))
        self.discs: list[Disc | None] = [None] * count
        self.reason = ["no bead in view"] * count
        self.fitted = np.zeros(count, bool)
        self.first, self.last = max(0, min(known) - 8 * FAR), min(count - 1, max(known) + 2 * FAR)
        self.pictures: dict[int, np.ndarray] = {}
        columns = places[:, 1]
        wide = 2 * self.radius + 2 * REACH
        self.left = max(0, int(columns.min() - wide))
        self.right = int(columns.max() + wide) + 1

    def keep(self, i: int, picture: np.ndarray) -> None:
        """Keep the strip of the fall for a second look, as long as there is room for it."""
        strip = np.ascontiguousarray(picture[:, self.left : self.right])
        if strip.nbytes * (len(self.pictures) + 1) <= MOST_KEPT_BYTES:
            self.pictures[i] = strip

    def fit(self, i: int, picture: np.ndarray, smear: float) -> None:
        self.discs[i] = fit_disc(
            picture,
            self.scene.background,
            self.usable,
            (self.scene.noise, self.scene.projectile_level, float(self.scene.brightness[i])),
            (float(self.y[i]), float(self.x[i])),
            self.radius,
            smear,
            self.slope,
        )

    def settle_radius(self, least: int = 8) -> bool:
        """The median radius of all discs is the bead's; False with fewer than ``least``."""
        radii = [d.radius for d in self.discs if d is not None]
        self.radius = float(np.median(radii)) if radii else np.nan
        return len(radii) >= least

    def judge(self, i: int) -> None:
        """Accept the disc of frame i or say why not."""
        disc = self.discs[i]
        if disc is None:
            self.reason[i] = "bead cannot be fitted"
        elif disc.arc < LEAST_ARC:
            self.reason[i] = f"only {disc.arc:.0f}° of the bead's outline in view"
        elif (
            abs(disc.radius - self.radius) > 0.2 * self.radius
            or np.hypot(disc.y - self.y[i], disc.x - self.x[i]) > 0.7 * self.radius
        ):
            self.reason[i] = DISTURBED
        else:
            self.reason[i] = ""
            self.y[i], self.x[i], self.fitted[i] = disc.y, disc.x, True

    def fit_from_neighbours(self, i: int) -> None:
        """Try a frame in which the bead touches something else or is faint, from where its neighbours say it is.

        What stands behind it then is taken from the frames around, in which it is elsewhere: a hand that lets go of it
        is in the picture for longer than the bead.
        """
        near = np.flatnonzero(self.fitted)
        near = near[np.argsort(np.abs(near - i), kind="stable")[:6]]
        if len(near) < 5 or np.abs(near - i).min() > FAR or i not in self.pictures:
            return
        y, x = (float(np.polyval(np.polyfit(near - i, place[near], 2), 0.0)) for place in (self.y, self.x))
        picture = self.pictures[i]
        if not (0 <= y < picture.shape[0] and 0 <= x - self.left < picture.shape[1]):
            self.reason[i] = "bead out of the picture"
            return
        self.y[i], self.x[i] = y, x
        smear = float(np.median([d.smear for d in (self.discs[k] for k in near) if d is not None]))
        reach = int(2 * self.radius + smear + REACH) + 2
        rows = slice(max(0, int(y) - reach), int(y) + reach + 1)
        clear = [
            k
            for k in range(i - 3 * FAR, i + 3 * FAR + 1)
            if k in self.pictures and self.fitted[k] and abs(self.y[k] - y) > reach
        ][:11]
        part = (slice(None), slice(self.left, self.right))
        ground, usable = self.scene.background[part].copy(), self.usable[part].copy()
        if len(clear) >= 5:
            level = np.stack([self.pictures[k][rows] / self.scene.brightness[k] for k in clear])
            ground[rows] = np.median(level, axis=0)
            lever = np.abs(ground[rows] - self.scene.projectile_level)
            usable[rows] &= lever > 0.35 * self.scene.contrast
        disc = fit_disc(
            picture,
            ground,
            usable,
            (self.scene.noise, self.scene.projectile_level, float(self.scene.brightness[i])),
            (y, x - self.left),
            self.radius,
            smear,
            self.slope,
        )
        self.discs[i] = None if disc is None else replace(disc, x=disc.x + self.left)
        self.judge(i)

    def conclude(self) -> BeadTrack | None:
        """The track of the accepted discs, those that fit far worse than usual left out; None with fewer than eight."""
        accepted = {i: d for i, d in enumerate(self.discs) if self.fitted[i] and d is not None}
        if len(accepted) < 8:
            return None
        usual = float(np.median([d.misfit for d in accepted.values()]))
        values = np.full((4, len(self.discs)), np.nan)
        radii = []
        for i, disc in accepted.items():
            if disc.misfit > 3.0 * usual:
                self.reason[i] = DISTURBED
                continue
            values[:, i] = disc.y, disc.x, disc.sigma, disc.smear
            radii.append(disc.radius)
        spread = float(np.std(radii)) / np.sqrt(len(radii))
        y, x, sigma, smear = values
        return BeadTrack(y, x, sigma, smear, self.reason, float(np.median(radii)), max(spread, 0.02))
