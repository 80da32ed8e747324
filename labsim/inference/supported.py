"""What is calibrated and diagnosed: drops into porous dust. Whatever else a campaign may hold is simulated only."""

from __future__ import annotations

from pathlib import Path

from ..errors import InferenceError
from ..own_keys import DUST
from ..records import Campaign, Motion

INSTEAD = "labsim simulate --campaign CAMPAIGN --drop NAME simulates it"


def refuse_others(campaign: Campaign) -> None:
    """Raise InferenceError where a campaign states another law than the dust's or a motion that is no drop."""
    if campaign.material.law != DUST:
        raise InferenceError(
            campaign.folder / "campaign.toml",
            "material.law",
            f'"{Path(campaign.material.law).stem}" is not calibrated, only "{DUST}" is; {INSTEAD}',
        )
    for drop in campaign.drops:
        if drop.motion != Motion():
            raise InferenceError(
                campaign.folder / "drops" / drop.name / "drop.toml",
                "motion.kind",
                f'"{Path(drop.motion.kind).stem}" is not compared with a record, only a '
                f"drop from above the surface is; {INSTEAD}, or take it out of the campaign",
            )
