"""Hide a term that no listed cause is in campaigns of labsim's own solver at another spacing: which formula is learned?

    OMP_NUM_THREADS=1 python -m benchmarks.accuracy.learn_terms [--only inertial_drag,film] [--store STORE] [--workers 2]

Nine drops, noise and 2 % scatter of the samples as a usual laboratory's. Beside terms of labsim/effects/terms, forces that are
no term are hidden: a film elsewhere, a drag by a power of speed that is not listed. Prints the verdict, the formula with its
rivals, p_m and held-out drops. This is labsim's own solver: what another code would leave is not in it.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.accuracy.interval_coverage import STANDARD, open_campaign
from benchmarks.truths.measured import LABORATORY, Hidden, TruthTable, measure_hidden
from labsim.diagnosis.campaign import diagnose_campaign
from labsim.effects.law_places import LAW_PLACES
from labsim.report.pages.law_words import describe_learned
from labsim.runs.store import RunStore

# name -> place and x -> value in Pa or share, or µs for x rows
HIDDEN = {
    "inertial_drag": ("force of speed", "300.0 * x**2"),
    "drag_to_the_1.5": ("force of speed", "300.0 * x**1.5"),
    "depth_spring": ("force of depth", "150.0 * x"),
    "film_at_1.3": ("force of depth", "400.0 * np.exp(-0.5 * ((x - 1.3) / 0.3) ** 2)"),
    "hardening": ("strength of filling factor", "0.6 * 10 * x"),
    "size": ("strength of size", "0.5 * np.log(x)"),
    "rows_one_after_another": ("clock of row", "5.0 * x"),
    "nothing": ("force of speed", "0.0 * x"),
}
EFFECT = '''"""Hidden here alone."""

import numpy as np

from labsim.effects import Parameter, Uniform
from labsim.effects.terms import Term, add_term, see_term

title = "hidden"
kind = "material"
parameters = (Parameter("share", "1", null=0.0, limits=(0, 2), prior=Uniform(0, 2), step=1.0, text="Of what is hidden."),)
leaves = "What no listed cause leaves."
references = ("None",)
expect = {{}}
TERM = Term("hidden", "hidden", "{place}", "1", "", lambda x: {shape} + 0.0 * x, "")


def change_{of}({of}, values, place):
    return {verb}_term({of}, TERM, values["share"]{more})
'''


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default=",".join(HIDDEN))
    parser.add_argument("--store", type=Path, default=Path("runs"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    campaign, _ = open_campaign(STANDARD, False)
    for name in given.only.split(","):
        place, shape = HIDDEN[name]
        with tempfile.TemporaryDirectory() as folder:
            own = Path(folder) / "effects" / "hidden.py"
            own.parent.mkdir()
            camera = LAW_PLACES[place].see is not None
            of, verb, more = ("instrument", "see", ", place") if camera else ("setting", "add", "")
            own.write_text(EFFECT.format(place=place, shape=shape, of=of, verb=verb, more=more))
            truth = TruthTable(
                replace(campaign, folder=Path(folder)), RunStore(given.store), workers=given.workers
            )
            hidden = Hidden({"hidden": {"share": 1.0}} if name != "nothing" else {})
            truth.prepare([hidden])
            rng = np.random.default_rng([given.seed, len(name)])
            hidden = replace(hidden, p_m=float(1300 * math.exp(0.15 * rng.standard_normal())))
            seen = measure_hidden(truth.holding(hidden), hidden, rng, laboratory=LABORATORY)
        found = diagnose_campaign(campaign, RunStore(given.store), workers=given.workers, measurements=seen)
        first, probability = found.verdict.probabilities[0]
        spent = f"{found.wall:.0f} s, {found.runs_new} new runs"
        print(f"{name}, p_m {hidden.p_m:.0f} Pa: {' + '.join(first)} {probability:.2f}, {spent}")
        print(json.dumps(describe_learned(found), indent=1, ensure_ascii=False), flush=True)


if __name__ == "__main__":
    main()
