"""TOML and JSON as files. What somebody else wrote is read, or refused in one line, within seconds, whatever the file is.

Only files are opened (reading a fifo waits for ever, a device may have no end), only as much as a sound one can hold, and what
the parsers of the standard library let through is caught here: values nested too deep, integers beyond 64 bits.
"""

from __future__ import annotations

import json
import math
import os
import tomllib
from pathlib import Path
from typing import Any

from .errors import LabsimError

# bytes. A campaign's TOML files are written by hand and have some kB; the time that tomllib takes grows with the square of the
# dots in a key, and with this many it is seconds
LARGEST_TOML = 1 << 15
# summaries have some 10 kB; the list of a store's runs has 250 bytes for each, and this is a quarter of a million of them
LARGEST_JSON = 1 << 26
INTEGERS = 1 << 63  # as TOML has them


def load_toml(path: Path, error: type[LabsimError], remedy: str) -> dict[str, Any]:
    """What a TOML file holds. remedy : what to do where there is none. Raises ``error``."""
    text = _read(path, LARGEST_TOML, error, remedy)
    try:
        found = tomllib.loads(text)
    except (RecursionError, MemoryError):  # it keeps every part of a dotted key with all parts before it
        raise error(path, "", f"is nested too deep; {remedy}") from None
    except ValueError as trouble:  # TOMLDecodeError is one, and so are Python's own about numbers and dates
        raise error(path, "", f"is not TOML: {trouble}; correct that line") from None
    if (key := _find_large(found)) is not None:
        raise error(path, key, "is an integer beyond 64 bits; write a number that can be measured")
    return found


def load_json(path: Path, error: type[LabsimError], remedy: str) -> Any:
    """What a JSON file holds. remedy : what to do where there is none. Raises ``error``."""
    try:
        return json.loads(_read(path, LARGEST_JSON, error, remedy))
    except RecursionError:
        raise error(path, "", "is nested too deep; it is not of labsim") from None
    except ValueError as trouble:
        raise error(path, "", f"is not JSON: {trouble}") from None


def write_json(path: Path, values: dict[str, Any]) -> Path:
    """Write a summary file; a number that is not finite becomes null, and a killed process leaves no half file."""
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    aside.write_text(
        json.dumps(make_finite(values), indent=2, ensure_ascii=False, allow_nan=False) + "\n",
        encoding="utf-8",
    )
    os.replace(aside, path)
    return path


def make_finite(value: Any) -> Any:
    """As JSON can hold it: arrays as lists, paths as texts, a number that is not finite as null."""
    if isinstance(value, dict):
        return {str(key): make_finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [make_finite(item) for item in value]
    if hasattr(value, "tolist"):
        return make_finite(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def _read(path: Path, most: int, error: type[LabsimError], remedy: str) -> str:
    try:
        if not path.exists():
            raise error(path, "", f"no such file; {remedy}")
        if not path.is_file():
            raise error(path, "", f"is a folder or a device, not a file; {remedy}")
        with path.open("rb") as stream:
            content = stream.read(most + 1)
    except OSError as trouble:
        raise error(path, "", f"cannot be read ({trouble.strerror}); make it readable") from None
    if len(content) > most:
        raise error(path, "", f"is longer than {most >> 10} kB, which no sound one is; {remedy}")
    try:
        return content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise error(path, "", "is not UTF-8 text; save it as UTF-8") from None


def _find_large(values: dict[str, Any]) -> str | None:
    """The key above an integer that is too large, if there is one."""
    todo = [(key, value) for key, value in values.items()]
    while todo:
        key, value = todo.pop()
        if isinstance(value, dict):
            todo += [(f"{key}.{name}", item) for name, item in value.items()]
        elif isinstance(value, list):
            todo += [(key, item) for item in value]
        elif isinstance(value, int) and not -INTEGERS <= value < INTEGERS:
            return key
    return None
