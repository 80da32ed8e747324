"""What a drop and a scan have in common on the page: pictures, corrections, and a measurement that runs beside the page."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import LabsimError
from .edits import Edits


class RecordView(ABC):
    """A record with its corrections. A subclass says which keys can be corrected (``KEYS``), checks them and measures."""

    KIND: str
    KEYS: frozenset[str]
    page = "viewer.html"

    def __init__(self, name: str, file: Path | None) -> None:
        self.name = name
        self.edits = Edits(file)
        self.shown_file = None if file is None else f"{file.resolve().parent.name}/{file.name}"
        self.measured: dict[str, Any] | None = None
        self.measurements = 0
        self._measured_with: dict[str, Any] = {}
        self._trouble = ""
        self._progress: tuple[str, float] | None = None
        self._lock = threading.Lock()

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Pictures and values in force, for the page. Raises LabsimError where a correction cannot be."""

    @abstractmethod
    def draw(self, number: int) -> bytes:
        """Picture ``number`` (from 0) as PNG. Raises IndexError where there is none."""

    @abstractmethod
    def _measure(self) -> dict[str, Any]:
        """What is found with the corrections of now, for the page. Raises LabsimError."""

    def state(self) -> dict[str, Any]:
        """Everything the page shows but the pictures."""
        with self._lock:
            progress = self._progress
            return {
                "kind": self.KIND,
                "name": self.name,
                "file": self.shown_file,
                "saved": self.edits.is_saved,
                "can_undo": self.edits.can_undo,
                "busy": None if progress is None else {"text": progress[0], "share": progress[1]},
                "trouble": self._trouble,
                "measured": self.measured,
                "measurements": self.measurements,
                "stale": self.measured is not None and self._measured_with != self.edits.now,
                **self.describe(),
            }

    def edit(self, changes: Mapping[str, Any]) -> None:
        """Take over corrections that the campaign's reader accepts. Raises LabsimError, and then nothing has changed."""
        for key in changes:
            if key not in self.KEYS:
                raise LabsimError(
                    "labsim view",
                    key,
                    "is not corrected here; edit the file: " + ", ".join(sorted(self.KEYS)),
                )
        with self._lock:
            before = self.edits.now
            self.edits.put(changes)
            try:
                self.describe()
            except LabsimError:
                if self.edits.now is not before:
                    self.edits.undo()
                raise

    def undo(self) -> None:
        with self._lock:
            self.edits.undo()

    def save(self) -> None:
        with self._lock:
            self.edits.save()

    def measure(self) -> None:
        """Measure with the corrections of now in a thread of its own, unless one is at it."""
        with self._lock:
            if self._progress is not None:
                return
            self._progress, self._trouble = ("reading", 0.0), ""
            self._measured_with = dict(self.edits.now)
        threading.Thread(target=self._work, daemon=True).start()

    def tell(self, done: float, total: float, text: str) -> None:
        """The ``progress`` of what measures."""
        self._progress = (text, done / total if total else 0.0)

    def _work(self) -> None:
        measured, trouble = None, "could not be measured; the terminal says why"
        try:
            measured, trouble = self._measure(), ""
        except LabsimError as error:
            trouble = str(error)
        finally:  # whatever it was, the page does not wait for ever
            with self._lock:
                self.measured, self._trouble, self._progress = measured, trouble, None
                self.measurements += 1

    @abstractmethod
    def close(self) -> None:
        """Give back what the view holds outside of memory."""


def say(value: float, sigma: float, factor: float, unit: str, digits: int) -> str:
    """``1.234 ± 0.005 mm``; the value in SI, ``factor`` to the unit."""
    return f"{factor * value:.{digits}f} ± {factor * sigma:.{digits}f} {unit}"


def take_finite(values: Any, digits: int) -> list[Any]:
    """Numbers of any shape as lists, rounded, None where they are not finite."""
    if hasattr(values, "tolist"):
        values = values.tolist()
    return [
        take_finite(each, digits)
        if isinstance(each, list)
        else round(each, digits)
        if each is not None and abs(each) < float("inf")
        else None
        for each in values
    ]
