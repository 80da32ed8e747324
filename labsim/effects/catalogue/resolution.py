"""The simulation is not converged at the particle spacing in use: another spacing, of all drops in proportion.

Stated for the smallest tip of the campaign, with an eighth of its radius as the spacing in use; other tips and other
choices are scaled alike, so that the null is whatever is in use.
"""

from labsim.effects import Parameter, Uniform

SPACINGS_PER_RADIUS = 8.0

title = "The simulation is not converged in its particle spacing"
kind = "numerics"


def parameters(campaign):
    in_use = min(drop.projectile.tip_radius for drop in campaign.drops) / SPACINGS_PER_RADIUS
    limits = (0.4 * in_use, 1.4 * in_use)
    return (
        Parameter(
            "spacing",
            "m",
            null=in_use,
            limits=limits,
            prior=Uniform(*limits),
            step=-0.25 * in_use,
            symbol="Δx",
            text="Spacing that the data ask for. Nature has none; half the spacing in use is as far as the error's first "
            "order can be trusted, and coarser ones are there for tangents.",
        ),
    )


leaves = (
    "An error of depth with the sign and the shape of the difference between two spacings, largest for slow drops that "
    "press only a few particles; compare numerical_error in diagnosis.json."
)
references = ("Richardson extrapolation; docs/convergence.md for the measured order",)
expect: dict[str, int] = {}  # the sign is the scheme's and changes with speed


def change_setting(setting, values, place):
    smallest = place.smallest_tip_radius / SPACINGS_PER_RADIUS
    return setting.replace(spacing=setting.spacing * (values["spacing"] / smallest))
