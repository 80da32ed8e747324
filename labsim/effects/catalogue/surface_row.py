"""The reference row of the surface is off: the true surface lies this many rows below the stated one, in every drop."""

from labsim.effects import Normal, Parameter

title = "The stated row of the surface is off"
kind = "measurement"


def parameters(campaign):
    sigma = max((drop.camera.surface_row_sigma for drop in campaign.drops if drop.camera), default=0.0)
    width = max(2.0, 3.0 * sigma)
    return (
        Parameter(
            "offset",
            "px",
            null=0.0,
            limits=(-10.0 * width, 10.0 * width),
            prior=Normal(0.0, width),
            step=0.5 * width,
            symbol="row - row0",
            text="True minus stated, the same in all drops. A rim hides the surface or its shadow is taken for it: a few "
            "pixels, and more than the stated uncertainty that each drop has for itself.",
        ),
    )


leaves = (
    "The same offset of depth in pixels in all drops, before and after contact, while the deceleration begins above or "
    "below the stated surface."
)
remedy = (
    "look at the row of the surface again: these drops ask for a surface_row_px that is "
    "{value:+.1f} from what drop.toml states"
)
references = ("Depth = (tip row - surface row) times pixel size",)
expect = {"penetration_depth": 1, "stopping_time": 0}


def applies(campaign):
    tracked = any(drop.camera is not None for drop in campaign.drops)
    return "" if tracked else "there are published figures only, and no video or track"


def change_instrument(instrument, values, place):
    return instrument.replace(row_offset_px=instrument.row_offset_px + values["offset"])
