"""Forces that go with the depth of the tip."""

import numpy as np

from . import Term

PLACE = "force of depth"
TERMS = (
    Term(
        "constant_pressure", "a pressure alike at all depths", PLACE, "Pa", "1",
        lambda z: np.ones_like(z), "Cohesion, a yield stress: Uehara et al. (2003)",
    ),
    Term(
        "depth_spring", "a pressure that grows with the depth", PLACE, "Pa", "z/a",
        lambda z: z, "Friction under the weight of the dust: Katsuragi & Durian (2007)",
    ),
    Term(
        "depth_square", "a pressure that grows with the square of the depth", PLACE, "Pa", "(z/a)²",
        lambda z: z**2, "A shaft whose friction grows with depth; mass that grows",
    ),
    Term(
        "surface_layer", "a pressure near the surface", PLACE, "Pa", "exp(−2 z/a)",
        lambda z: np.exp(-2.0 * z), "A crust that gives way, half a tip radius deep",
    ),
    Term(
        "deep_resistance", "a pressure that begins two tip radii deep", PLACE, "Pa", "(z/a − 2), where that is positive",
        lambda z: np.maximum(z - 2.0, 0.0), "A floor that is felt, a denser layer below",
    ),
    Term(
        "depth_root", "a pressure that grows with the root of the depth", PLACE, "Pa", "√(z/a)",
        lambda z: np.sqrt(z), "A force that grows with the contact of a tip that is not yet buried",
    ),
    Term(
        "thick_surface_layer", "a pressure that fades over a tip radius", PLACE, "Pa", "exp(−z/a)",
        lambda z: np.exp(-z), "A crust as thick as the tip",
    ),
    Term(
        "resistance_below_1", "a pressure that begins one tip radius deep", PLACE, "Pa", "(z/a − 1), where that is positive",
        lambda z: np.maximum(z - 1.0, 0.0), "A denser layer below",
    ),
    Term(
        "resistance_below_3", "a pressure that begins three tip radii deep", PLACE, "Pa", "(z/a − 3), where that is positive",
        lambda z: np.maximum(z - 3.0, 0.0), "A floor that is felt, a denser layer below",
    ),
    Term(
        "layer_below_1", "a pressure alike below one tip radius", PLACE, "Pa", "1 from one radius on, grown over half of one",
        lambda z: 0.5 + 0.5 * np.tanh((z - 1.0) / 0.25), "A stronger layer with an edge",
    ),
    Term(
        "layer_below_2", "a pressure alike below two tip radii", PLACE, "Pa", "1 from two radii on, grown over half of one",
        lambda z: 0.5 + 0.5 * np.tanh((z - 2.0) / 0.25), "A stronger layer with an edge",
    ),
)  # fmt: skip
