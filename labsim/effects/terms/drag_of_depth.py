"""Forces against the motion that grow with the depth and with the speed: of a shaft, of dust that closes behind the tip."""

from . import Term

SQUARE, LINEAR = "drag of depth", "viscosity of depth"
TERMS = (
    Term(
        "shaft_drag", "a drag of the square of the speed that grows with the depth", SQUARE, "Pa s²/m²", "z/a",
        lambda z: z, "Momentum given to the dust along the immersed length",
    ),
    Term(
        "shaft_drag_late", "a drag of the square of the speed, ever more with depth", SQUARE, "Pa s²/m²", "(z/a)²",
        lambda z: z**2, "Dust that is denser below, or a cone that widens",
    ),
    Term(
        "shaft_viscosity", "a drag of the speed that grows with the depth", LINEAR, "Pa s/m", "z/a",
        lambda z: z, "Gas or grains sheared along the immersed length",
    ),
    Term(
        "shaft_viscosity_late", "a drag of the speed, ever more with depth", LINEAR, "Pa s/m", "(z/a)²",
        lambda z: z**2, "Gas that leaves the pores more slowly from deeper down",
    ),
)  # fmt: skip
