"""Numbers in sentences."""

import pytest

from labsim.effects import list_effects
from labsim.report.pages.phrases import say_amount


@pytest.mark.parametrize(
    ("effect", "value", "said"),
    [
        ("pore_gas", 4693.0, "4.69 kPa"),
        ("surface_crust", 0.05012, "0.0501"),
        ("ct_blur", 1.2e-4, "0.12 mm"),
        ("strength_rate", 0.0521, "0.0521 s^n"),
        ("side_friction", 0.3781, "0.378 N/m"),
    ],
)
def test_amounts_are_said_in_the_units_people_use(effect, value, said):
    assert say_amount(list_effects()[effect].amplitudes[0], value) == said
