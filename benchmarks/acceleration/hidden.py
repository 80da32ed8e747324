"""p_m of campaigns of accelerometers whose truth is known, those with nothing hidden: is it in its 90 % interval?

    python -m benchmarks.lagrangian_mesh.make_campaigns FOLDER
    python -m benchmarks.acceleration.hidden FOLDER

Prints a line a campaign: hidden p_m, its interval and middle, the noise of a sample over the largest reading, the p value.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.inference.calibrate import calibrate
from labsim.runs.store import RunStore


def main() -> None:
    folder = Path(sys.argv[1])
    truth = json.loads((folder / "truth.json").read_text())
    nulls = sorted(name for name, hidden in truth.items() if hidden["cause"] == "none")
    inside, off = 0, []
    for name in nulls:
        p_m = truth[name]["pm"]
        found = calibrate(read_campaign(folder / name), store=RunStore(None), workers=1)
        low, middle, high = np.quantile(found.posterior.data.posterior["p_m_Pa"], [0.05, 0.5, 0.95])
        inside += int(low < p_m < high)
        off.append(np.log(middle / p_m))
        print(
            f"{name}: {p_m:.0f} Pa; {middle:.0f} ({low:.0f} to {high:.0f}), {100 * (middle / p_m - 1):+.1f} %; "
            f"p = {found.p_value:.2g}",
            flush=True,
        )
    print(
        f"{inside} of {len(nulls)} in their 90 % interval; off by {100 * np.mean(off):+.1f} % on average, "
        f"{100 * np.std(off):.1f} % rms about it"
    )


if __name__ == "__main__":
    main()
