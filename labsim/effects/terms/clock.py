"""What a camera's clock may do that nobody states: rows that are read one after another, frames that come ever later."""

from . import Term

TERMS = (
    Term(
        "rolling_shutter", "rows that are read one after another", "clock of row", "µs", "rows",
        lambda row: row, "Electronic rolling shutter: Liang, Chang & Chen (2008)",
    ),
    Term(
        "clock_drift", "a clock that drifts", "clock of time", "1/s", "t",
        lambda t: t, "Frames that are triggered by a drifting oscillator",
    ),
)  # fmt: skip
