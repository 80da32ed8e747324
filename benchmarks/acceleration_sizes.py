"""How large the errors of an accelerometer's force have to be: campaigns with nothing hidden, with smaller sizes of them.

    python benchmarks/acceleration_sizes.py FOLDER [FOLDER …] [--shares 1 0.75 0.6]

FOLDER holds campaigns of benchmarks/lagrangian_mesh/make_campaigns.py; those with nothing hidden are taken, up to --last. Printed
are, for each share of the sizes: the largest gain of a law without a name and of the screening's best cause in ln evidence; the
campaigns that the screening doubts (p below 0.05); and how far ln p_m is off.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from labsim.campaign import read_campaign
from labsim.diagnosis.screen import screen
from labsim.diagnosis.shapes import lay_out_shapes
from labsim.diagnosis.unknown import fit_unknown
from labsim.inference.calibrate import prepare
from labsim.inference.observations import acceleration_model
from labsim.inference.runs import RunStore
from labsim.inference.scatter import set_terms

SIZES = ("FORCE_ROUGHNESS", "FORCE_NOISE", "FORCE_SHAPE")


def list_nulls(folders: list[Path], last: str) -> Iterator[tuple[Path, float]]:
    """Campaigns with their true p_m (Pa)."""
    for folder in folders:
        for name, truth in json.loads((folder / "truth.json").read_text()).items():
            if truth["cause"] == "none" and name <= last:
                yield folder / name, truth["pm"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--last", default="f50", help="name of the last campaign that is taken")
    parser.add_argument("--shares", type=float, nargs="+", default=[1.0, 0.75, 0.6])
    asked = parser.parse_args()
    usual = {name: getattr(acceleration_model, name) for name in SIZES}
    print(
        "| share of the sizes | campaigns | law without a name | best cause | doubted | ln p_m off, mean ± sd |"
    )
    print("|---|---|---|---|---|---|")
    for share in asked.shares:
        for name, size in usual.items():
            setattr(acceleration_model, name, share * size)
        laws, causes, p_values, off = [], [], [], []
        for path, p_m in list_nulls(asked.folders, asked.last):
            campaign = read_campaign(path)
            bench, nominal = prepare(campaign, RunStore(), workers=1, terms=set_terms(campaign))
            lay_out_shapes(bench)
            found = screen(bench, nominal, np.random.default_rng(1))
            laws.append(fit_unknown(bench, nominal).evidence - nominal.evidence)
            causes.append(found.scores[0].log_bayes)
            p_values.append(found.p_value)
            off.append(nominal.log_p_m - math.log(p_m))
        print(
            f"| {share:g} | {len(off)} | {max(laws):.1f} | {max(causes):.1f} | {np.sum(np.array(p_values) < 0.05)} | "
            f"{np.mean(off):+.3f} ± {np.std(off):.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
