"""A drop that somebody wrote by hand, and ``labsim view`` in a process of its own, for tests that drive a browser."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DROP_TOML = """# written by hand
[projectile]
tip = "hemisphere"   # steel
tip_radius_mm = 0.500
length_mm = 4.00
mass_mg = 1.3299

[drop]
sequence = 10
height_mm = 19.94
height_sigma_mm = 0.15

[camera]
frame_rate_Hz = 10000.0
pixel_size_um = 20.00   # from the ruler
surface_row_px = 299.71  # by eye
surface_row_sigma_px = 0.15

# the record
[record]
file = "video.avi"
kind = "video"
"""


@contextmanager
def serving(path: Path) -> Iterator[str]:
    """``labsim view`` of a path; the address it prints."""
    process = subprocess.Popen(
        [sys.executable, "-m", "labsim", "view", str(path), "--no-browser", "--json"],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())["url"]
    finally:
        process.terminate()
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()
