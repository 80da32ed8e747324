"""The sample is shallower than stated, or something hard lies in it: rigid, rough bottom at this depth.

The simulation holds a few layers of particles still below the floor. A floor below the dust that is simulated anyway
changes nothing. The effect is far from linear: the depth changes by 0.1 % where the floor is one tip radius below the deepest
point of the tip, by 1 to 2 % at 0.4 radii, by 4 to 8 % at none (p_m 1300 Pa, 0.5 and 1 m/s, five spacings a radius).
"""

from labsim.effects import Parameter, Uniform, all_pushed, deepest_expected, list_impacts
from labsim.sph.particles import WALL_LAYERS

title = "The sample is shallower than stated"
kind = "sample"


def parameters(campaign):
    stated = campaign.sample.depth
    largest = max(radius for radius, _, _ in list_impacts(campaign))
    felt = min(0.9 * deepest_expected(campaign) + 0.5 * largest, 0.8 * stated)
    low = min(largest, 0.5 * felt)
    return (
        Parameter(
            "depth",
            "m",
            null=stated,
            limits=(low, stated),
            prior=Uniform(low, stated),
            step=felt - stated,
            symbol="depth",
            text="Of the hard bottom below the surface. Every depth down to the stated one is as likely: a cup filled less, "
            "a stone, a compacted lump. The step goes to where the deepest drop begins to feel it.",
        ),
    )


leaves = (
    "The deepest drops, those of the largest tips, stop short and sooner; all others are as they should be. It is felt only "
    "where the tip comes within half its radius of the floor."
)
remedy = "use a deeper sample, or slower drops: the bottom is felt {value:.4g} m below the surface"
without = "in a deeper sample"
references = ("Seguin, Bertho & Gondret (2008): influence of confinement on granular penetration by impact",)
expect = {"penetration_depth": 1}


def applies(campaign):
    return "every projectile is pushed" if all_pushed(campaign) else ""


def change_setting(setting, values, place):
    depth = values["depth"] + WALL_LAYERS * setting.spacing
    return setting if depth >= setting.extent[1] else setting.replace(depth=depth)
