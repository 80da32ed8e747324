"""CPU time of a CT reduction per voxel, and how it grows: python -m benchmarks.speed.scans [--edges 56,80,112]"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from benchmarks.truths.phantom import Phantom
from labsim.ct import reduce_scan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", default="56,80,112")
    given = parser.parse_args()
    print("| slices x rows x columns | voxels | CPU | per voxel |\n| --- | --- | --- | --- |")
    for edge in map(int, given.edges.split(",")):
        scale = edge / 56
        shape = (round(64 * scale), edge, edge)
        centre = (28.3 * scale, 27.6 * scale, 26.4 * scale)
        phantom = Phantom(shape=shape, centre=centre, radius=7.5 * scale, surface=16.0 * scale)
        with tempfile.TemporaryDirectory() as folder:
            scan = phantom.write(Path(folder) / "slices")
            if edge == int(given.edges.split(",")[0]):
                reduce_scan(scan)  # compiles, imports
            began = time.process_time()
            reduce_scan(scan)
            used = time.process_time() - began
        voxels = shape[0] * shape[1] * shape[2]
        print(
            f"| {shape[0]} x {edge} x {edge} | {voxels / 1e6:.2f} million | {used:.2f} s | {used / voxels * 1e9:.0f} ns |",
            flush=True,
        )


if __name__ == "__main__":
    main()
