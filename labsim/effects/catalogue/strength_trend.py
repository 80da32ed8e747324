"""The strength grows across the site: strength times exp(growth s), s the way in direction ``azimuth`` from the
middle of all places.
"""

import math

from labsim.calibrated import scale_value
from labsim.effects import Normal, Parameter, Uniform, find_middle

title = "The strength changes across the site"
kind = "sample"


def parameters(campaign):
    east, north = find_middle(campaign)
    places = [drop.position for drop in campaign.drops if drop.position is not None]
    reach = max([math.hypot(x - east, y - north) for x, y in places], default=0.0) or 1.0
    return (
        Parameter(
            "growth",
            "1/m",
            null=0.0,
            limits=(-1.0 / reach, 1.0 / reach),
            prior=Normal(0.0, 0.1 / reach),
            step=0.05 / reach,
            symbol="d ln s/dx",
            text="Natural ground differs by some percent from one end of a site to the other.",
        ),
        Parameter(
            "azimuth",
            "deg",
            null=90.0,
            limits=(0.0, 180.0),
            prior=Uniform(0.0, 180.0),
            step=45.0,
            shape=True,
            symbol="α",
            text="Direction in which it grows, from north over east; nobody knows it.",
        ),
    )


leaves = "Residuals that follow the place of the pushes and not their speed or order."
remedy = "mix speeds and places, and repeat one push where the first was made"
references = ("Phoon & Kulhawy (1999): how ground varies from place to place",)
expect: dict[str, int] = {}


def applies(campaign):
    stated = {drop.position for drop in campaign.drops if drop.position is not None}
    return "" if len(stated) > 3 else "fewer than four drops state where they were made (drop.position_m)"


def change_setting(setting, values, place):
    if place.position is None:
        return setting
    angle = math.radians(values["azimuth"])
    way = place.position[0] * math.sin(angle) + place.position[1] * math.cos(angle)
    return setting.replace(material=scale_value(setting.material, math.exp(values["growth"] * way)))
