"""What is seen of a video in which nothing could be tracked: pictures with what was found on them, for a look."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..errors import MeasurementError
from .frames import Frames
from .overlay import BLUE, GREEN
from .picture.scene import Scene, survey_scene
from .projectile.outline import Outliner

SHOWN = (0.0, 0.25, 0.5, 0.75)  # of the record


def draw_scene(frames: Frames) -> tuple[list[np.ndarray], list[str]]:
    """(rows, columns, 3) uint8 RGB each, and their captions: the first picture and some after it, with the surface and the
    projectile's ends where they are seen, and what moves. Raises MeasurementError where no picture can be read."""
    wanted = sorted({int(share * (frames.count - 1)) for share in SHOWN})
    pictures, low, high = {}, None, None
    try:
        for number, picture in enumerate(frames):
            if number in wanted:
                pictures[number] = picture
            low = picture if low is None else np.minimum(low, picture)
            high = picture if high is None else np.maximum(high, picture)
    except MeasurementError:  # what was read until then is shown
        pass
    if not pictures or low is None or high is None:
        raise MeasurementError(
            frames.path, "video", "holds no picture that can be read; record or export it again"
        )
    try:
        scene = survey_scene(replace(frames, warnings=[]))
    except MeasurementError:
        scene = None
    drawn = [_draw(picture, number, scene) for number, picture in pictures.items()]
    drawn.append(_colour(high - low))
    return drawn, [f"frame {number}" for number in pictures] + ["what changes"]


def _colour(picture: np.ndarray) -> np.ndarray:
    top = max(float(np.percentile(picture, 99.5)), 1.0)
    grey = np.clip(picture.astype(np.float32) * (235.0 / top), 0, 255).astype(np.uint8)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)


def _draw(picture: np.ndarray, number: int, scene: Scene | None) -> np.ndarray:
    image = _colour(picture)
    if scene is None:
        return image
    wide = image.shape[1]
    if scene.surface is not None:
        left, right = (round(scene.surface[0] + scene.surface[1] * x) for x in (0, wide))
        cv2.line(image, (0, left), (wide, right), BLUE[::-1], 1)
    outline = (
        Outliner(scene).find(picture, scene.brightness[number]) if number < len(scene.brightness) else None
    )
    if outline is not None:
        for end, column in ((outline.top, outline.column_top), (outline.tip, outline.column_tip)):
            if end is not None:
                reach = max(8, round(0.6 * outline.width))
                at = round(column), round(end)
                cv2.line(image, (at[0] - reach, at[1]), (at[0] + reach, at[1]), GREEN[::-1], 1)
    return image
