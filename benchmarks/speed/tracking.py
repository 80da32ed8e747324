"""Frames per CPU-second of the tracker, of trackpy.locate and of a template match, on the same frames.

    python -m benchmarks.speed.tracking [--frames 300]

The frames show a bead of 40 px that falls into dust, so that all three can be asked. labsim finds its lowest point with an
error bar, in flight and buried; trackpy finds the centroid of the brightest feature; the template match finds the shift of
a picture of the bead to a whole pixel. The last column is the rms distance from the true motion before contact, a constant
offset removed.
"""

from __future__ import annotations

import argparse
import time
import warnings

import cv2
import numpy as np

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render
from labsim.video import follow_projectile


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=300)
    given = parser.parse_args()
    cv2.setNumThreads(1)
    recording = Recording(bead=True)
    depth, _ = fall_and_stop(100, 60.3, 2.5, 30.0)
    pictures, _ = render(recording, depth)
    moving = len(pictures)
    pictures += [pictures[-1]] * max(given.frames - moving, 0)
    truth = recording.surface_row + np.asarray(depth)
    follow_projectile(make_frames(pictures[:moving]))  # compiles
    rows = []

    began = time.process_time()
    track = follow_projectile(make_frames(pictures)).track
    used = time.process_time() - began
    free = np.flatnonzero(np.asarray(depth[:moving]) < -3)
    seen = track.valid & np.isin(track.frame, free)
    rows.append(("labsim", len(pictures) / used, _scatter(track.tip_row[seen] - truth[track.frame[seen]])))

    box = _find_tip(recording, depth[0])
    template = pictures[0][box]
    began = time.process_time()
    found = [cv2.minMaxLoc(cv2.matchTemplate(p, template, cv2.TM_CCOEFF_NORMED))[3][1] for p in pictures]
    used = time.process_time() - began
    rows.append(
        (
            "cv2.matchTemplate",
            len(pictures) / used,
            _scatter(np.array(found)[free] - truth[free]),
        )
    )

    try:
        import trackpy
    except ImportError:
        print("no trackpy here: pip install trackpy")
    else:
        warnings.simplefilter("ignore")
        trackpy.quiet()
        top = int(recording.surface_row) - 2  # the dust would be its brightest feature
        few = [255 - pictures[k][:top] for k in free if depth[k] < -15]
        trackpy.locate(few[0], 41, topn=1)
        began = time.process_time()
        rows_found = [trackpy.locate(p, 41, topn=1).y.to_numpy() for p in few]
        used = time.process_time() - began
        y = np.array([r[0] if len(r) else np.nan for r in rows_found])
        rows.append(
            (
                "trackpy.locate, diameter 41",
                len(few) / used,
                _scatter(y - truth[[k for k in free if depth[k] < -15]]),
            )
        )

    print(f"{recording.shape[1]} x {recording.shape[0]} px, {len(pictures)} frames")
    print("| tracker | frames per CPU-second | rms before contact, px |\n| --- | --- | --- |")
    for name, rate, rms in rows:
        print(f"| {name} | {rate:.0f} | {rms:.3f} |")


def _find_tip(recording: Recording, depth: float) -> tuple[slice, slice]:
    row, half = int(recording.surface_row + depth), int(recording.width)
    column = int(recording.column)
    return slice(max(row - half, 0), row + 8), slice(max(column - half, 0), column + half)


def _scatter(difference: np.ndarray) -> float:
    return float(np.nanstd(difference))


if __name__ == "__main__":
    main()
