"""The nominal model leaves gravity out; here it acts on projectile and dust, which starts in hydrostatic balance."""

from labsim.effects import Normal, Parameter
from labsim.records import STANDARD_GRAVITY

title = "Gravity is left out of the nominal model"
kind = "projectile"
parameters = (
    Parameter(
        "g",
        "m/s^2",
        null=0.0,
        limits=(0.0, 20.0),
        prior=Normal(STANDARD_GRAVITY, 1.0),
        step=STANDARD_GRAVITY,
        symbol="g",
        text="If gravity is what is missing, it is that of the Earth; the width leaves room for a tilted or moving set-up.",
    ),
)
leaves = (
    "Slow, large and heavy drops go too deep: the extra depth is g times the square of the stopping time, the same at "
    "every speed (20 um for 1 mm, 160 um for 3 mm)."
)
references = ("Katsuragi & Durian (2007): weight in the equation of motion",)
expect = {"penetration_depth": 1, "stopping_time": 1}


def applies(campaign):
    return "" if campaign.gravity == 0.0 else f"the nominal model has gravity, {campaign.gravity:g} m/s^2"


def change_setting(setting, values, place):
    return setting.replace(gravity=setting.gravity + values["g"])
