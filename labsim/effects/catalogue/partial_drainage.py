"""Slow pushes let the pore water out, so that the ground about the tip consolidates and resists more: strength times
1 + gain/(1 + v/v_half), v the speed of the push.

The backbone curve of DeJong & Randolph (2012) with exponent 1. Fast pushes are undrained: what is calibrated is their strength.
"""

from labsim.calibrated import scale_value
from labsim.effects import HalfNormal, LogNormal, Parameter

title = "Slow pushes are partly drained"
kind = "sample"
parameters = (
    Parameter(
        "gain",
        "1",
        null=0.0,
        limits=(0.0, 10.0),
        prior=HalfNormal(1.0),
        step=0.5,
        symbol="q_d/q_u - 1",
        text="Resistance of a drained push over that of an undrained one, minus one: 1 to 3 in clays and silts.",
    ),
    Parameter(
        "half_speed",
        "mm/s",
        null=1.0,
        limits=(0.001, 100.0),
        prior=LogNormal(1.0, 1.5),
        step=0.5,
        shape=True,
        symbol="v_½",
        text="Speed at which half of the gain is left. Clays are undrained at 20 mm/s with a cone of 36 mm, silts hardly.",
    ),
)
leaves = (
    "Slow pushes meet more resistance than fast ones: the opposite of a strength that grows with the rate."
)
remedy = "push faster, or leave the slow pushes out: what is simulated is undrained"
references = ("DeJong & Randolph (2012): influence of partial consolidation on cones",)
expect: dict[str, int] = {}


def applies(campaign):
    speeds = {
        dict(drop.motion.values).get("speed") for drop in campaign.drops if drop.motion.kind == "pushed"
    }
    return "" if len(speeds) > 1 else "there are no pushes at two speeds"


def change_setting(setting, values, place):
    speed = dict(setting.motion.values).get("speed")
    if speed is None:
        return setting
    factor = 1.0 + values["gain"] / (1.0 + 1e3 * speed / values["half_speed"])
    return setting.replace(material=scale_value(setting.material, factor))
