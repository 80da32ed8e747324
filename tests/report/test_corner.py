"""Pictures of posteriors."""

import os
import subprocess
import sys

DRAW = """
import numpy as np
import labsim.report.outputs
from labsim.report.figures.style import new_corner
from pathlib import Path
values = np.random.default_rng(0).normal(size=(400, 2))
with new_corner(Path("corner.png"), values, labels=["a", "b"]):
    pass
"""


def test_the_first_picture_of_a_day_comes_without_a_warning(tmp_path):
    """arviz, which corner imports, warns once a day: a stamp in the cache says whether it has."""
    command = [sys.executable, "-W", "error::FutureWarning", "-c", DRAW]
    place = dict(os.environ, XDG_CACHE_HOME=str(tmp_path / "cache"))
    done = subprocess.run(command, cwd=tmp_path, env=place, capture_output=True, text=True)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert (tmp_path / "corner.png").stat().st_size > 10_000
