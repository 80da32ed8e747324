"""The package's types hold: every annotation is checked, and a ``type: ignore`` that nothing needs is an error."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from labsim.inference.fits.blocks import Block
from labsim.records import Track

ROOT = Path(__file__).parents[2]


def test_the_types_of_the_package_hold() -> None:
    pytest.importorskip("mypy")
    done = subprocess.run([sys.executable, "-m", "mypy", "labsim"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_arrays_whose_shapes_or_types_do_not_agree_are_refused_in_tests() -> None:
    with pytest.raises(TypeCheckError, match="covariance"):
        Block(np.ones(4), np.eye(3), {})
    with pytest.raises(TypeCheckError, match="tip_row"):
        Track(np.arange(3), np.zeros(3), np.zeros(4), np.ones(3), np.ones(3, bool), ("",) * 3)
    with pytest.raises(TypeCheckError, match="valid"):
        Track(np.arange(3), np.zeros(3), np.zeros(3), np.ones(3), np.ones(3), ("",) * 3)
