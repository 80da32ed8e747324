"""SkyScan/NRecon log files: the ``_rec.log`` that lies beside reconstructed slices.

The files are INI-like, written by many versions: keys differ in case and spelling, the same key stands in several
sections with different meanings, values may hold '=' and carry a suffix such as "ON (3)".
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import MeasurementError

SPELLINGS = {"mininum for cs to image conversion": "minimum for cs to image conversion"}


@dataclass(frozen=True)
class SkyScanLog:
    """A log as read: sections -> key (lower case) -> text."""

    path: Path
    sections: dict[str, dict[str, str]]

    def text(self, key: str, *sections: str) -> str | None:
        """Value of a key (any case), looked for in the named sections in turn, else in all."""
        key = key.lower()
        for name in sections or tuple(self.sections):
            value = self.sections.get(name.lower(), {}).get(key)
            if value is not None:
                return value
        return None

    def number(self, key: str, *sections: str) -> float | None:
        """None where the key is missing or has no value. Raises MeasurementError where the value is not a finite number."""
        text = self.text(key, *sections)
        if text is None or text.strip().lower() in ("", "-", "off", "none", "n/a"):
            return None
        match = re.match(r"\s*([-+]?\d+[.,]?\d*(?:[eE][-+]?\d+)?)", text)
        value = float(match.group(1).replace(",", ".")) if match else math.nan
        if not math.isfinite(value):
            raise MeasurementError(
                self.path,
                key,
                f"is {text[:40]!r}, not a number; correct the log or move it out of the folder",
            )
        return value

    def switch(self, key: str, *sections: str) -> bool | None:
        """ON/OFF, "ON (3)", 1/0; None where the key is missing."""
        text = self.text(key, *sections)
        if text is None:
            return None
        word = text.strip().split("(")[0].strip().lower()
        stated = re.fullmatch(r"\d+\.?\d*", word)
        return word in ("on", "yes", "true") or (stated is not None and float(word) != 0)

    @property
    def voxel(self) -> float | None:
        """m. [Reconstruction] wins: slices may be resized or cut after the acquisition."""
        size = self.number("pixel size (um)", "reconstruction")
        if size is None:
            size = self.number("image pixel size (um)", "acquisition")
        return None if size is None else size * 1e-6

    @property
    def slice_spacing(self) -> float | None:
        """m between neighbouring slices: the pixel size times the section step."""
        step = self.number("section to section step", "reconstruction")
        return None if self.voxel is None else self.voxel * (step or 1.0)


def find_log(folder: Path) -> Path | None:
    """The ``_rec.log`` of a folder of slices, or the only log there."""
    logs = sorted(item for item in folder.iterdir() if item.suffix.lower() == ".log")
    ours = [item for item in logs if item.stem.lower().endswith("_rec")]
    return ours[0] if ours else logs[0] if len(logs) == 1 else None


def read_log(path: Path) -> SkyScanLog:
    """Read a log in any encoding its writers used. Raises MeasurementError where it has no section at all."""
    raw = path.read_bytes()
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    sections: dict[str, dict[str, str]] = {}
    current = None
    for line in text.splitlines():
        line = line.strip()
        if line.startswith("[") and line.endswith("]"):
            current = sections.setdefault(line[1:-1].strip().lower(), {})
        elif current is not None and "=" in line:
            key, value = line.split("=", 1)
            key = " ".join(key.lower().split())
            current.setdefault(SPELLINGS.get(key, key), value.strip())
    if not sections:
        raise MeasurementError(
            path, "", "has no [section]; it is not a SkyScan log, move it out of the folder"
        )
    return SkyScanLog(path, sections)


def check_log(log: SkyScanLog, count: int, shape: tuple[int, int], dtype: np.dtype) -> list[str]:
    """Hold a log against the images beside it; returns warnings, raises MeasurementError where they contradict."""
    stated = log.number("sections count", "reconstruction")
    if stated is not None and int(stated) != count:
        raise MeasurementError(
            log.path,
            "Sections Count",
            f"is {stated:.15g} but there are {count} slices; put the missing ones back",
        )
    for key, size in (("result image width (pixels)", shape[1]), ("result image height (pixels)", shape[0])):
        value = log.number(key, "reconstruction")
        if value is not None and int(value) != size:
            raise MeasurementError(
                log.path, key, f"is {value:.15g} but the slices have {size}; this log belongs to other slices"
            )
    kind = (log.text("result file type", "reconstruction") or "").upper()
    bits = 8 * dtype.itemsize
    if kind.startswith("BMP") and bits != 8:
        raise MeasurementError(log.path, "Result File Type", f"is {kind} but the slices have {bits} bits")
    if log.switch("bmp lut", "reconstruction"):
        raise MeasurementError(
            log.path, "BMP LUT", "is not 0: grey levels passed a look-up table; reconstruct again without it"
        )
    warnings = []
    if log.switch("hu calibration", "reconstruction"):
        warnings.append(f"{log.path.name}: HU Calibration is ON; grey is not attenuation in 1/mm")
    hardening = log.number("beam hardening correction (%)", "reconstruction")
    if hardening:
        warnings.append(
            f"{log.path.name}: beam hardening correction {hardening:g} % was applied; it has no traceable density meaning"
        )
    if log.slice_spacing is not None and log.voxel and abs(log.slice_spacing / log.voxel - 1) > 1e-6:
        raise MeasurementError(
            log.path, "Section to Section Step", "is not 1: voxels are not cubes; reconstruct every section"
        )
    return warnings
