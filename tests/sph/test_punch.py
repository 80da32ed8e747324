"""A flat punch on cohesive matter against limit analysis, by benchmarks/solver/flat_punch.py."""

import math

import pytest

from benchmarks.solver import flat_punch


@pytest.mark.slow
@pytest.mark.parametrize(
    ("geometry", "low", "high"),
    [
        (
            "planar",
            0.95 * 2 / math.sqrt(3) * flat_punch.PRANDTL,
            1.05 * 2 / math.sqrt(3) * flat_punch.PRANDTL,
        ),
        ("axisymmetric", flat_punch.ROUND, 2 / math.sqrt(3) * flat_punch.ROUND),
    ],
)
def test_flat_punch(geometry, low, high):
    """The strip to 5 %; the round punch between Tresca's answers for the hexagons within and around von Mises' circle."""
    run = flat_punch.push_punch(geometry, 16)
    found = flat_punch.read_resistance(run)
    print(f"{geometry}: {found:.3f} cohesions, {low:.3f} to {high:.3f}; energy {run.energy_error:+.2%}")
    assert low < found < high
    assert abs(run.energy_error) < 0.01
