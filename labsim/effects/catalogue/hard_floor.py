"""The sample is shallower than stated, or something hard lies in it: rigid, rough bottom at this depth.

The simulation holds a few layers of particles still, from one spacing above the floor on: the speed of dust falls to nought over
a smoothing length, and the first of these layers yields as dust does. So placed, a floor 0.8, 0.4, 0.2, 0.1 tip radii below where
a tip of 1.5 mm stops (1.61 mm deep, 0.5 m/s, p_m 1300 Pa) takes 0.59, 3.2, 6.7, 9.3 % of the depth, and the same on a Lagrangian
mesh to 0.1 % (twelve spacings a radius; tests/effects/test_floor.py). The spacing changes by what brings the floor to a layer.
A floor below the dust that is simulated anyway changes nothing. What it does grows e times every quarter of a radius; so what is
looked for, once drops are measured, is a floor that one of them can feel.
"""

import math
from dataclasses import replace

import numpy as np

from labsim.effects import Parameter, Uniform, all_pushed, deepest_expected, list_impacts
from labsim.sph.drop import FELT
from labsim.sph.particles import WALL_LAYERS

BEGINS, FADES = 0.4, 0.25  # tip radii below the deepest point of a tip, as FELT
YIELDS = 1  # layers of those held still, that lie above the floor
SCALE = 0.9  # of a measured depth: the scale of a film may be off

title = "The sample is shallower than stated"
kind = "sample"


def parameters(campaign):
    stated = campaign.sample.depth
    largest = max(radius for radius, _, _ in list_impacts(campaign))
    felt = min(0.9 * deepest_expected(campaign) + 0.5 * largest, 0.8 * stated)
    low = min(0.5 * largest, 0.5 * felt)
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


def narrow(parameter, measured):
    """The floor between the deepest tip and where none feels it."""
    depth, radius = np.transpose(measured)
    lowest = depth + FELT * radius
    largest, null = float(radius[lowest.argmax()]), min(float(lowest.max()), parameter.null)
    low = SCALE * min(float(depth.max()), null)
    return replace(
        parameter,
        null=null,
        limits=(low, null),
        prior=Uniform(low, null),
        step=max((BEGINS - FELT) * largest, 0.5 * (low - null)),
        fades=FADES * largest,
    )


leaves = (
    "The deepest drops, those of the largest tips, stop short and sooner; all others are as they should be. It is felt only "
    "where the tip comes within half its radius of the floor."
)
remedy = (
    "use a deeper sample, or slower drops: a tip that comes within half its radius of the bottom feels it"
)
without = "in a deeper sample"
references = ("Seguin, Bertho & Gondret (2008): influence of confinement on granular penetration by impact",)
expect = {"penetration_depth": 1}


def applies(campaign):
    return "every projectile is pushed" if all_pushed(campaign) else ""


def change_setting(setting, values, place):
    floor = values["depth"]
    if floor + (WALL_LAYERS - YIELDS) * setting.spacing >= setting.extent[1]:
        return setting
    free = max(math.ceil(floor / setting.spacing - 1e-6) - YIELDS, 1)  # no coarser than it was
    spacing = floor / (free + YIELDS)
    return setting.replace(spacing=spacing, depth=(free + WALL_LAYERS) * spacing)
