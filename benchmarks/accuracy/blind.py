"""Diagnose a folder of labelled campaigns and compare with what was hidden in them.

    python -m benchmarks.accuracy.blind FOLDER [--only p03,p05] [--rows ROWS.jsonl] [--workers 2] [--cells 5]

FOLDER holds campaigns and ``truth.json`` (cause, p_m, note per campaign). Prints top-1, class, false alarms, wrong
names, Brier score, coverage of p_m, gain, time. The diagnosis reads the campaign's folder only; truth is opened afterwards.
ROWS.jsonl keeps a line of JSON a campaign, with all evidences and the learned law; one that stands there is not judged again.

gain is what the extension removes of what held-out drops show above the noise that is expected. What can be removed is what the
hidden cause itself removes, at its true strength and p_m: "by truth" is its gain, "share" the part of the lowering of the mean
square that the extension reaches. "sigmas" is how strong the hidden cause is: the root of what it takes from χ² of the nominal
fit, at its true strength and p_m.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import subprocess
import time
from collections.abc import Iterable
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.accuracy.hidden_laws import find_law
from benchmarks.campaigns.labelled import SCATTER
from benchmarks.campaigns.scan import VOXEL
from benchmarks.material_points.compare_changes import HIDDEN
from labsim.campaign import read_campaign
from labsim.diagnosis.campaign import Diagnosis, diagnose_campaign
from labsim.diagnosis.gain import measure_gain, predict_held_out
from labsim.diagnosis.shapes import MARK
from labsim.diagnosis.unlisted.hats import make_effect
from labsim.effects.terms import list_terms
from labsim.inference.fits.fitting import fit_hypothesis
from labsim.runs.store import RunStore

# words of truth.json -> the effect whose first parameter they give
WORDS = HIDDEN | {
    "pixel": "pixel_scale",
    "frame": "frame_rate",
    "mass": "projectile_mass",
    "surface_row": "surface_row",
    "scale": "ct_scale",
}
PROFILES = {"crust": ("surface_crust", "df", "l"), "gradient": ("density_gradient", "slope", "")}
MOST_ALIKE = 3  # causes of a stated class that still counts as an answer
STRONG = 8.0  # standard deviations, from which a listed cause should be found
LEAST_REMOVED = 0.1  # of the mean square, by the truth: where it removes less there is nothing to share


def name_hypothesis(causes: Iterable[str]) -> str:
    """The same words for a pair in either order."""
    return " + ".join(sorted(causes))


def describe(name: str, found: Diagnosis) -> dict:
    """What the diagnosis says, before the truth is known."""
    p_m = found.posterior_extended.samples("p_m_Pa")
    nominal = found.posterior_nominal.samples("p_m_Pa")
    return {
        "campaign": name,
        "verdict": found.verdict.word,
        "first": name_hypothesis(found.verdict.probabilities[0][0]),
        "probability": found.verdict.probabilities[0][1],
        "ranked": [(name_hypothesis(h), p) for h, p in found.verdict.probabilities],
        "named": [name_hypothesis(h) for h, _ in found.verdict.named],
        "p_value": found.p_value,
        "p_m": float(np.median(p_m)),
        "p_m_90": tuple(np.quantile(p_m, [0.05, 0.95])),
        "ln_p_m_sd": float(np.std(np.log(p_m))),
        "p_m_over_causes": float(np.median(found.p_m_averaged)),
        "p_m_over_causes_90": tuple(np.quantile(found.p_m_averaged, [0.05, 0.95])),
        "p_m_nominal": float(np.median(nominal)),
        "gain": found.gain.fraction_removed,
        "scatter_in_fit": found.problem.budget.scatter,
        "alike": found.alike,
        "runs_new": found.runs_new,
        "wall": found.wall,
        "evidence": describe_evidence(found),
        "law": describe_law(found),
    }


def describe_evidence(found: Diagnosis) -> dict:
    """ln evidences over the nominal model's, and what else the verdict is made of: it can be made again by another rule."""
    nominal = found.nominal.evidence
    return {
        "fitted": {name_hypothesis(fit.hypothesis): fit.evidence - nominal for fit in found.rivals},
        "screened": {score.name: score.log_bayes for score in found.screening.scores},
        "unknown": found.unknown.evidence - nominal,
        "block": found.unknown.block,
        "predicted": found.predicted,
        "beside": found.unknown.beside if math.isfinite(found.unknown.beside) else None,
        "catalogue": list(found.problem.effects),
        "felt": bool(found.problem.felt),
    }


