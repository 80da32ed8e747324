"""Frames per second of the tracker on one core: python -m benchmarks.speed.track [512]"""

from __future__ import annotations

import sys
import time

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render
from labsim.video import follow_projectile


def main() -> None:
    large = "512" in sys.argv
    recording = (
        Recording(shape=(512, 512), width=60.0, length=200.0, surface_row=400.0, column=250.0)
        if large
        else Recording()
    )
    count = 2000 if large else 900
    depth, _ = fall_and_stop(100, 60.3, 2.5, 30.0)
    pictures, _ = render(recording, depth)
    tail = pictures[-6:]
    pictures = pictures + [tail[i % 6] for i in range(count - len(pictures))]
    follow_projectile(make_frames(pictures[:100]))  # compile
    began, used = time.perf_counter(), time.process_time()
    follow_projectile(make_frames(pictures))
    wall, cpu = time.perf_counter() - began, time.process_time() - used
    print(
        f"{recording.shape}: {count} frames in {wall:.1f} s ({cpu:.1f} s of CPU), {count / cpu:.0f} frames/s of CPU"
    )


if __name__ == "__main__":
    main()
