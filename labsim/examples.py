"""Campaigns that ship with labsim: inside the installed package, or beside it in a checkout."""

from __future__ import annotations

from pathlib import Path

from .errors import CampaignError


def example(name: str = "p06") -> Path:
    """The folder of a campaign that ships with labsim.

    Parameters
    ----------
    name : str
        As ``list_examples`` has it.

    Returns
    -------
    Path
        The campaign folder, for ``labsim.read_campaign`` and all verbs. Copy it before you change anything in it.

    Raises
    ------
    CampaignError
        Where there is none of that name.
    """
    found = list_examples()
    if name not in found:
        raise CampaignError(
            "labsim.example", name, f"ships not with labsim; choose one of {', '.join(found)}"
        )
    return found[name]


def list_examples() -> dict[str, Path]:
    """Campaign folders that ship with labsim, by name."""
    package = Path(__file__).parent
    data = next((each for each in (package / "data", package.parent / "data") if each.is_dir()), None)
    if data is None:
        raise CampaignError(package / "data", "", "is missing from this installation; install labsim again")
    folders = sorted(
        file.parent for file in [*data.glob("*/campaign.toml"), *data.glob("campaigns/*/campaign.toml")]
    )
    return {folder.name: folder for folder in folders}
