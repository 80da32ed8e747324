"""Mutants of every reader: each gives a result or one line, within 10 s, 2 GB, and no silent wrong number.

    python -m benchmarks.faults.mutants                         3 000 mutants of all kinds
    python -m benchmarks.faults.mutants --mutants 200 --kinds tiff cine --seed 2

labsim is imported once; each mutant is a forked process with limits on memory and CPU time. A mutant fails where it ends with
another status than 0 or 2, says something else than one ``error:`` line, or takes 10 s of CPU more than twice the sound file;
and where it gives a result that differs from that of the sound file by more than 4 of its own standard deviations without a
warning. Results are compared for records (tables, videos, pictures); a number changed in a TOML file is another statement,
not a wrong result.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import math
import os
import pkgutil
import random
import resource
import shutil
import struct
import sys
import tempfile
import zipfile
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "shared")]
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402
from attempts import Attempt, attempt  # noqa: E402
from mutations import change_bytes, change_json, change_text  # noqa: E402
from small_campaign import copy_campaign  # noqa: E402
from strength_tests import make_test, write_test  # noqa: E402

# s: the sound file, a mutant beyond twice the sound file, and what waits for ever on a machine that is shared
SOUND_CPU, MORE_CPU, WALL = 60, 10, 120.0
FAR = 4.0  # standard deviations
TRACK = ["--fps", "5000", "--pixel-um", "40", "-o", "out", "-q"]
TABLE = ["--fps", "10000", "--pixel-um", "20", "--surface-row", "300", "-o", "out", "-q"]
QUICK = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3 --time-ms 0.01".split()
MODEL = ["--model", "model.toml", "--store", "out/store"]
STATIC = ["strength", "static", "-o", "out", "-q"]
VALUES = [
    "nan",
    "inf",
    "-1",
    "0",
    "1e308",
    "9" * 400,
    "true",
    '""',
    '"../x"',
    "[]",
    "{}",
    "[[[[]]]]",
    '"' + "x" * 5000 + '"',
]
FIELDS = ["", "nan", "inf", "1e400", "-5", "abc", "1,2", "0x10", '"', "1e9", "0", "300.5"]
DIGITS = "0123456789"
KEYS = ["format", "x", "é", '"a b"', "a.b.c"]
JUNK = [
    None,
    True,
    -1,
    1e308,
    "",
    "/",
    "\0",
    [],
    {},
    ["labsim", "new", "evil"],
    ["labsim", "simulate", "-oevil"],
    "--out=evil",
]

# kind -> file that is changed, command, text or bytes or JSON, whether results are compared, share of all
KINDS: dict[str, tuple[str, list[str], str, bool, float]] = {
    "track.csv": ("t/track.csv", ["track", "t/track.csv", *TABLE], "text", True, 0.11),
    "tracker txt": ("t/table.txt", ["track", "t/table.txt", *TABLE], "text", True, 0.06),
    "tracker trk": ("t/d.trk", ["track", "t/d.trk", *TABLE], "text", True, 0.05),
    "tracker trz": ("t/d.trz", ["track", "t/d.trz", *TABLE], "bytes", True, 0.04),
    "trackpy csv": ("t/trackpy.csv", ["track", "t/trackpy.csv", *TABLE], "text", True, 0.06),
    "campaign.toml": ("campaign/campaign.toml", ["check", "campaign", "-q"], "text", False, 0.07),
    "drop.toml": ("campaign/drops/D05/drop.toml", ["check", "campaign", "-q"], "text", False, 0.05),
    "strength.toml": ("static/strength/S01/strength.toml", STATIC, "text", False, 0.02),
    "strength csv": ("static/strength/S01/curve.csv", STATIC, "text", False, 0.02),
    "scan.toml": ("scan/scan.toml", ["ct", "scan", "-o", "out", "-q"], "text", False, 0.03),
    "model.toml": ("model.toml", ["simulate", *QUICK, *MODEL, "-o", "out", "-q"], "text", False, 0.06),
    "run.json": ("result/run.json", ["rerun", "result", "-o", "out", "-q"], "json", False, 0.04),
    "avi": ("v/video.avi", ["track", "v/video.avi", *TRACK], "bytes", True, 0.06),
    "mp4": ("v/video.mp4", ["track", "v/video.mp4", *TRACK], "bytes", True, 0.07),
    "tiff": ("v/video.tif", ["track", "v/video.tif", *TRACK], "bytes", True, 0.07),
    "cine": ("v/video.cine", ["track", "v/video.cine", *TRACK], "bytes", True, 0.07),
    "folder of pictures": ("v/pictures/*", ["track", "v/pictures", *TRACK], "bytes", True, 0.05),
    "slices": ("scan/slices/*", ["ct", "scan", "-o", "out", "-q"], "bytes", True, 0.02),
    "hdf5 stack": ("stack.h5", [], "bytes", False, 0.03),
    "stored run": ("store/*/*.h5", ["runs", "verify", "--store", "store", "-q"], "bytes", False, 0.02),
}  # fmt: skip


def load_labsim() -> None:
    import labsim

    for module in pkgutil.walk_packages(labsim.__path__, "labsim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)


def write_cine(path: Path, pictures: list[np.ndarray], rate: int) -> None:
    """As labsim/video/formats/cine.py describes it."""
    height, width = pictures[0].shape
    count, size, setup_length = len(pictures), height * width, 1024
    image_at, setup_at = 44, 68
    stamps = [int(k / rate * 2**32) + (1 << 40) for k in range(count)]
    tag = struct.pack("<IHH", 8 + 8 * count, 1002, 0) + struct.pack(f"<{count}Q", *stamps)
    table_at = setup_at + setup_length + len(tag)
    setup = bytearray(setup_length)
    setup[140:142] = b"ST"
    struct.pack_into("<H", setup, 142, setup_length)
    struct.pack_into("<I", setup, 768, rate)
    struct.pack_into("<I", setup, 896, 8)
    first = table_at + 8 * count
    offsets = [first + k * (8 + size) for k in range(count)]
    head = bytearray(44)
    struct.pack_into("<2sHHH", head, 0, b"CI", 44, 0, 1)
    struct.pack_into("<IIII", head, 20, count, image_at, setup_at, table_at)
    image = struct.pack("<IiiHHII", 40, width, height, 1, 8, 0, size)
    with path.open("wb") as stream:
        stream.write(bytes(head) + image + bytes(setup) + tag + struct.pack(f"<{count}Q", *offsets))
        for picture in pictures:
            stream.write(struct.pack("<II", 8, size) + np.ascontiguousarray(picture[::-1]).tobytes())


def write_sound(home: Path) -> None:
    """A small sound file of every kind."""
    import h5py
    import pandas as pd
    import tifffile
    from campaign_files import write_scan_of

    from benchmarks.truths.phantom import Phantom
    from benchmarks.truths.video import Recording, fall_and_stop, render, write_video
    from labsim.records import Material, Projectile
    from labsim.runs.store import RunStore, require_runs
    from labsim.sph import DropSetting

    copy_campaign(home / "campaign")
    write_test(copy_campaign(home / "static"), make_test("compression_omnidirectional", 1))
    (home / "t").mkdir()
    table = home / "t" / "track.csv"
    shutil.copy(home / "campaign/drops/D05/track.csv", table)
    frame = pd.read_csv(table)
    rows = dict(zip(frame["frame"], frame["tip_row_px"], strict=True))
    spec = importlib.util.spec_from_file_location("track_formats", ROOT / "tests/tracks/test_formats.py")
    assert spec is not None and spec.loader is not None
    formats = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(formats)
    formats.write_project(home / "t/d.trk", {"mass A": rows})
    with zipfile.ZipFile(home / "t/d.trz", "w") as archive:
        archive.write(home / "t/d.trk", "project/d.trk")
    formats.write_tracker_table(home / "t/table.txt", rows)
    formats.write_trackpy(home / "t/trackpy.csv", rows)

    (home / "v" / "pictures").mkdir(parents=True)
    depth, _ = fall_and_stop(40, 16.3, 2.5, 15.0)
    recording = Recording(shape=(140, 64), width=20.0, length=50.0, surface_row=100.0, column=31.0)
    pictures, _ = render(recording, depth)
    eight = [np.asarray(picture, np.uint8) for picture in pictures]
    write_video(eight, home / "v/video.avi", "MJPG")
    write_video(eight, home / "v/video.mp4", "mp4v")
    tifffile.imwrite(home / "v/video.tif", np.stack(eight), photometric="minisblack")
    write_cine(home / "v/video.cine", eight, 5000)
    import cv2

    for k, picture in enumerate(eight):
        cv2.imwrite(str(home / f"v/pictures/{k:03d}.png"), picture)

    phantom = Phantom(shape=(64, 56, 56), centre=(28.3, 27.6, 26.4), radius=7.5, surface=16.0)
    write_scan_of(phantom, home / "scan")
    slices = [tifffile.imread(file) for file in sorted((home / "scan/slices").glob("*.tif"))]
    with h5py.File(home / "stack.h5", "w") as stack:
        stack.create_dataset("exchange/data", data=np.stack(slices), chunks=(1, *slices[0].shape))
    cylinder = Projectile(tip="cylinder", tip_radius=5e-4, mass=2e-3)
    setting = DropSetting(
        cylinder, 0.3, Material(bulk_modulus=4500.0), geometry="planar", spacing=1.25e-4, width=4e-3, depth=2e-3,
        gravity=0.0, after_stop=0.0,
    )  # fmt: skip
    require_runs(RunStore(home / "store").get_many([setting], workers=1))
    shutil.rmtree(home / "store" / "locks", ignore_errors=True)
    (home / "store/index.json").unlink(missing_ok=True)
    (home / "model.toml").write_text(
        "format = 1\n\n[material]\np_m_Pa = 1300.0\ndelta = 0.58\n\n[effects.shear_strength]\nfactor = 0.8\n"
    )
    (home / "result").mkdir()
    made = attempt(["simulate", *QUICK, "-o", home / "result", "-q"], home / "result", "")
    assert made.status == 0, made


def read_stack(path: Path) -> None:
    """What the reduction of a scan does first; a file of slices has no command of its own here."""
    from labsim.ct import open_stack
    from labsim.errors import LabsimError

    try:
        stack = open_stack(path)
        for k in range(stack.count):
            stack.slice(k)
    except LabsimError as trouble:
        print("error: " + str(trouble), file=sys.stderr)
        raise SystemExit(2) from None
    raise SystemExit(0)


def mutate(content: bytes, how: str, chance: random.Random) -> tuple[bytes, list[Any]]:
    """The changed file, and the changes."""
    changes: list[Any] = []
    if how == "json":
        for _ in range(chance.choice([1, 1, 2])):
            changes.append(
                (chance.choice(["value", "without", "added"]), chance.random(), chance.choice(JUNK))
            )
        return change_json(content.decode(), changes).encode(), changes
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        if how == "text" and chance.random() < 0.7:
            kind = chance.choice(
                ["value", "key", "without", "twice", "field", "field", "digit", "digit", "digit"]
            )
            extra = chance.choice(
                {"value": VALUES, "key": KEYS, "field": FIELDS, "digit": DIGITS}.get(kind, [""])
            )
            change: Any = (kind, chance.random(), extra)
            content = change_text(content.decode("utf-8", errors="replace"), change).encode(
                "utf-8", errors="replace"
            )
        else:
            kind = chance.choice(["flip", "flip", "cut", "repeat", "drop", "insert", "zero"])
            place = chance.random() * (
                0.02 if how == "bytes" and chance.random() < 0.5 else 1.0
            )  # half hit the head
            change = (kind, place, chance.randbytes(chance.randint(1, 8)))
            content = change_bytes(content, [change])
        changes.append(change)
    return content, changes


def find_numbers(folder: Path) -> tuple[dict[str, tuple[float, float]], list[str]] | None:
    """Every number that stands with its uncertainty in the result, and the warnings."""
    for name in ("drop.json", "scan.json", "map.json", "ct.json"):
        if (folder / name).is_file():
            summary = json.loads((folder / name).read_text())
            break
    else:
        return None
    found = {}
    for key, value in summary.items():
        sigma = summary.get(f"{key}_sigma")
        if isinstance(value, float) and isinstance(sigma, float) and sigma > 0:
            found[key] = (value, sigma)
    return found, list(summary.get("warnings", []))


def compare(sound: Path, mutant: Path) -> str:
    """What is silently wrong in a result; empty where nothing is."""
    true, made = find_numbers(sound), find_numbers(mutant)
    if true is None or made is None:
        return ""
    numbers, warnings = made
    if set(warnings) - set(true[1]):
        return ""
    wrong = [
        f"{key} {value:.6g} ± {sigma:.2g}, {(value - true[0][key][0]) / sigma:+.1f} sigma"
        for key, (value, sigma) in numbers.items()
        if key in true[0] and abs(value - true[0][key][0]) > FAR * sigma
    ]
    return "; ".join(wrong)


def try_mutant(
    kind: str, home: Path, folder: Path, chance: random.Random, sound_cpu: float
) -> tuple[Attempt, str]:
    """The attempt, and what is wrong with it, where the sound file took ``sound_cpu`` seconds of CPU."""
    pattern, command, how, compared, _share = KINDS[kind]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    top = pattern.split("/")[0]
    source = home / top
    (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / top)
    files = sorted(folder.glob(pattern))
    file = chance.choice(files)
    before = file.read_bytes()
    if "*" in pattern and kind != "stored run" and chance.random() < 0.1:  # a file lost, or there twice
        changes: list[Any] = [chance.choice(["lost", "twice"]), file.name]
        if changes[0] == "lost":
            file.unlink()
        else:
            chance.choice(files).write_bytes(before)
    else:
        content, changes = mutate(before, how, chance)
        file.write_bytes(content)
    found = fork(kind, command, folder, MORE_CPU + math.ceil(2 * sound_cpu))
    wrong = found.complaint()
    if kind == "run.json" and found.status == 1 and "Traceback" not in found.said and not found.strays:
        wrong = ""  # different, and says so
    if kind == "stored run" and found.status == 2 and found.said.count("error: ") == 1:
        wrong = ""  # the damaged file is named on a line of its own
    if kind == "stored run" and file.read_bytes() != before and found.status == 0:
        wrong = "a changed run passes for sound"
    if not wrong and compared and found.status == 0:
        wrong = compare(home / f"sound-{kind}", folder / "out")
        if wrong:
            wrong = f"SILENT {wrong}"
    return found, f"{file.name} {changes!r}: {wrong}" if wrong else ""


def fork(kind: str, command: list[str], folder: Path, cpu_seconds: int) -> Attempt:
    if command:
        return attempt(list(command), folder, cpu_seconds=cpu_seconds, wall_seconds=WALL)
    import labsim.cli

    kept = labsim.cli.main
    labsim.cli.main = lambda arguments=None: read_stack(Path("stack.h5"))  # type: ignore[assignment]
    try:
        return attempt([], folder, cpu_seconds=cpu_seconds, wall_seconds=WALL)
    finally:
        labsim.cli.main = kept


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mutants", type=int, default=3000)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    load_labsim()
    whole = sum(KINDS[kind][4] for kind in given.kinds)
    failed = 0
    with tempfile.TemporaryDirectory(prefix="labsim-mutants-") as scratch:
        home = Path(scratch, "sound")
        home.mkdir()
        write_sound(home)
        print(
            f"{'kind':20} {'mutants':>7} {'result':>7} {'refused':>7} {'failed':>6} {'silent':>6}  most MiB  CPU s each"
        )
        for kind in given.kinds:
            number = round(given.mutants * KINDS[kind][4] / whole)
            counts: Counter[str] = Counter()
            peak, complaints = 0, []
            began = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu = check_sound(kind, home, Path(scratch, "case"))
            for k in range(number):
                chance = random.Random(f"{given.seed} {kind} {k}")
                found, wrong = try_mutant(kind, home, Path(scratch, "case"), chance, cpu)
                counts["result" if found.status in (0, 1) else "refused"] += 1
                counts["silent" if "SILENT" in wrong else "failed"] += bool(wrong)
                peak = max(peak, found.peak)
                if wrong:
                    complaints.append(f"    {k}: " + " ".join(wrong.split())[:700])
            failed += len(complaints)
            ended = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent = ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime
            print(
                f"{kind:20} {number:7} {counts['result']:7} {counts['refused']:7} {counts['failed']:6} "
                f"{counts['silent']:6}  {peak >> 20:8}  {spent / max(number, 1):8.2f}",
                flush=True,
            )
            for complaint in complaints:
                print(complaint, flush=True)
    sys.exit(1 if failed else 0)


def check_sound(kind: str, home: Path, folder: Path) -> float:
    """CPU time of the sound file [s]. It is taken, or its mutants would show nothing; its result is kept to compare with."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    source = home / KINDS[kind][0].split("/")[0]
    (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / source.name)
    found = fork(kind, KINDS[kind][1], folder, SOUND_CPU)
    assert found.status == 0 and not found.complaint(), (kind, found)
    if (folder / "out").is_dir():
        shutil.copytree(folder / "out", home / f"sound-{kind}")
    return found.cpu


if __name__ == "__main__":
    main()
