"""Cone beam through ASTRA: an exact ball where ASTRA and a CUDA device are there, one clear line where ASTRA is not."""

import importlib.util

import numpy as np
import pytest

from labsim.ct.slices.reconstruct import reconstruct_cone
from labsim.errors import MeasurementError

PIXEL, TO_AXIS, TO_CAMERA = 50e-6, 0.10, 0.05  # m


def project_ball(radius, attenuation, n=64, views=120):
    """Line integrals of a uniform ball on the axis: chords of the rays from source to pixel, the same in every view."""
    offset = (np.arange(n) - (n - 1) / 2) * PIXEL
    across, up = np.meshgrid(offset, offset)
    length = TO_AXIS + TO_CAMERA
    slope2 = (across**2 + up**2) / length**2
    distance2 = TO_AXIS**2 * slope2 / (1 + slope2)  # of the ray from the ball's centre
    chord = 2 * attenuation * np.sqrt(np.maximum(radius**2 - distance2, 0.0))
    return np.repeat(chord[None], views, axis=0), np.linspace(0, 2 * np.pi, views, endpoint=False)


@pytest.mark.skipif(importlib.util.find_spec("astra") is not None, reason="ASTRA is installed")
def test_without_astra_one_line_says_what_to_do():
    projections, angles = project_ball(6e-4, 500.0)
    with pytest.raises(MeasurementError, match="pip install astra-toolbox"):
        reconstruct_cone(projections, angles, PIXEL, TO_AXIS, TO_CAMERA)


def test_a_uniform_ball_comes_back():
    astra = pytest.importorskip("astra")
    if not astra.use_cuda():
        pytest.skip("ASTRA's cone-beam reconstruction needs a CUDA device")
    projections, angles = project_ball(6e-4, 500.0)
    volume = reconstruct_cone(projections, angles, PIXEL, TO_AXIS, TO_CAMERA)
    middle = volume.shape[0] // 2
    centre = volume[middle - 4 : middle + 4, middle - 4 : middle + 4, middle - 4 : middle + 4]
    assert centre.mean() == pytest.approx(500.0, rel=0.03)
