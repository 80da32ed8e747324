"""Where the projectile roughly is in one frame: its two ends, its axis and its width, to a pixel or so."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...records import FloatArray
from ..picture.scene import Scene

CUT_SHARE = (
    0.3  # of a body's rows that reach the picture's edge; flying dust that touches both reaches it in a few
)


@dataclass(frozen=True)
class Outline:
    """Ends and widths of the visible part (px). top is None above the picture, tip None in the dust or below it; cut says
    whether the picture's left or right edge goes through it."""

    top: float | None
    tip: float | None
    column_top: float
    column_tip: float
    width: float
    tip_width: float
    cut: bool = False


@dataclass(frozen=True)
class Body:
    """One dark body in a frame (px): centre of its box, its size and area."""

    y: float
    x: float
    height: float
    width: float
    area: float


class Outliner:
    """Finds outlines in the frames of one scene; only the columns near the projectile's path are looked at."""

    def __init__(self, scene: Scene) -> None:
        h, w = scene.background.shape
        first, last = scene.corridor
        margin = 12 + (last - first) // 6
        self.left = max(0, first - margin)
        self.right = min(w, last + margin + 1)
        part = (slice(None), slice(self.left, self.right))
        self.background = scene.background[part].astype(np.float32)
        self.level = np.float32(scene.projectile_level)
        lever = self.background - self.level
        y, x = np.mgrid[0:h, self.left : self.right]
        above = np.abs(lever) > 0.35 * scene.contrast
        if scene.surface is not None:
            above &= y < scene.surface[0] + scene.surface[1] * x - 2.0
        self.useful = above
        self.half = 0.5 * np.abs(lever)
        self.dark = bool(np.median(lever[above]) > 0) if above.any() else True
        # the row below which nothing can be seen any more
        self.floor = np.array([np.flatnonzero(above[:, k]).max(initial=0) for k in range(above.shape[1])])
        columns = np.arange(self.left, self.right)
        self.corridor = (columns >= first) & (columns <= last)

    def find(self, picture: np.ndarray, brightness: float) -> Outline | None:
        """Outline of the largest dark body in the corridor; None where there is none."""
        crop = cv2.blur(picture[:, self.left : self.right], (3, 3)).astype(np.float32) / np.float32(
            brightness
        )
        away = self.background - crop
        covered = ((away if self.dark else -away) > self.half) & self.useful
        count, labels, stats, _ = cv2.connectedComponentsWithStats(covered.astype(np.uint8), connectivity=4)
        best, size = 0, 30
        for k in range(1, count):
            box = stats[k]
            middle = int(box[cv2.CC_STAT_LEFT] + box[cv2.CC_STAT_WIDTH] // 2)
            if box[cv2.CC_STAT_AREA] > size and self.corridor[middle]:
                best, size = k, int(box[cv2.CC_STAT_AREA])
        if best == 0:
            return None
        x0, y0, bw, bh = (int(v) for v in stats[best][:4])
        body = labels[y0 : y0 + bh, x0 : x0 + bw] == best
        widths = body.sum(axis=1).astype(float)
        typical = float(np.median(widths))
        solid = np.flatnonzero(widths > 0.5 * typical)
        top_row, tip_row = y0 + int(solid[0]), y0 + int(np.flatnonzero(widths > 0)[-1])
        columns = np.arange(bw) + x0 + self.left

        def centre(rows: slice) -> float:
            part = body[rows]
            return float(np.sum(part.sum(axis=0) * columns) / max(part.sum(), 1))

        reach = max(6, int(typical))
        column_top = centre(slice(int(solid[0]), int(solid[0]) + reach))
        column_tip = centre(slice(max(0, bh - reach), bh))
        # near the tip: does the body end by itself, with background under it?
        under = round(column_tip) - self.left
        floor = self.floor[np.clip(under, 0, len(self.floor) - 1)]
        visible_tip = tip_row < floor - 1
        lower = widths[max(0, bh - reach) :]
        beside = [body[:, 0]] if x0 + self.left == 0 else []
        beside += [body[:, -1]] if x0 + bw + self.left == picture.shape[1] else []
        return Outline(
            top=float(top_row) - 0.5 if top_row > 1 else None,
            tip=float(tip_row) + 0.5 if visible_tip else None,
            column_top=column_top,
            column_tip=column_tip,
            width=float(np.median(widths[solid])),
            tip_width=float(lower.max()) if lower.size else typical,
            cut=any(np.mean(edge) > CUT_SHARE for edge in beside),
        )

    def find_bodies(self, picture: np.ndarray, brightness: float, share: float = 0.3) -> list[Body]:
        """All bodies near the path that cover at least ``share`` of the light, 30 px or more."""
        crop = cv2.blur(picture[:, self.left : self.right], (3, 3)).astype(np.float32) / np.float32(
            brightness
        )
        away = self.background - crop
        covered = ((away if self.dark else -away) > 2 * share * self.half) & self.useful
        count, _, stats, middles = cv2.connectedComponentsWithStats(covered.astype(np.uint8), connectivity=4)
        return [
            Body(
                float(middles[k][1]),
                float(middles[k][0]) + self.left,
                float(stats[k][cv2.CC_STAT_HEIGHT]),
                float(stats[k][cv2.CC_STAT_WIDTH]),
                float(stats[k][cv2.CC_STAT_AREA]),
            )
            for k in range(1, count)
            if stats[k][cv2.CC_STAT_AREA] >= 30
        ]


def choose_spread(positions: FloatArray, candidates: np.ndarray, count: int) -> np.ndarray:
    """Up to ``count`` of the candidates, evenly spread over the positions so that all sub-pixel phases take part."""
    if len(candidates) <= count:
        return candidates
    order = candidates[np.argsort(positions[candidates], kind="stable")]
    values = positions[order]
    wanted = np.linspace(values[0], values[-1], count)
    picks = np.clip(np.searchsorted(values, wanted), 0, len(order) - 1)
    return np.sort(np.unique(order[picks]))
