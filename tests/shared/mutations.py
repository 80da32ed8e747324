"""Sound files changed at random: bytes, one line or field of a text, values of a JSON file."""

from __future__ import annotations

import copy
import json
from pathlib import Path


def change_bytes(content: bytes, changes: list[tuple[str, float, bytes]]) -> bytes:
    made = bytearray(content)
    for kind, place, extra in changes:
        at = int(place * max(len(made), 1))
        if kind == "flip" and made:
            made[at] ^= extra[0] or 1
        elif kind == "cut":
            del made[at:]
        elif kind == "repeat":
            made[at:at] = made[at : at + 64]
        elif kind == "drop":
            del made[at : at + len(extra)]
        elif kind == "insert":
            made[at:at] = extra
        elif kind == "zero":
            made[at : at + 256] = bytes(len(made[at : at + 256]))
    return bytes(made)


def change_text(text: str, change: tuple[str, float, str]) -> str:
    """One line of a TOML or CSV file changed: its value, its key, its field, its existence."""
    kind, place, extra = change
    lines = text.splitlines()
    keyed = [k for k, line in enumerate(lines) if ("=" in line if kind in {"value", "key"} else line.strip())]
    if not keyed:
        return text + extra
    at = keyed[int(place * len(keyed))]
    key, _, value = lines[at].partition("=")
    if kind == "value":
        lines[at] = f"{key}= {extra}"
    elif kind == "key":
        lines[at] = f"{extra} ={value}"
    elif kind == "without":
        del lines[at]
    elif kind == "digit":
        places = [k for k, sign in enumerate(lines[at]) if sign.isdigit()]
        if places:
            k = places[int(place * 997) % len(places)]
            lines[at] = lines[at][:k] + extra + lines[at][k + 1 :]
    elif kind == "twice":
        lines.insert(at, lines[at])
    else:
        fields = lines[at].split(",")
        fields[int(place * 997) % len(fields)] = extra
        lines[at] = ",".join(fields)
    return "\n".join(lines) + "\n"


def change_json(text: str, changes: list[tuple[str, float, object]]) -> str:
    """A JSON file with values replaced, taken out or added, mostly in what says how it was made: JSON again."""
    made = json.loads(text)
    for kind, place, extra in changes:
        places: list[tuple] = []
        stack = (
            [made] if place < 0.2 else [made["made_by"]] if isinstance(made.get("made_by"), dict) else [made]
        )
        while stack:
            at = stack.pop()
            for key in list(at) if isinstance(at, dict) else range(len(at)):
                places.append((at, key))
                if isinstance(at[key], (dict, list)):
                    stack.append(at[key])
        if not places:
            continue
        at, key = places[int(place * 997) % len(places)]
        if kind == "without":
            del at[key]
        elif kind == "added" and isinstance(at, list):
            at.insert(key, copy.deepcopy(extra))
        else:
            at[key] = copy.deepcopy(extra)
    return json.dumps(made)


def change_file(file: Path, change: tuple | list) -> None:
    if isinstance(change, list):
        file.write_bytes(change_bytes(file.read_bytes(), change))
    else:
        file.write_text(change_text(file.read_text(errors="replace"), change), errors="replace")
