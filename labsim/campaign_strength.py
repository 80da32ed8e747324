"""Static strength tests of a campaign: strength/NAME/strength.toml and its table in, a checked StrengthTest out."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from .campaign_tables import find_toml, list_parts, read_source
from .errors import CampaignError, MeasurementError
from .records import STRENGTH_KINDS, Sample, StrengthTest
from .tables import Document, Table
from .tracks.lines import read_named_columns

PRESSURES = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "mbar": 1e2}
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
FORCES = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
FEWEST, MOST = 2, 10_000  # rows


def read_strength_tests(folder: Path, sample: Sample) -> tuple[StrengthTest, ...]:
    """All tests of a campaign folder. Raises CampaignError."""
    return tuple(
        read_strength_test(path, sample) for path in list_parts(folder / "strength", "strength.toml")
    )


def read_strength_test(path: Path | str, sample: Sample) -> StrengthTest:
    """Read one test: its folder or its strength.toml. sample : of the campaign, for the density of the grains.

    Raises CampaignError.
    """
    file = find_toml(Path(path), "strength.toml")
    document = Document(file)
    document.top()
    table = document.table("test")
    kind = table.choice("kind", STRENGTH_KINDS)
    data = file.parent / table.text("file")
    sigma = table.number("relative_sigma", 1e-4, 1.0)
    if table.has("height_column") or table.has("force_column"):
        columns = [table.text("height_column"), table.text("force_column")]
        units = [_choose(table, "height_unit", LENGTHS, "mm"), _choose(table, "force_unit", FORCES, "N")]
        area = 0.25 * math.pi * table.number("diameter_mm", 0.1, 1000.0, unit=1e-3) ** 2
        mass = table.number("mass_mg", 1e-3, 1e9, unit=1e-6)
        full = mass / (sample.monomer_density * area)  # the height of its grains without pores
    else:
        columns = [table.text("filling_factor_column"), table.text("pressure_column")]
        units = [1.0, _choose(table, "pressure_unit", PRESSURES, "Pa")]
        area, full = 0.0, 0.0
    source = read_source(document)
    document.close()
    points = []
    for number, first, second in _read_columns(data, table, columns):
        first, second = first * units[0], second * units[1]
        phi, pressure = (full / first if first > 0 else math.inf, second / area) if area else (first, second)
        if not 0.005 < phi < 1.0:
            raise CampaignError(
                data,
                f"line {number}",
                f"a filling factor of {phi:.4g} is outside 0.005 to 1; check columns and units",
            )
        if not 1e-3 < pressure < 1e10:
            raise CampaignError(
                data, f"line {number}", f"a pressure of {pressure:.4g} Pa is outside 0.001 to 1e10; leave out rows "
                "before the load, write the size of a tension without a sign, check the unit",
            )  # fmt: skip
        points.append((phi, pressure))
    if not FEWEST <= len(points) <= MOST:
        raise CampaignError(data, "", f"holds {len(points)} rows; a test has {FEWEST} to {MOST}")
    name = file.resolve().parent.name
    return StrengthTest(name, kind, tuple(points), sigma, source)  # type: ignore[arg-type]


def _choose(table: Table, key: str, units: dict[str, float], default: str) -> float:
    return units[table.choice(key, tuple(units), default)]


def _read_columns(data: Path, table: Table, wanted: list[str]) -> list[tuple[int, float, float]]:
    """(line, number, number) of every row below the heading that names both columns."""
    if not data.is_file():
        raise table.wrong("file", f"{data} is not there; name the table of the test")
    try:
        lines, rows = read_named_columns(data, wanted)
    except MeasurementError as trouble:
        raise CampaignError(data, trouble.key, trouble.message) from None
    for number, row in zip(lines, rows, strict=True):
        if np.isnan(row).any():
            name = wanted[int(np.argmax(np.isnan(row)))]
            raise CampaignError(data, f"line {number}", f"has no number in {name!r}; correct or remove it")
    return [
        (number, float(first), float(second)) for number, (first, second) in zip(lines, rows, strict=True)
    ]
