"""``labsim cite``: BibTeX of what a result rests on.

Effects, terms and material laws name a reference as a paper does, by author and year: "Blum & Schräpler (2004)". The key of the
entry in references.bib is the first author's name in plain letters and the year, so that it is found without a second list.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer

from ..campaign import read_campaign
from ..effects import list_effects
from ..effects.terms import list_terms
from ..errors import LabsimError
from ..records import Campaign, Material
from ..sph.materials import find_law
from ..text_files import load_json
from . import _provenance, options

FILE = Path(__file__).parents[1] / "references.bib"

# first author, further authors, year: "Hill (1950)", "Güttler et al. (2009)", "Seizinger, Speith & Kley (2012)"
_AUTHOR_YEAR = re.compile(
    r"([^\W\d_a-z][\w'’-]*)(?:(?:,\s[^\W\d_a-z][\w-]+)*\s&\s[\w ]+?|\set\sal\.)?\s\((\d{4}[a-z]?)\)"
)

SUMMARIES = ("diagnosis.json", "calibration.json", "strength.json", "run.json")
MEASURED = ("drop.json", "scan.json", "tracks.json", "scans.json")  # rest on labsim alone


def cite(
    made: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of an earlier command.")],
    quiet: options.Quiet = False,
    as_json: options.AsJson = False,
) -> None:
    """Print BibTeX of what a result rests on: labsim, the law's sources, the data, the methods and the causes that were found."""
    file = find_summary(made)
    summary = load_json(file, LabsimError, "name the output folder of an earlier command")
    if not isinstance(summary, dict):
        raise LabsimError(file, "", "is no summary of labsim; name the output folder of an earlier command")
    reasons: dict[str, list[str]] = {}
    unlisted = []
    for reason, text in list_texts(file.name, summary):
        for key in find_keys(text):
            reasons.setdefault(key, []).append(reason)
        if not find_keys(text):
            unlisted.append(f"{reason}: {text}")
    known = read_references()
    unlisted += [f"{'; '.join(reasons[key])}: {key}" for key in reasons if key not in known]
    found = [("labsim", ["the program"])] + [(key, why) for key, why in reasons.items() if key in known]
    lines = [f"% {'; '.join(dict.fromkeys(why))}\n{known[key]}\n" for key, why in found]
    if unlisted:  # effects of a campaign's own say what they rest on in any words
        lines += [f"% without an entry: {' '.join(each.split())}" for each in dict.fromkeys(unlisted)]
    entries = [{"key": key, "for": list(dict.fromkeys(why)), "bibtex": known[key]} for key, why in found]
    options.finish(
        {"entries": entries, "without_entry": unlisted},
        "\n".join(lines).rstrip(),
        as_json=as_json,
        quiet=quiet,
    )


def find_summary(folder: Path) -> Path:
    """The summary file of an output folder, of several the one that comes last in the work. Raises LabsimError."""
    for name in (*SUMMARIES, *MEASURED):
        if (folder / name).is_file():
            return folder / name
    raise LabsimError(
        folder, "OUT", "holds no summary of labsim; name the output folder of an earlier command"
    )


def list_texts(name: str, summary: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """What a result rests on: the reason and the text that names the reference. name : of the summary file."""
    if name in MEASURED:
        return
    campaign = _find_campaign(summary)
    if campaign is not None:
        written = [campaign.source, *(drop.source for drop in campaign.drops)]
        written += [scan.source for scan in campaign.published_scans]
        written += [test.source for test in campaign.strength_tests]
        for text in (str(text) for source in written for text in source.values()):
            if find_keys(text):
                yield "the data", text
    law = _find_law(summary, campaign)
    yield from _list_law(law)
    if name == "strength.json":
        return
    yield "smoothed particle hydrodynamics", "Monaghan (1992)"
    if name in ("diagnosis.json", "calibration.json"):
        yield "the sampler of the posterior", "Foreman-Mackey et al. (2013)"
        yield "the moves of its walkers", "ter Braak (2006)"
    if "scatter" in summary:
        yield "scatter between samples, by restricted maximum likelihood", "Patterson & Thompson (1971)"
    if summary.get("verdict") == "effect":
        effects = list_effects(campaign) if campaign is not None else list_effects()
        for cause in dict.fromkeys(cause for group in summary.get("named", []) for cause in group):
            for text in effects[cause].references if cause in effects else ():
                yield f"the cause {cause}", text
    terms = list_terms()
    for term in (summary.get("law") or {}).get("terms", []) if name == "diagnosis.json" else ():
        if term["term"] in terms:
            yield f"the learned term {term['term']}", terms[term["term"]].source


def _list_law(name: str) -> Iterator[tuple[str, str]]:
    law = find_law(name)
    texts = [
        law.__doc__ or "",
        *(each.source for each in law.PARAMETERS if not each.source.startswith("none")),
    ]
    for text in texts:
        if find_keys(text):  # other parameters say in words where their usual value lies
            yield f"the law {Path(name).stem}", text


def _find_campaign(summary: dict[str, Any]) -> Campaign | None:
    """The campaign that the command was given, where it is still there."""
    made_by = summary.get(_provenance.KEY)
    inputs = made_by.get("inputs") if isinstance(made_by, dict) else None
    for path in map(Path, inputs if isinstance(inputs, dict) else ()):
        if (path / "campaign.toml").is_file():
            return read_campaign(path)
    return None


def _find_law(summary: dict[str, Any], campaign: Campaign | None) -> str:
    setting = summary.get("setting")
    material = setting.get("material") if isinstance(setting, dict) else None
    if isinstance(material, dict) and isinstance(material.get("law"), str):
        return material["law"]
    return campaign.material.law if campaign is not None else Material.law


@cache
def read_references() -> dict[str, str]:
    """key -> the BibTeX entry as it stands in references.bib."""
    text = FILE.read_text(encoding="utf-8")
    entries = re.findall(r"^@\w+\{([\w-]+),$.*?^\}$", text, re.MULTILINE | re.DOTALL)
    parts = re.findall(r"^@\w+\{[\w-]+,$.*?^\}$", text, re.MULTILINE | re.DOTALL)
    return dict(zip(entries, parts, strict=True))


def find_keys(text: str) -> list[str]:
    """Keys of all references that a text names by author and year, in its order, whether references.bib has them or not."""
    return list(dict.fromkeys(_fold(name) + year for name, year in _AUTHOR_YEAR.findall(text)))


def _fold(name: str) -> str:
    """A surname in plain small letters: Güttler -> guttler."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return plain.lower()