def describe_law(found: Diagnosis) -> list[dict]:
    """The formulas of what is missing, best first; none where none was learned."""
    if found.learned is None:
        return []
    return [
        {
            "terms": {
                term.name: [term.place, float(value), float(sigma)]
                for term, value, sigma in zip(each.terms, each.coefficients, each.sigma, strict=True)
            },
            "evidence": each.fit.evidence - found.nominal.evidence,
            "ln_p_m": list(each.log_p_m),
            "rms": [each.gain.rms_nominal, each.gain.rms_extended],
        }
        for each in found.learned.formulas
    ]


def read_hidden(truth: dict) -> dict[str, tuple[float, float | None]]:
    """Effects that are hidden with the values of their first parameter and of their shape; empty where one has no name here."""
    terms = truth["mat"] | truth["dyn"] | truth["measure"] | truth["ct"]
    exponent = terms.pop("raten", None)
    values: dict[str, tuple[float, float | None]] = {}
    if "blur_mm" in terms:
        values["ct_blur"] = 1e-3 * terms.pop("blur_mm") - VOXEL, None
    if "side" in terms:  # the shared campaigns tell it in words, per length of a 1 mm rod
        told = re.search(r"([\d.]+) N/m", truth["note"])
        side = terms.pop("side")
        values["side_friction"] = float(told[1]) if told else side, None
    if truth["drift"]:
        values["sample_drift"] = truth["drift"], None
    if truth["profile"]:
        name, size, length = PROFILES.get(truth["profile"]["kind"], ("", "", ""))
        values[name] = truth["profile"].get(size, 0.0), truth["profile"].get(length)
    for word, value in terms.items():
        values[WORDS.get(word, "")] = value, exponent if word == "eta" else None
    return {} if "" in values or truth.get("small_strength") else values


def compare_gain(found: Diagnosis, truth: dict) -> dict:
    """The gain of what is hidden, at its true strength and p_m, and the share of what that removes which the extension does."""
    problem, hidden = found.problem, read_hidden(truth)
    law = find_law(truth)
    if law is not None and law.own is not None:
        name, size = law.own
        hidden = {name: (size, None)}
        problem = replace(
            problem, effects={**problem.effects, name: make_effect(list_terms()[name], abs(size))}
        )
    if not hidden or any(name not in problem.effects for name in hidden):
        return {"by_truth": math.nan, "share": math.nan, "sigmas": math.nan, "rms_by_truth": math.nan}
    amplitudes = {}
    for name, (value, shape) in hidden.items():
        effect, label = problem.effects[name], name
        if shape is not None:
            label = f"{name}{MARK}{shape:g} as hidden"
            problem.effects[label] = effect.with_shape(shape)
        amplitudes[label] = value - effect.amplitudes[0].null
    start = (math.log(truth["pm"]), amplitudes)
    fit = fit_hypothesis(problem, tuple(amplitudes), start, nuisances=found.best, iterations=0)
    true = measure_gain(found.held_out_nominal, predict_held_out(problem, fit, known=True))
    before = found.gain.rms_nominal**2
    removed, removable = before - found.gain.rms_extended**2, before - true.rms_extended**2
    share = removed / removable if removable > LEAST_REMOVED * before else math.nan
    sigmas = math.sqrt(max(found.nominal.chi_square - fit.chi_square, 0.0))
    return {
        "by_truth": true.fraction_removed,
        "share": share,
        "sigmas": sigmas,
        "rms_by_truth": true.rms_extended,
    }


def name_commit() -> str:
    """Of the code that judges."""
    asked = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"]
    return subprocess.run(asked, capture_output=True, text=True).stdout.strip()


def judge_labelled(
    campaign: Path, truth: dict, store: RunStore, *, workers: int | None = None, cells: int | None = None
) -> dict:
    """Diagnose the campaign in a folder, then set beside it what is hidden there."""
    found = diagnose_campaign(read_campaign(campaign), store, workers=workers, cells=cells)
    row = describe(campaign.name, found) | {"commit": name_commit(), "date": str(date.today())}
    row |= compare_gain(found, truth)
    return row | {"truth": {key: value for key, value in truth.items() if key != "drops"}}


def read_rows(*paths: Path) -> list[dict]:
    """All lines of all files."""
    return [json.loads(line) for path in paths for line in path.read_text(encoding="utf-8").splitlines()]


