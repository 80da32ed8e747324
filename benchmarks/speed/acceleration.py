"""How long a long record of an accelerometer takes to be read and fitted by itself.

    OMP_NUM_THREADS=1 python -m benchmarks.speed.acceleration [--rows 50000]

The drops of data/campaigns/f161, each interpolated to that many rows, with noise of 0.2 % of its range.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from labsim.campaign import read_campaign
from labsim.inference.observations.observe_acceleration import observe_impact

CAMPAIGN = Path(__file__).parents[2] / "data" / "campaigns" / "f161"
NOISE = 0.002


def lengthen(file: Path, rows: int, rng: np.random.Generator) -> None:
    """The same record with more rows."""
    table = pd.read_csv(file)
    clock, felt = table.to_numpy().T
    longer = np.linspace(clock[0], clock[-1], rows)
    noisy = np.interp(longer, clock, felt) + NOISE * np.ptp(felt) * rng.standard_normal(rows)
    pd.DataFrame(dict(zip(table.columns, (longer, noisy), strict=True))).to_csv(file, index=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=50_000)
    asked = parser.parse_args()
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(shutil.copytree(CAMPAIGN, Path(folder) / "campaign"))
        for file in copy.glob("drops/*/acceleration.csv"):
            lengthen(file, asked.rows, rng)
        for drop in read_campaign(copy).drops:
            began = time.process_time()
            observe_impact(drop)
            spent = time.process_time() - began
            print(f"{drop.name}: {asked.rows} rows, {spent:.2f} s of CPU")


if __name__ == "__main__":
    main()
