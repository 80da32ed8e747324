"""The pixel size is not the stated size: lengths in the video are true lengths over this factor, the CT is not touched."""

from labsim.effects import Normal, Parameter

title = "The pixel size is not the stated size"
says = ("The pixels are smaller than stated", "The pixels are larger than stated")
kind = "measurement"
parameters = (
    Parameter(
        "factor",
        "1",
        null=1.0,
        limits=(0.7, 1.4),
        prior=Normal(1.0, 0.05),
        step=0.03,
        symbol="pixel/pixel0",
        text="True over stated. A scale read in another plane than the drop is off by a few percent per lens and bench.",
    ),
)
leaves = (
    "Depths and speeds of all drops by the same factor, and the free fall before contact as well: gravity measured there is "
    "off by this factor, and the speed no longer agrees with the drop height."
)
remedy = (
    "measure the scale again: these drops ask for a pixel_size_um that is {value:.3f} times what "
    "drop.toml states"
)
references = ("Free fall: apparent g = g rate_factor^-2 / pixel_factor",)
expect = {"penetration_depth": -1, "stopping_time": 0}


def applies(campaign):
    tracked = any(drop.camera is not None for drop in campaign.drops)
    return "" if tracked else "there are published figures only, and no video or track"


def change_instrument(instrument, values, place):
    return instrument.replace(pixel_factor=instrument.pixel_factor * values["factor"])
