"""What is calibrated and diagnosed: drops, and pushes with a force record, into any law whose range leaves its runs room."""

from __future__ import annotations

import math
from pathlib import Path

from ..calibrated import find_limits, find_parameter
from ..errors import InferenceError
from ..own_keys import DUST
from ..records import Campaign, Motion
from .emulation.grid import strength_node
from .emulation.nodes import enclosing_nodes

# laws whose friction ratio keeps to observations.sleeve_friction.SOLVER where the spacing is refined
# (benchmarks/solver/sleeve.py)
SHAFTS = ("von_mises",)
INSTEAD = "labsim simulate --campaign CAMPAIGN --drop NAME simulates it"


def compares_scans(campaign: Campaign) -> bool:
    """Whether a CT scan of one of its drops would be compared with what is simulated."""
    return campaign.material.law == DUST and campaign.geometry == "axisymmetric"


def refuse_others(campaign: Campaign) -> None:
    """Raise InferenceError where a campaign states what nothing is compared with."""
    law, file = campaign.material.law, campaign.folder / "campaign.toml"
    if law != DUST:
        low, high = find_limits(law)
        wanted = [
            strength_node(node)
            for end in campaign.p_m_range
            for node in enclosing_nodes(math.log(end), campaign.p_m_range)
        ]
        if not low <= min(wanted) <= max(wanted) <= high:
            name, unit = find_parameter(law)
            raise InferenceError(
                file,
                "material.law",
                f"{name} of {Path(law).stem} would be simulated from {min(wanted):.4g} to {max(wanted):.4g} {unit}, outside what "
                f"the law allows, {low:.4g} to {high:.4g}: it is not calibrated; {INSTEAD}",
            )
        if campaign.scans or campaign.strength_tests:
            raise InferenceError(
                file,
                "material.law",
                f'scans and static tests are compared with "{DUST}" only; take them out of the campaign',
            )
    for drop in campaign.drops:
        if drop.gauge is not None and drop.gauge.sleeve.compared and law not in SHAFTS:
            raise InferenceError(
                campaign.folder / "drops" / drop.name / "drop.toml",
                "record.sleeve",
                f"is true, but what a shaft feels is simulated well enough with {', '.join(SHAFTS)} alone, not with "
                f"{Path(law).stem} (docs/force-records.md); write sleeve = false",
            )
        if drop.record.kind == "force" and Path(drop.motion.kind).stem == "pushed":
            continue
        if drop.motion != Motion():
            raise InferenceError(
                campaign.folder / "drops" / drop.name / "drop.toml",
                "motion.kind",
                f'"{Path(drop.motion.kind).stem}" with a record of kind "{drop.record.kind}" is not compared, only a drop from '
                f"above the surface and a push with its force are; {INSTEAD}, or take it out of the campaign",
            )
