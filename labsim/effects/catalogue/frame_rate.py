"""The frame rate is not the stated rate: times in the video are true times times this factor."""

from labsim.effects import Normal, Parameter

title = "The frame rate is not the stated rate"
says = ("The camera runs slower than stated", "The camera runs faster than stated")
kind = "measurement"
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.7, 1.4),
        prior=Normal(1.0, 0.05),
        step=0.03,
        symbol="rate/rate0",
        text="True over stated. Cameras keep their rate, but rates are written down rounded, or as chosen and not as given.",
    ),
)
leaves = (
    "Speeds and times of all drops are off and depths are not: gravity in the free fall before contact is off by the square "
    "of the factor, the speed against the drop height by the factor."
)
remedy = (
    "ask the camera for its rate: these drops ask for a frame_rate_Hz that is {value:.3f} times "
    "what drop.toml states"
)
references = ("Free fall: apparent g = g rate_factor^-2 / pixel_factor",)
expect = {"penetration_depth": 0, "stopping_time": 1}


def applies(campaign):
    tracked = any(drop.camera is not None for drop in campaign.drops)
    return "" if tracked else "there are published figures only, and no video or track"


def change_instrument(instrument, values, place):
    return instrument.replace(rate_factor=instrument.rate_factor * values["factor"])
