"""The sample is shallower than stated, or something hard lies in it: rigid, rough bottom at this depth.

The simulation holds a few layers of particles still below the floor. A floor below the dust that is simulated anyway
changes nothing. The effect is far from linear: it sets in within about two tip radii above the floor.
"""

from labsim.effects import Parameter, Uniform, deepest_expected, list_thrown
from labsim.sph.particles import WALL_LAYERS

title = "The sample is shallower than stated"
kind = "sample"


def parameters(campaign):
    stated = campaign.sample.depth
    largest = max(radius for radius, _, _ in list_thrown(campaign))
    felt = min(deepest_expected(campaign) + largest, 0.8 * stated)
    low = min(2.0 * largest, 0.5 * felt)
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
            "a stone, a compacted lump. The step goes to one tip radius below the deepest drop that is expected.",
        ),
    )


leaves = (
    "The deepest drops stop short, the others are as they should be; with two radii the larger tip feels it "
    "at smaller depths in units of its radius."
)
references = (
    "Seguin, Bertho & Gondret (2008), Phys. Rev. E 78, 010301: influence of confinement on granular penetration by impact",
)
expect = {"penetration_depth": 1}


def change_setting(setting, values, place):
    depth = values["depth"] + WALL_LAYERS * setting.spacing
    return setting if depth >= setting.extent[1] else setting.replace(depth=depth)
