"""What a measured campaign's page says of its CT scans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...inference.problem import Problem
from ...records import Campaign
from .map_views import MapView
from .page import show_number
from .phrases import list_names


def describe_maps(campaign: Campaign, problem: Problem, maps: Sequence[MapView]) -> dict[str, Any]:
    used = {scan.observed.name for scan in problem.scans}
    shown = {view.name for view in maps}
    words = []
    compared = [view.name for view in maps if view.simulated]
    if compared:
        words.append(
            f"The maps of {list_names(compared)} are part of the likelihood. Simulated dust is shown as the scanner would see "
            "it, with the scan's cells and blur, and moved up or down until the simulated bead ends where the scanned one "
            "does. Only cells that enter the comparison carry a simulated value. Red in a difference: the dust is denser than "
            "simulated. Heights z count from the undisturbed surface."
        )
    only = [view.name for view in maps if view.name not in used]
    if only:
        words.append(
            f"The compacted zones of {list_names(only)} are not part of the likelihood, so no simulated map stands beside the "
            "measured one."
        )
    missing = [scan.name for scan in campaign.scans if scan.name not in shown]
    if missing:
        words.append(f"No map could be made of {list_names(missing)}; the warnings say why.")
    if problem.undisturbed:
        words.append("The undisturbed dust far from the beads is compared with the stated filling factor.")
    rows: list[list[dict[str, str]]] = []
    for k, view in enumerate(maps):
        dense = float(np.nanmax(view.measured)) if np.isfinite(view.measured).any() else float("nan")
        panels = [
            {
                "title": f"{view.name}: φ measured",
                "figure": f"map{k}",
                "text": f"Undisturbed φ {view.undisturbed:.4f}, up to {show_number(dense)} beside the bead, whose tip lies "
                f"{view.map.tip_depth * 1e3:.2f} mm deep.",
                "below": "",
            }
        ]
        for q, name in enumerate(view.simulated):
            panels.append(
                {
                    "title": f"{view.name}: φ simulated, {name}",
                    "figure": f"map{k}_simulated{q}",
                    "text": "Where it is compared.",
                    "below": "yes" if q else "",
                }
            )
            panels.append(
                {
                    "title": f"{view.name}: measured − {name}",
                    "figure": f"map{k}_left{q}",
                    "text": f"{view.rms(name):.4f} rms on the cells compared.",
                    "below": "",
                }
            )  # fmt: skip
        rows.append(panels)
    if not compared:  # one map a scan: side by side
        rows = [[panel for row in rows for panel in row]]
    undisturbed = ""
    if problem.undisturbed:
        means = [f"{dust.name} {np.mean(dust.filling_factor):.4f}" for dust in problem.undisturbed]
        sample = campaign.sample
        undisturbed = (
            f"Filling factor of dust that no bead reached, against depth, in the mean {', '.join(means)}; "
            f"stated are {sample.filling_factor:g} ± {sample.filling_factor_sigma:g} (band: two standard deviations)."
        )
    return {"words": " ".join(words), "rows": rows, "undisturbed": undisturbed}
