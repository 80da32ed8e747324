"""Forces against the motion that go with the time since contact."""

import numpy as np

from . import Term

PLACE = "force of time"
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
)  # fmt: skip
