"""What a campaign could have and has not, and what is lost by it."""

from __future__ import annotations

from collections.abc import Sequence

from ..records import Campaign


def list_missing(campaign: Campaign) -> list[str]:
    """One line for each thing that is missing."""
    lines = []
    tracked = [drop for drop in campaign.drops if drop.record.kind != "summary"]
    dropped = [drop for drop in tracked if drop.gauge is None]
    if dropped and not campaign.scans:
        lines.append(
            "no CT scan: nothing is seen of the dust itself; scale of the CT, crust and gradient cannot be told"
        )
    if dropped and len({round(drop.projectile.tip_radius, 7) for drop in tracked}) == 1:
        lines.append("one tip radius only: causes that depend on size look like others")
    heights = [drop.height.value for drop in tracked if drop.height is not None]
    if heights and max(heights) < 4 * min(heights):
        lines.append("speeds within a factor of two: causes that depend on speed look like others")
    if 0 < len(tracked) < 4:
        lines.append(
            f"{len(tracked)} tracked drop{'s' * (len(tracked) > 1)}: p_m can be found, the scatter of samples and causes hardly"
        )
    blank = [drop.name for drop in dropped if drop.projectile.mass_sigma == 0]
    if blank:
        lines.append(f"mass_sigma_mg is 0 or not given in {shorten(blank)}: the mass is taken as exact")
    if campaign.sample.filling_factor_sigma == 0:
        lines.append("sample.filling_factor_sigma is 0: the filling factor is taken as exact")
    return lines


def shorten(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
