"""Corrections of a TOML file: one after the other, taken back one by one, and written in the words of the file."""

from __future__ import annotations

import os
import shutil
import tomllib
from collections.abc import Mapping, MutableMapping
from pathlib import Path
from typing import Any, cast

import tomlkit

from ..errors import CampaignError

Changes = dict[str, Any]  # "table.key" -> value; None: the key is taken out


class Edits:
    """What differs from a file as it was opened. Everything is kept in steps; ``undo`` takes back the last one.

    file : None where there is no file, then nothing can be saved.
    """

    def __init__(self, file: Path | None) -> None:
        self.file = file
        self._opened = self._on_disk = b"" if file is None else file.read_bytes()
        self._steps: list[Changes] = [{}]
        self._saved: Changes = {}

    @property
    def now(self) -> Changes:
        return self._steps[-1]

    @property
    def is_saved(self) -> bool:
        return self.now == self._saved

    @property
    def can_undo(self) -> bool:
        return len(self._steps) > 1

    def put(self, changes: Mapping[str, Any]) -> None:
        after = {**self.now, **changes}
        if after != self.now:
            self._steps.append(after)

    def undo(self) -> None:
        if self.can_undo:
            self._steps.pop()

    def as_given(self) -> dict[str, dict[str, Any]]:
        """The corrections as the readers take them, table by table."""
        given: dict[str, dict[str, Any]] = {}
        for name, value in self.now.items():
            table, _, key = name.partition(".")
            given.setdefault(table, {})[key] = value
        return given

    def write(self) -> bytes:
        """The file's text with the corrections; comments, order and all other keys are the file's.

        Raises CampaignError where it is written in a way that does not allow that.
        """
        if not self.now:
            return self._opened
        before = self._opened.decode("utf-8")
        document, wanted = tomlkit.parse(before), tomllib.loads(before)
        for name, values in self.as_given().items():
            if name not in document:
                document[name] = tomlkit.table()
            for tables in (document, wanted):
                table = cast(MutableMapping[str, Any], tables.setdefault(name, {}))
                for key, value in values.items():
                    if value is not None:
                        table[key] = value
                    else:
                        table.pop(key, None)
        text = tomlkit.dumps(document)
        if tomllib.loads(text) != wanted:
            raise CampaignError(
                self.file or "labsim view",
                ", ".join(self.now),
                "cannot be changed without touching other keys; write the table on lines of its own",
            )
        return text.encode("utf-8")

    def save(self) -> None:
        """Write the file; a killed process leaves the old one whole.

        Raises CampaignError where there is no file, or where somebody else has written it since.
        """
        if self.file is None:
            raise CampaignError(
                "labsim view", "drop.toml", "is not there; labsim new DIR writes one to save in"
            )
        text, file = self.write(), self.file.resolve()
        aside = file.with_name(f".{file.name}.{os.getpid()}")
        try:
            if file.read_bytes() != self._on_disk:
                raise CampaignError(
                    self.file,
                    "",
                    "was changed by another program; start labsim view again to see what it holds",
                )
            aside.write_bytes(text)
            shutil.copymode(file, aside)
            os.replace(aside, file)
        except OSError as trouble:
            aside.unlink(missing_ok=True)
            raise CampaignError(
                self.file, "", f"cannot be written ({trouble.strerror}); make it writable"
            ) from None
        self._on_disk, self._saved = text, dict(self.now)
