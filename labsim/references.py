"""The literature that the package rests on: references.bib, and which of its entries a text names.

Effects, terms and material laws name a reference as a paper does, by author and year: "Blum & Schräpler (2004)". The key of
the entry is the first author's name in plain letters and the year, so that the entry is found without a second list.
"""

from __future__ import annotations

import re
import unicodedata
from functools import cache
from pathlib import Path

FILE = Path(__file__).with_name("references.bib")

# first author, further authors, year: "Hill (1950)", "Güttler et al. (2009)", "Seizinger, Speith & Kley (2012)"
_AUTHOR_YEAR = re.compile(
    r"([^\W\d_a-z][\w'’-]*)(?:(?:,\s[^\W\d_a-z][\w-]+)*\s&\s[\w ]+?|\set\sal\.)?\s\((\d{4}[a-z]?)\)"
)


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
