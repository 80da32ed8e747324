"""Whether the camera answers light in proportion: an edge that it draws lopsided says that it does not.

Across a blurred edge the light is an error function of the distance, alike on both sides of its middle. A camera that records
light to the power γ (0.45 in many colour and consumer cameras) draws it steeper on the dark side, and half its height no
longer lies at the edge.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from ...records import FloatArray
from ..projectile.template import Template
from .clipping import measure_distance

ACROSS = 5.0  # px on either side of the edge
MOST_PIXELS = 1500
SHARPEST = 0.8  # px of blur: a sharper edge has too few pixels on its flank to show its form
LEAST_LEVEL = 0.15  # of the brighter one: below, the curve is so steep at its dark end that every error of an edge fits it
LEAST_GAIN = 1.08  # by which γ must lower the sum of squares at both ends; sound recordings reach 1.03 at the better one


def find_gamma(template: Template, level: float, light: float) -> tuple[float, float, float] | None:
    """Exponent γ of the camera at one end of the projectile, px by which its edge seems to lie inside of where it is, and the
    ratio of the sums of squares without γ and with it. None where the edge does not show its form.

    level, light : grey levels of projectile and background. The black level is taken to be 0.
    """
    if not min(level, light) > LEAST_LEVEL * max(level, light):
        return None
    distance, count = measure_distance(template.opacity, 0.5)
    near = np.flatnonzero(((np.abs(distance) < ACROSS) & template.known).ravel())
    if count < 12 or near.size < 200:
        return None
    near = near[:: max(1, near.size // MOST_PIXELS)]
    d, m = distance.ravel()[near], template.opacity.ravel()[near]

    def residual(q: FloatArray, gamma: float) -> FloatArray:
        dark = (level / light) ** (1.0 / gamma)
        covered = ndtr((d - q[0]) / q[1])
        drawn = (1.0 - (1.0 - covered + dark * covered) ** gamma) / (1.0 - dark**gamma)
        return q[2] + (q[3] - q[2]) * drawn - m

    options = {"loss": "soft_l1", "f_scale": 0.02}
    low, high = [-3.0, 0.3, -0.2, 0.7], [3.0, 6.0, 0.2, 1.3]
    even = least_squares(lambda q: residual(q, 1.0), [0.3, 1.0, 0.0, 1.0], bounds=(low, high), **options)
    free = least_squares(
        lambda q: residual(q[:4], q[4]), [*even.x, 0.9], bounds=([*low, 0.2], [*high, 5.0]), **options
    )
    if even.x[1] < SHARPEST:
        return None
    return float(free.x[4]), float(even.x[0] - free.x[0]), float(even.cost / free.cost)


def describe_response(ends: list[tuple[float, float, float] | None]) -> str | None:
    """The warning where both ends tell the same curve of the camera, else None."""
    known = [end for end in ends if end is not None and end[2] > LEAST_GAIN]
    if len(known) < 2 or len(known) < len(ends) or (known[0][0] - 1.0) * (known[1][0] - 1.0) < 0:
        return None
    gamma = float(np.mean([end[0] for end in known]))
    shift = known[0][1]
    where = "high" if shift > 0 else "low"
    return (
        f"the edges are lopsided, as a camera with gamma {gamma:.2f} draws them: all rows lie about {abs(shift):.2f} px too "
        f"{where}, which is in no error bar; switch gamma off"
    )
