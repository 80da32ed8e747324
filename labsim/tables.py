"""Reading hand-written TOML files key by key, so that every mistake is named with file, key, value and remedy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import CampaignError
from .records import Measured
from .text_files import load_toml

_REQUIRED: Any = object()
EXPLAINED = "labsim new DIR writes a campaign with every table and key explained"
UNITS = {
    "m",
    "cm",
    "mm",
    "um",
    "px",
    "s",
    "ms",
    "us",
    "g",
    "mg",
    "kg",
    "m3",
    "pa",
    "kpa",
    "hz",
    "khz",
    "deg",
}  # in keys


class Table:
    """One table of a TOML file. Every key that is asked for counts as known; ``close`` names the others."""

    def __init__(self, file: Path, name: str, values: dict[str, Any]) -> None:
        self.file, self.name, self.values = file, name, values
        self.known: set[str] = set()
        self.note = ""  # which keys there are, where some depend on what another key says

    def key(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def wrong(self, key: str, message: str) -> CampaignError:
        return CampaignError(self.file, self.key(key), message)

    def has(self, key: str) -> bool:
        return key in self.values

    def get(self, key: str, default: Any = _REQUIRED) -> Any:
        self.known.add(key)
        if key in self.values:
            return self.values[key]
        if default is _REQUIRED:
            raise self.wrong(key, "is missing; " + self._find_instead(key))
        return default

    def _find_instead(self, key: str) -> str:
        """The key that may have been meant by it, where there is one that nobody has asked for; otherwise where to look it up."""
        for other in self.values:
            if other not in self.known and _may_mean(other, key):
                return f"{other} is not a key of the campaign format: did you mean {key}?"
        return f"add it ({EXPLAINED})"

    def number(
        self,
        key: str,
        low: float,
        high: float,
        *,
        unit: float = 1.0,
        default: Any = _REQUIRED,
        whole: bool = False,
    ) -> Any:
        """A finite number between low and high (in the key's own unit), returned in SI = value · unit."""
        value = self.get(key, default)
        if key not in self.values:
            return default
        self.check_number(key, value, low, high, whole=whole)
        return int(value) if whole else float(value) * unit

    def check_number(self, key: str, value: Any, low: float, high: float, *, whole: bool = False) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.wrong(key, f"{value!r} is not a number; write a plain number without quotes or unit")
        if not math.isfinite(value):
            raise self.wrong(
                key, f"{value} is not a finite number; write the measured value or leave the key out"
            )
        if whole and value != int(value):
            raise self.wrong(key, f"{value} is not a whole number; write one between {low:g} and {high:g}")
        if value < 0 <= low:
            raise self.wrong(key, f"{value:g} is negative; it must lie between {low:g} and {high:g}")
        if not low <= value <= high:
            raise self.wrong(key, f"{value:g} is outside {low:g} to {high:g}{_guess_unit(value, low, high)}")

    def measured(
        self,
        key: str,
        low: float,
        high: float,
        *,
        unit: float = 1.0,
        required: bool = True,
        sigma_required: bool = True,
    ) -> Measured | None:
        """``KEY`` and its standard uncertainty ``KEY_sigma`` (the unit stays last: height_sigma_mm)."""
        sigma_key = self.sigma_key(key)
        if not required and key not in self.values:
            self.known.update({key, sigma_key})
            if sigma_key in self.values:
                raise self.wrong(sigma_key, f"stands without its value; add {key}")
            return None
        value = self.number(key, low, high, unit=unit)
        sigma = self.number(sigma_key, 0.0, high, unit=unit, default=_REQUIRED if sigma_required else 0.0)
        return Measured(value, sigma)

    def sigma_key(self, key: str) -> str:
        for suffix in ("_mm", "_ms", "_m_s", "_mg", "_px", "_um"):
            if key.endswith(suffix):
                middle = key.removesuffix(suffix) + "_sigma" + suffix
                return (
                    middle
                    if middle in self.values
                    else f"{key}_sigma"
                    if f"{key}_sigma" in self.values
                    else middle
                )
        return f"{key}_sigma"

    def numbers(
        self, key: str, low: float, high: float, *, count: int | None = None, whole: bool = False
    ) -> tuple[Any, ...] | None:
        """A list of numbers between low and high, ``count`` of them where that is given; None without the key."""
        value = self.get(key, None)
        if key not in self.values:
            return None
        if not isinstance(value, list) or (count is not None and len(value) != count):
            many = "numbers" if count is None else f"{count} numbers"
            raise self.wrong(key, f"{value!r} is not a list of {many}; write them in [ ]")
        for each in value:
            self.check_number(key, each, low, high, whole=whole)
        return tuple(int(each) if whole else float(each) for each in value)

    def span(self, key: str, low: float, high: float, *, write: str, first: str) -> tuple[float, float]:
        """Two numbers between low and high, the smaller one first. write, first : for people, as "two depths as [5.0, 40.0]" and
        "shallower depth"."""
        value = self.get(key)
        if not isinstance(value, list) or len(value) != 2:
            raise self.wrong(key, f"{value!r} is not a range; write {write}")
        for each in value:
            self.check_number(key, each, low, high)
        if not value[0] < value[1]:
            raise self.wrong(key, f"{value} does not grow; write the {first} first")
        return float(value[0]), float(value[1])

    def text(self, key: str, default: Any = _REQUIRED) -> Any:
        value = self.get(key, default)
        if key in self.values and (
            not isinstance(value, str) or (default is _REQUIRED and not value.strip())
        ):
            raise self.wrong(key, f"{value!r} is not a text; write it in quotes")
        return value

    def choice(self, key: str, allowed: tuple[str, ...], default: Any = _REQUIRED) -> str:
        value = self.get(key, default)
        if value not in allowed:
            raise self.wrong(
                key, f"{value!r} is not known; write one of " + ", ".join(f'"{a}"' for a in allowed)
            )
        return value

    def close(self) -> None:
        """Complain about the first key that nobody asked for."""
        for key in self.values:
            if key not in self.known:
                near = _nearest(key, self.known)
                raise self.wrong(
                    key,
                    "is not a key of the campaign format"
                    + (f"; did you mean {near}?" if near else "")
                    + (f" ({self.note})" if near and self.note else f"; {self.note}" if self.note else ""),
                )


class Document:
    """A TOML file, table by table."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.values = load_toml(file, CampaignError, f"write it ({EXPLAINED})")
        self.asked: set[str] = set()
        self.tables: list[Table] = []

    @classmethod
    def of(cls, where: Path, values: dict[str, Any]) -> Document:
        """The same of tables that no file holds; ``where`` stands in the messages in place of the file."""
        document = cls.__new__(cls)
        document.file, document.values, document.asked, document.tables = where, values, set(), []
        return document

    def put(self, given: Mapping[str, Mapping[str, Any]]) -> None:
        """Tables of keys that stand over those of the file; a key whose value is None is taken out."""
        for name, values in given.items():
            stated = self.values.get(name, {})
            both = {**(stated if isinstance(stated, dict) else {}), **values}
            self.values[name] = {key: value for key, value in both.items() if value is not None}

    def top(self) -> Table:
        """The keys that stand above the first table."""
        table = Table(self.file, "", {k: v for k, v in self.values.items() if not isinstance(v, dict)})
        self.asked.update(table.values)
        self.tables.append(table)
        return table

    def has(self, name: str) -> bool:
        return name in self.values

    def table(self, name: str, *, required: bool = True) -> Table:
        self.asked.add(name)
        values = self.values.get(name, {})
        if not isinstance(values, dict):
            raise CampaignError(
                self.file, name, f"{values!r} is not a table; write [{name}] on a line of its own"
            )
        if required and name not in self.values:
            others = {other for other, value in self.values.items() if isinstance(value, dict)} - self.asked
            near = _nearest(name, others)
            remedy = f"did you mean it by [{near}]?" if near else f"add this table ({EXPLAINED})"
            raise CampaignError(self.file, f"[{name}]", f"is missing; {remedy}")
        table = Table(self.file, name, values)
        self.tables.append(table)
        return table

    def close(self) -> None:
        """Complain about tables and keys that nobody asked for."""
        for name in self.values:
            if name not in self.asked:
                near = _nearest(name, self.asked)
                raise CampaignError(
                    self.file,
                    f"[{name}]",
                    "is not a table of the campaign format" + (f"; did you mean [{near}]?" if near else ""),
                )
        for table in self.tables:
            table.close()


def _may_mean(other: str, key: str) -> bool:
    """mass_g for mass_mg, diamter_mm for diameter_mm; not phi_2 for phi_1, depth_mm for diameter_mm or the sigma of a key."""
    (stem, number), (wanted, counted) = _split_key(other), _split_key(key)
    if ("sigma" in other.split("_")) != ("sigma" in key.split("_")) or number != counted:
        return False
    return _nearest(stem, {wanted}, 0.8) is not None


def _split_key(key: str) -> tuple[str, str]:
    """A key without its unit, and the single letter or digit that tells it from its siblings."""
    words = [word for word in key.lower().split("_") if word not in UNITS]
    return "_".join(words), words[-1] if words and len(words[-1]) == 1 else ""


def _nearest(word: str, known: set[str], cutoff: float = 0.6) -> str | None:
    import difflib

    return next(iter(difflib.get_close_matches(word, sorted(known), n=1, cutoff=cutoff)), None)


def _guess_unit(value: float, low: float, high: float) -> str:
    """A hint where the value would be right in a unit a thousand times larger or smaller."""
    for factor in (1e-3, 1e3, 1e-6, 1e6):
        if low < value * factor <= high:
            return f"; if another unit was meant, write {value * factor:g}"
    return "; check the value and its unit"
