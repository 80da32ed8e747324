"""Forces against the motion, and strengths of the dust, that go with the time since contact."""

import numpy as np

from . import Term

PLACE, STRENGTH = "force of time", "strength of time"
TERMS = (
    Term(
        "time_ramp", "a force that grows with the time since contact", PLACE, "Pa", "t/ms",
        lambda t: t, "Contacts that strengthen with their age; gas that builds up",
    ),
    Term(
        "time_root", "a force that grows with the root of the time since contact", PLACE, "Pa", "√(t/ms)",
        lambda t: np.sqrt(t), "Diffusion: gas or heat that spreads from the tip",
    ),
    Term(
        "time_rise", "a force that is there after a millisecond", PLACE, "Pa", "1 − exp(−t/ms)",
        lambda t: 1.0 - np.exp(-t), "Contacts that need a time to form",
    ),
    Term(
        "creep", "a strength that goes with the logarithm of the time since contact", STRENGTH, "1", "ln(1 + t/ms)",
        lambda t: np.log1p(t), "Dust that creeps under load; contacts that age: Dieterich (1979)",
    ),
    Term(
        "fast_relaxation", "a strength that is another after a third of a millisecond", STRENGTH, "1", "1 − exp(−3 t/ms)",
        lambda t: 1.0 - np.exp(-3.0 * t), "Stress that relaxes: Maxwell (1867)",
    ),
    Term(
        "relaxation", "a strength that is another after a millisecond", STRENGTH, "1", "1 − exp(−t/ms)",
        lambda t: 1.0 - np.exp(-t), "Stress that relaxes: Maxwell (1867)",
    ),
    Term(
        "strength_ramp", "a strength that grows with the time since contact", STRENGTH, "1", "t/ms",
        lambda t: t, "Contacts that sinter, charge or dry",
    ),
)  # fmt: skip
