"""What ``labsim check`` says of a campaign that is readable but wrong: one change a line, with what was said on 2026-11-22.

    python -m benchmarks.faults.campaigns [CAMPAIGN] [--only REGEX] [--drops D05,D06] [--full] [--calibrate] [--keep DIR]

CAMPAIGN (default data/campaigns/p01) gives its drops D05 and D06; each change is made to a copy of the two (those with
"other" in their name: to D06 of the whole campaign), ``labsim check`` runs on the copy in this process, and what it says
is printed: exit status, what cannot be read, what is odd. With --calibrate p_m is printed too; stored runs are shared by
LABSIM_STORE, and the first calibration costs minutes. --keep leaves the copies in DIR.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import shutil
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from labsim.cli import main

ROOT = Path(__file__).parents[2]
Rows = tuple[np.ndarray, np.ndarray]
Change = Callable[[Path], None]
RowChange = Callable[[np.ndarray, np.ndarray, int], Rows]  # frame, row, index of the first row in the dust


def write(**keys: object) -> Change:
    """Keys of drop.toml or campaign.toml (whichever has them) of every drop; a function changes the value that is there."""

    def change(folder: Path) -> None:
        for key, value in keys.items():
            changed = 0
            for file in (folder / "campaign.toml", *folder.glob("drops/*/drop.toml")):
                text = file.read_text()
                found = re.search(rf"(?m)^{key} = ([^#\n]*?)\s*(#.*)?$", text)
                if found:
                    new = value(float(found[1])) if callable(value) else value
                    file.write_text(text[: found.start(1)] + str(new) + text[found.end(1) :])
                    changed += 1
            assert changed, key

    return change


def rows(change: RowChange) -> Change:
    """frame, row -> frame, row of every drop's track."""

    def apply(folder: Path) -> None:
        for file in folder.glob("drops/*/track.csv"):
            table = np.loadtxt(file, delimiter=",", skiprows=1)
            surface = tomllib.loads((file.parent / "drop.toml").read_text())["camera"]["surface_row_px"]
            contact = int(np.flatnonzero(table[:, 1] > surface + 1)[0])
            frame, row = change(table[:, 0], table[:, 1], contact)
            lines = [f"{f:.10g},{r:.3f}" for f, r in zip(frame, row, strict=True)]
            file.write_text("frame,tip_row_px\n" + "\n".join(lines) + "\n")

    return apply


def all_of(*changes: Change) -> Change:
    def apply(folder: Path) -> None:
        for change in changes:
            change(folder)

    return apply


def in_one(change: Change) -> Change:
    """Only to D06, the others as they are."""

    def apply(folder: Path) -> None:
        with tempfile.TemporaryDirectory() as aside:
            alone = Path(aside)
            shutil.copy(folder / "campaign.toml", alone)
            shutil.move(folder / "drops/D06", alone / "drops/D06")
            change(alone)
            shutil.move(alone / "drops/D06", folder / "drops/D06")

    return apply


