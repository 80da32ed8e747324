"""Campaigns that ship with labsim: inside the installed package, or beside it in a checkout."""

from __future__ import annotations

from pathlib import Path

from .errors import CampaignError
from .text_files import load_json


def example(name: str = "p06") -> Path:
    """The folder of a campaign that ships with labsim.

    Parameters
    ----------
    name : str
        As ``list_examples`` has it; or a word of the cause that is hidden in one, as "crust", "pixel" or "none".

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
        hidden = list_hidden(found)
        alike = [each for each, cause in hidden.items() if name and name in [*cause.split("_"), cause]]
        if len(alike) != 1:
            known = [
                f"{each} ({hidden[each].replace('_', ' ')})" if each in hidden else each for each in found
            ]
            raise CampaignError(
                "labsim.example", name, f"ships not with labsim; choose one of {', '.join(known)}"
            )
        name = alike[0]
    return found[name]


def list_hidden(found: dict[str, Path]) -> dict[str, str]:
    """What is hidden in those that were made by a simulator, by name."""
    file = next(
        (
            folder.parent / "truth.json"
            for folder in found.values()
            if (folder.parent / "truth.json").is_file()
        ),
        None,
    )
    truths = load_json(file, CampaignError, "install labsim again") if file is not None else {}
    return {name: str(truths[name]["cause"]) for name in found if name in truths}


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
