"""What a law that nobody listed should be called: the place and the formulas that are right for what a campaign hides."""

from __future__ import annotations

import math
from dataclasses import dataclass

from benchmarks.campaigns.labelled import SMALL
from benchmarks.lagrangian_mesh.film_campaigns import LARGE
from labsim.effects.terms import list_terms

AREA = math.pi * SMALL**2
STRENGTH, SPEED, DEPTH, SIZE = "strength", "force of speed", "force of depth", "strength of size"
BOTH = "drag of depth"
MASS, SAMPLE, CAMERA = "mass", "sample", "camera"
NEAR = 1.5  # of a depth: as thick as a layer is, which is half of how deep it lies
# a place of a law, or the words of one without a formula -> where that is; others are their own names
WHERE = {
    "clock of row": CAMERA,
    "clock of time": CAMERA,
    "mass of depth": MASS,
    "gathered mass of depth": MASS,
    "strength of filling factor": STRENGTH,
    "strength of plastic strain": STRENGTH,
    "shear strength of plastic strain": STRENGTH,
    "strength of time": STRENGTH,
    "force of depth in mm": DEPTH,
    "force alike for all tips": DEPTH,
    "force on the rim": DEPTH,
    "strength of depth": SAMPLE,
    "a camera that wobbles": CAMERA,
    "undisturbed dust": SAMPLE,
    "depth and speed and undisturbed dust": SAMPLE,
}


@dataclass(frozen=True)
class HiddenLaw:
    """places : any of them is right; terms : formulas that have its form, with their coefficient where that is known."""

    places: tuple[str, ...]
    terms: dict[str, float | None]

    @property
    def own(self) -> tuple[str, float] | None:
        """The term that it is, and its coefficient."""
        return next(((name, size) for name, size in self.terms.items() if size is not None), None)


def find_place(term: str) -> str:
    """Where a term acts, in the words of this page."""
    place = list_terms()[term].place
    return WHERE.get(place, place)


def _list_near(families: tuple[str, ...], depth: float) -> dict[str, float | None]:
    """Terms of these families that stand within NEAR of a depth in mm."""
    return {
        name: None
        for name, term in list_terms().items()
        if name.startswith(families)
        and term.at is not None
        and abs(math.log(term.at / depth)) < math.log(NEAR)
    }


def find_law(truth: dict) -> HiddenLaw | None:
    """Of one campaign's truth; none where a cause of the catalogue is hidden."""
    forces, dust, measure = truth["dyn"], truth["mat"], truth["measure"]
    profile = (truth["profile"] or {}).get("kind")
    damage: dict[str, float | None] = dict.fromkeys(("shear_damage", "slow_shear_damage", "shear_softening"))
    if "inertial" in forces:
        return HiddenLaw((SPEED,), {"inertial_drag": forces["inertial"] / AREA})
    if "viscous" in forces:
        return HiddenLaw((SPEED,), {"viscous_drag": forces["viscous"] / AREA})
    if "shaft_drag" in forces:  # N s²/m² a metre of length
        return HiddenLaw((BOTH, SPEED, DEPTH), {"shaft_drag": forces["shaft_drag"] / (math.pi * SMALL)})
    if "pull" in forces:
        return HiddenLaw((DEPTH,), {"rim_pull": forces["pull"] / (2 * math.pi * SMALL), "pull": None})
    if "film" in forces:  # a force down to a depth in m
        near = _list_near(("skin_to", "film_at"), 1e3 * forces["film"][1])
        return HiddenLaw((DEPTH, SAMPLE), {**near, **dict.fromkeys(("surface_layer", "film_at_0_5"))})
    if "gathered" in forces:
        return HiddenLaw((MASS,), {"gathered_mass": forces["gathered"]})
    if "accrete" in forces:
        return HiddenLaw((MASS,), {"stuck_mass": forces["accrete"], "gathered_mass": forces["accrete"]})
    if "interface" in dust:
        near = _list_near(("layer_at", "film_at"), 1e3 * dust["interface"][0])
        return HiddenLaw((DEPTH, SAMPLE), {**near, "film_at_0_5": None})
    if profile == "layers":
        return HiddenLaw((DEPTH, SAMPLE), {})
    if truth.get("small_strength"):
        share = math.log(truth["small_strength"])
        curved = share / (1e-3 / SMALL - 1e-3 / LARGE)
        return HiddenLaw((SIZE,), {"size_power": share / math.log(SMALL / LARGE), "size_curvature": curved})
    if "weakening" in dust:
        return HiddenLaw((STRENGTH,), damage)
    if "hardening" in dust:
        return HiddenLaw((STRENGTH,), {"shear_hardening": dust["hardening"]})
    if "creep" in dust:
        return HiddenLaw((STRENGTH,), dict.fromkeys(("creep", "fast_relaxation", "relaxation")))
    if "wobble" in measure:
        return HiddenLaw((CAMERA,), {})
    if "line_time" in measure:
        return HiddenLaw((CAMERA,), {"rolling_shutter": 1e6 * measure["line_time"]})
    if "clock_drift" in measure:  # a share by the end of each film
        return HiddenLaw((CAMERA,), {"clock_drift": None})
    return None