def lose(first: int, count: int, *, renumber: bool) -> RowChange:
    """``count`` frames from ``first`` after contact on; renumbered, so that nothing shows, or with a gap."""

    def change(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
        at = contact + first
        keep = np.delete(np.arange(row.size), np.arange(at, at + count))
        return (frame[: keep.size] if renumber else frame[keep]), row[keep]

    return change


def repeat(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    at = contact + 6
    number = np.concatenate([frame[:at], frame[at] + np.arange(3), frame[at:] + 3])
    return number, np.insert(row, at, [row[at]] * 3)


def jump(after_contact: int | None, size: float = 5.0) -> RowChange:
    def change(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
        at = 100 if after_contact is None else contact + after_contact
        return frame, row + np.where(np.arange(row.size) >= at, size, 0.0)

    return change


def bounce(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    """After the stop a parabola of 12 px up and down again, within twenty frames."""
    at = contact + 20
    s = np.clip((np.arange(row.size) - at) / 20, 0, 1)
    return frame, row - 48 * s * (1 - s)


def smooth(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    padded = np.pad(row, 10, mode="reflect", reflect_type="odd")
    return frame, np.convolve(padded, np.ones(21) / 21, "valid")


def shake(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    return frame, row + 0.5 * np.sin(2 * np.pi * frame / 7.3)


def spike(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    row = row.copy()
    row[contact + 5] += 60
    return frame, row


def twice(frame: np.ndarray, row: np.ndarray, contact: int) -> Rows:
    return np.concatenate([frame, frame[-1] + 1 + frame - frame[0]]), np.concatenate([row, row])


def filed_again(times: int, change: Callable[[str], str] = lambda text: text) -> Change:
    def apply(folder: Path) -> None:
        for number in range(times):
            copy = folder / f"drops/E{number:02d}"
            shutil.copytree(folder / "drops/D05", copy)
            text = (copy / "drop.toml").read_text()
            (copy / "drop.toml").write_text(
                re.sub(r"(?m)^sequence = \d+", f"sequence = {100 + number}", text)
            )
            (copy / "track.csv").write_bytes(change((copy / "track.csv").read_text()).encode())

    return apply


def swap_tracks(folder: Path) -> None:
    one, two = (folder / f"drops/{name}/track.csv" for name in ("D05", "D06"))
    first, second = one.read_bytes(), two.read_bytes()
    one.write_bytes(second)
    two.write_bytes(first)


def as_video(folder: Path) -> None:
    for file in folder.glob("drops/*/drop.toml"):
        text = file.read_text()
        text = text.replace('file = "track.csv"', 'file = "fall.avi"').replace('"track"', '"video"')
        file.write_text(text)
        (file.parent / "fall.avi").write_bytes(b"RIFF\0\0\0\0AVI nothing of " + file.parent.name.encode())


# change -> (what is done, what check said on 2026-11-22)
CHANGES: dict[str, tuple[Change, str]] = {
    "nothing": (lambda folder: None, "nothing odd"),
    "pixel in mm": (write(pixel_size_um=0.020), "refused"),
    "porosity for filling factor": (write(filling_factor=0.85), "refused"),
    "filling factor in %": (write(filling_factor=15.0), "refused"),
    "density in g/cm3": (write(monomer_density_kg_m3=2.0), "refused"),
    "K in kPa": (write(bulk_modulus_Pa=45.0), "refused"),
    "mass negative": (write(mass_mg=-1.33), "refused"),
    "mass in g": (write(mass_mg=0.00133), "refused"),
    "50 px/mm as 50 um": (write(pixel_size_um=50.0), "odd: g, heights"),
    "pixel 2 x": (write(pixel_size_um=40.0), "odd: g, heights"),
    "pixel 1.1 x": (write(pixel_size_um=22.0), "odd: g, heights"),
    "rate 10 x": (write(frame_rate_Hz=1e5), "odd: g, heights"),
    "rate / 10": (write(frame_rate_Hz=1e3), "odd: g, heights"),
    "rate 1.1 x": (write(frame_rate_Hz=1.1e4), "odd: g, heights"),
    "rate 1.1 x, pixel / 1.21": (write(frame_rate_Hz=1.1e4, pixel_size_um=20 / 1.21), "odd: heights"),
    "columns swapped": (rows(lambda f, r, c: (r, f)), "refused"),
    "frames descending": (rows(lambda f, r, c: (f[::-1], r)), "refused"),
    "same sequence": (write(sequence=3), "refused"),
    "rows in mm": (rows(lambda f, r, c: (f, r * 0.02)), "refused"),
    "constant from frame 40": (
        rows(lambda f, r, c: (f, np.where(np.arange(r.size) < 40, r, r[40]))),
        "refused",
    ),
    "row_sigma 0": (write(row_sigma_px=0.0), "refused"),
    "rows reversed": (rows(lambda f, r, c: (f, r[::-1])), "no motion, exit 0"),
    "upside down": (rows(lambda f, r, c: (f, 600 - r)), "no motion, exit 0"),
    "constant row": (rows(lambda f, r, c: (f, np.full(r.size, 310.0))), "no motion, exit 0"),
    "1 frame": (rows(lambda f, r, c: (f[-1:], r[-1:])), "no motion, exit 0"),
    "3 frames": (rows(lambda f, r, c: (f[-3:], r[-3:])), "no motion, exit 0"),
    "begins after contact": (
        rows(lambda f, r, c: (f[c + 4 :], r[c + 4 :])),
        "no motion, exit 0",
    ),
    "times in the frame column": (rows(lambda f, r, c: (f / 1e4, r)), "no motion, exit 0"),
    "tracks swapped": (swap_tracks, "odd: heights"),
    "height 10 x": (write(height_mm=lambda v: 10 * v), "odd"),
    "height / 2": (write(height_mm=lambda v: v / 2), "odd"),
    "height 1.05 x": (write(height_mm=lambda v: 1.05 * v), "odd"),
    "rows and surface in mm": (
        all_of(rows(lambda f, r, c: (f, 2 + r * 0.02)), write(surface_row_px=lambda v: 2 + v * 0.02)),
        "odd",
    ),
    "begins 3 frames before contact": (
        rows(lambda f, r, c: (f[c - 3 :], r[c - 3 :])),
        "odd",
    ),
    "ends 5 frames after contact": (
        rows(lambda f, r, c: (f[: c + 5], r[: c + 5])),
        "odd",
    ),
    "jump of 5 px at frame 100": (rows(jump(None)), "odd"),
    "jump of 5 px, 8 frames after contact": (rows(jump(8)), "odd in one of two"),
    "6 frames lost after contact, renumbered": (rows(lose(6, 6, renumber=True)), "odd"),
    "1 frame lost after contact, renumbered": (rows(lose(6, 1, renumber=True)), "?"),
    "1 frame lost in free fall, renumbered": (rows(lose(-60, 1, renumber=True)), "?"),
    "a frame repeated 3 x after contact": (rows(repeat), "odd in one of two; D06 T +15 %, silent"),
    "0.5 px vibration": (rows(shake), "odd"),
    "whole pixels": (rows(lambda f, r, c: (f, np.round(r))), "odd"),
    "smoothed over 21 frames": (rows(smooth), "odd"),
    "gap of 30 frames about contact": (rows(lose(-15, 30, renumber=False)), "silent"),
    "bounce of 12 px": (rows(bounce), "silent; T -4.5 %"),
    "two impacts in one track": (rows(twice), "silent"),
    "drop filed 11 x": (filed_again(10), "silent"),
    "drop filed twice, other line ends": (filed_again(1, lambda t: t.replace("\n", "\r\n")), "silent"),
    "drop filed twice, other digits": (
        filed_again(1, lambda t: re.sub(r"(?m)^(\d+),(.*)$", r"\1.0, \g<2>0", t)),
        "silent",
    ),
    "surface row +2 px": (write(surface_row_px=lambda v: v + 2), "silent; p_m 1.421 +- 0.057, p 0.50"),
    "surface row -2 px": (write(surface_row_px=lambda v: v - 2), "silent"),
    "surface row +1 px": (write(surface_row_px=lambda v: v + 1), "silent"),
    "surface row +10 px": (write(surface_row_px=lambda v: v + 10), "silent; p_m 0.80"),
    "surface row -10 px": (write(surface_row_px=lambda v: v - 10), "silent; p_m 2.02"),
    "p_m range without the truth": (
        write(p_m_range_Pa="[3000.0, 6000.0]"),
        "silent; p_m 3.004 +- 0.004, p 0.72",
    ),
    "mass 2 x": (write(mass_mg=lambda v: 2 * v), "silent; p_m 5.71 +- 0.18, p 0.78"),
    "tip radius 2 x": (write(tip_radius_mm=1.0), "silent; p_m 0.301, p 2e-23"),
    "tip radius 1.5 x": (write(tip_radius_mm=0.75), "silent; p_m 0.382, p 0.002"),
    "phi0 0.30 without CT": (write(filling_factor=0.30), "silent, cannot be seen"),
    "60 px spike in one frame": (rows(spike), "silent, numbers right"),
    "frames from 100000": (rows(lambda f, r, c: (f + 1e5, r)), "silent, numbers right"),
    "10 frames lost in free fall": (rows(lose(-60, 10, renumber=False)), "silent, numbers right"),
    "videos that cannot be opened": (as_video, "nothing is wrong with its files, exit 0"),
    "other: mass 2 x": (in_one(write(mass_mg=lambda v: 2 * v)), "silent"),
    "other: mass of the heavy rod": (in_one(write(mass_mg=3.3249)), "silent"),
    "other: tip radius of the big rod": (
        in_one(write(tip_radius_mm=1.5, length_mm=9.0, mass_mg=35.9084)),
        "silent",
    ),
    "other: tip radius 1.5 x": (in_one(write(tip_radius_mm=0.75)), "silent"),
    "other: height of D07": (in_one(write(height_mm=61.13)), "odd"),
    "other: frame rate of the other camera": (in_one(write(frame_rate_Hz=5000.0)), "odd"),
    "other: pixel of the other camera": (in_one(write(pixel_size_um=40.0)), "odd"),
    "other: the other camera": (in_one(write(pixel_size_um=40.0, frame_rate_Hz=5000.0)), "odd"),
    "other: surface row of D07": (in_one(write(surface_row_px=295.21)), "silent"),
    "other: frames of half the rate": (in_one(rows(lambda f, r, c: (f[::2] / 2, r[::2]))), "odd"),
    "other: every second frame": (in_one(rows(lambda f, r, c: (f[::2], r[::2]))), "silent, numbers right"),
    "other: deeper by 10 % than it went": (
        in_one(rows(lambda f, r, c: (f, np.where(r > 299.8, 299.8 + 1.1 * (r - 299.8), r)))),
        "?",
    ),
}


def make_copy(source: Path, target: Path, drops: list[str] | None) -> None:
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("ct"))
    for drop in (target / "drops").iterdir():
        if drops is not None and drop.name not in drops:
            shutil.rmtree(drop)


def run(*arguments: object) -> tuple[int, str, str]:
    """Exit status, standard output, standard error of one command in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(each) for each in arguments])
        except SystemExit as left:
            return int(left.code or 0), out.getvalue(), err.getvalue()
    raise AssertionError("main returns by SystemExit")


def judge(folder: Path) -> list[str]:
    status, out, err = run("check", folder, "--json")
    lines = [f"exit {status}"]
    if out:
        found = json.loads(out)
        lines += [f"unreadable: {text}" for text in found.get("unreadable", [])]
        lines += [f"odd: {text}" for text in found["warnings"]]
    lines += [line.replace(str(folder), "") for line in err.splitlines() if line.startswith("error")]
    return lines


def calibrate(folder: Path, out: Path) -> str:
    status, said, err = run("calibrate", folder, "-o", out, "--json", "--workers", 1)
    if status:
        return f"calibrate: exit {status}, {err.strip().splitlines()[-1]}"
    found = json.loads(said)
    p_m = found["p_m_Pa"]
    warned = "".join(f"\n      warned: {text}" for text in found["warnings"])
    return f"calibrate: p_m {p_m['mean'] / 1e3:.3f} ± {p_m['sd'] / 1e3:.3f} kPa, p {found['p_value']:.2g}{warned}"


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("campaign", nargs="?", type=Path, default=ROOT / "data/campaigns/p01")
    parser.add_argument("--only", default="", help="changes whose name this regular expression finds")
    parser.add_argument("--drops", default="D05,D06")
    parser.add_argument("--full", action="store_true", help="all drops of the campaign in every change")
    parser.add_argument("--calibrate", action="store_true")
    parser.add_argument("--keep", type=Path)
    return parser.parse_args()


if __name__ == "__main__":
    given = parse()
    with tempfile.TemporaryDirectory() as made:
        place = given.keep or Path(made)
        for number, (name, (change, before)) in enumerate(CHANGES.items()):
            if not re.search(given.only, name):
                continue
            folder = place / f"{number:02d}-{re.sub(r'[^a-z0-9]+', '-', name)}"
            whole = given.full or name.startswith("other")
            make_copy(given.campaign, folder, None if whole else given.drops.split(","))
            change(folder)
            print(f"{name}\n    before: {before}")
            for line in judge(folder):
                print(f"    now: {line}")
            if given.calibrate:
                print(f"    now: {calibrate(folder, place / f'{folder.name}-out')}", flush=True)