def judge_rows(table: pd.DataFrame) -> pd.Series:
    """Which rows are right: none where nothing is hidden; unknown, or nothing above 0.5, where nobody listed the cause; else the
    cause or its stated class first, or none where it is weaker than STRONG."""
    none, quiet = table["first"] == "none", (table["first"] == "unknown") | (table.P <= 0.5)
    listed = table["class"] | (none & (table.sigmas < STRONG))
    return none.where(table.hidden == "none", quiet.where(table.hidden == "unknown", listed))


def score(rows: list[dict]) -> pd.DataFrame:
    """Set the answers beside the truth."""
    table = []
    for row in rows:
        known = row["truth"]
        cause = name_hypothesis(known["cause"].split(" + "))
        alike = {row["first"], *row["alike"]}  # the stated class
        probabilities = dict(row["ranked"])
        low, high = row["p_m_90"]
        over = row.get("p_m_over_causes_90")  # rows before 2026-11-28 have none
        table.append(
            {
                "campaign": row["campaign"],
                "hidden": cause,
                "first": row["first"],
                "P": round(row["probability"], 3),
                "P(hidden)": round(probabilities.get(cause, 0.0), 3),
                "rank": 1 + [h for h, _ in row["ranked"]].index(cause) if cause in probabilities else 0,
                "exact": row["first"] == cause,
                "class": cause in alike and len(alike) <= MOST_ALIKE,
                "named": cause in row["named"],
                "wrong>0.5": cause not in alike
                and row["first"] not in ("none", "unknown")
                and row["probability"] > 0.5,
                "Brier": round(sum((p - (h == cause)) ** 2 for h, p in row["ranked"]), 3),
                "p_m true": known["pm"],
                "p_m": round(row["p_m"]),
                "p_m nominal": round(row["p_m_nominal"]),
                "ln p_m off": round(math.log(row["p_m"] / known["pm"]), 3),
                "sd": round(row["ln_p_m_sd"], 3),
                "in 90 %": low <= known["pm"] <= high,
                "in 90 % over causes": None if over is None else over[0] <= known["pm"] <= over[1],
                "gain": round(row["gain"], 2),
                "scatter": known.get("scatter", SCATTER),
                "sigmas": round(row["sigmas"], 1),
                "by truth": round(row["by_truth"], 2),
                "share": round(row["share"], 2),
                "new runs": row["runs_new"],
                "s": round(row["wall"]),
            }
        )
    scored = pd.DataFrame(table)
    return scored.assign(right=judge_rows(scored))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--cells", type=int, default=None)
    parser.add_argument("--store", type=Path, default=None)
    options = parser.parse_args()
    only = {name for name in options.only.split(",") if name}
    names = {path.parent.name for path in options.folder.glob("*/campaign.toml")}
    truths = options.folder / "truth.json"
    if only - names or not truths.exists():
        parser.error(f"{options.folder} has no {', '.join(sorted(only - names)) or truths.name}")
    known = json.loads(truths.read_text())
    rows = read_rows(options.rows) if options.rows and options.rows.exists() else []
    for name in sorted(only or names):
        if name in {row["campaign"] for row in rows}:
            continue
        began = time.perf_counter()
        rows.append(
            judge_labelled(
                options.folder / name,
                known[name],
                RunStore(options.store),
                workers=options.workers,
                cells=options.cells,
            )
        )
        top = ", ".join(f"{h} {p:.3f}" for h, p in rows[-1]["ranked"][:3])
        print(f"{name}: {top}  ({time.perf_counter() - began:.0f} s)", flush=True)
        if options.rows:
            with options.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    rows = [row for row in rows if row["campaign"] in (only or names)]
    table = score(rows)
    nulls, others = table[table.hidden == "none"], table[~table.hidden.isin(["none", "unknown"])]
    lines = [
        f"{date.today()}, commit {name_commit()}: {len(table)} campaigns",
        f"none called none {int((nulls['first'] == 'none').sum())} of {len(nulls)}; exact cause first "
        f"{int(others.exact.sum())} of {len(others)}, class {int(others['class'].sum())} of {len(others)}, among those named "
        f"{int(others.named.sum())} of {len(others)}; wrong cause with "
        f"P > 0.5 {int(table['wrong>0.5'].sum())} of {len(table)}; mean Brier {table.Brier.mean():.3f}; p_m in its 90 % "
        f"interval {int(table['in 90 %'].sum())} of {len(table)}; median gain "
        f"{others.gain.median() if len(others) else math.nan:.2f}, share of what the truth removes "
        f"{others.share.median():.2f} ({others.share.min():.2f} to {others.share.max():.2f}; {others.share.count()} with "
        "something to remove)",
    ]
    print(table.to_string(index=False))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
