"""Mutated input: every mutant gives one line of error, or a result; never a traceback, a hang, a stray file, 2 GB.

LABSIM_MUTANTS=1000 pytest tests/faults/test_mutants.py        the nightly number; 100 without it
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from attempts import attempt
from campaign_files import write_scan_of
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from mutations import change_bytes, change_file, change_json
from small_campaign import copy_campaign

import labsim
from benchmarks.truths.phantom import Phantom
from benchmarks.truths.video import Recording, fall_and_stop, render, write_video
from labsim.effects import list_effects
from labsim.records import Material, Projectile
from labsim.runs.store import RunStore, require_runs
from labsim.sph import DropSetting

TOTAL = int(os.environ.get("LABSIM_MUTANTS", "100"))
SHARES = {
    "campaign": 0.34,
    "track": 0.12,
    "video": 0.10,
    "slices": 0.08,
    "log": 0.05,
    "store": 0.15,
    "model": 0.10,
    "made_by": 0.06,
}
counts: Counter[tuple[str, int]] = Counter()
QUICK = "--geometry planar --set material.bulk_modulus_Pa=4500 --spacing-um 125 --speed-m-s 0.3".split()
SHORT = ["--time-ms", "0.01"]

NASTY = st.sampled_from(
    [
        "nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "1e-308", "9223372036854775807", "1e4", "0.001", "true", '""',
        '"../../outside/evil"', '"/outside/evil"', '"."', '".."', '"\\u0000"', '"track.csv"', '"none"', "[]", "[1.0]",
        "[nan, inf]", "[6000.0, 300.0]", "{}", "{ a = 1 }", "1979-05-27", '"' + "x" * 5000 + '"', '"ä\\n"', "[[[[]]]]",
    ]
)  # fmt: skip
EVIL = st.sampled_from(
    [
        None, True, -1, 1e308, float("nan"), "", ".", "../outside", "/", "\0", "x" * 5000, "ä\n", [], {}, [[]], ["a"],
        {"/": "a"}, {"a": 1}, ["labsim", "new", "evil"], ["labsim", "rerun", "result"], ["labsim", "--version"],
        ["labsim", "runs", "prune", "--everything"], ["labsim", "simulate", "-oevil"], ["labsim", "calibrate", "/"],
        "--out=evil", "--store=evil", "-oevil", "--workers", "--spacings",
    ]
)  # fmt: skip
PLACE = st.floats(0.0, 1.0, exclude_max=True)
BYTES = st.lists(
    st.tuples(st.sampled_from(["flip", "cut", "repeat", "drop", "insert", "zero"]), PLACE, st.binary(min_size=1, max_size=8)),
    min_size=1,
    max_size=4,
)  # fmt: skip
TEXT = st.one_of(
    st.tuples(st.just("value"), PLACE, NASTY),
    st.tuples(st.just("key"), PLACE, st.sampled_from(["format", "x", "é", "file", '"a b"'])),
    st.tuples(st.just("without"), PLACE, st.just("")),
    st.tuples(st.just("twice"), PLACE, st.just("")),
    st.tuples(st.just("field"), PLACE, st.sampled_from(["", "nan", "inf", "1e400", "-5", "abc", "1,2", "0x10", "１２", '"'])),
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def loaded() -> None:
    """All of labsim, once here instead of in each forked command; that a command loads what it needs, tests/cli shows."""
    for module in pkgutil.walk_packages(labsim.__path__, "labsim."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sound input of every kind, small."""
    home = tmp_path_factory.mktemp("sound")
    campaign = copy_campaign(home / "campaign")
    phantom = Phantom(shape=(64, 56, 56), centre=(28.3, 27.6, 26.4), radius=7.5, surface=16.0)
    scan = campaign / "ct" / "C01"
    write_scan_of(phantom, scan)
    (scan / "slices" / "scan_rec.log").write_text(
        "[System]\nScanner=SkyScan1172\n[Acquisition]\nImage Pixel Size (um)=37.0\n[Reconstruction]\n"
        "Pixel Size (um)=37.0\nSections Count=64\nResult Image Width (pixels)=56\nResult Image Height (pixels)=56\n"
    )
    depth, _ = fall_and_stop(30, 12.3, 2.5, 15.0)
    recording = Recording(shape=(140, 64), width=20.0, length=50.0, surface_row=100.0, column=31.0)
    pictures, _ = render(recording, depth)
    write_video(pictures, home / "video.avi", "MJPG")
    cylinder = Projectile(tip="cylinder", tip_radius=5e-4, mass=2e-3)
    setting = DropSetting(
        cylinder,
        0.3,
        Material(bulk_modulus=4500.0),
        geometry="planar",
        spacing=1.25e-4,
        width=4e-3,
        depth=2e-3,
        gravity=0.0,
        after_stop=0.0,
    )
    require_runs(RunStore(home / "store").get_many([setting], workers=1))
    effect = next(
        e for e in list_effects().values() if e.change_setting is not None and len(e.amplitudes) == 1
    )
    parameter = effect.amplitudes[0]
    (home / "model.toml").write_text(
        f"format = 1\n\n[material]\np_m_Pa = 1300.0\ndelta = 0.58\n\n[effects.{effect.name}]\n"
        f"{parameter.name} = {parameter.null + parameter.step!r}\n"
    )
    (home / "result").mkdir()
    made = attempt(["simulate", *QUICK, *SHORT, "-o", home / "result", "--quiet"], home / "result", "")
    assert made.status == 0, made.said
    return home


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LABSIM_STORE", str(tmp_path / "out-store"))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    return tmp_path


def fresh(root: Path, source: Path, name: str) -> Path:
    """A folder of its own with a copy of some sound input."""
    folder = root / "case"
    shutil.rmtree(folder, ignore_errors=True)
    (folder / name).parent.mkdir(parents=True)
    (shutil.copytree if source.is_dir() else shutil.copy)(source, folder / name)
    return folder


def mutants(kind: str, *strategies: st.SearchStrategy) -> Callable:
    """As many examples as this kind's share of all."""
    number = max(3, round(SHARES[kind] * TOTAL))
    limits = settings(
        max_examples=number,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    return lambda test: limits(given(*strategies)(test))


def judge(kind: str, found, mutant: object) -> None:  # type: ignore[no-untyped-def]
    counts[kind, found.status] += 1
    log = os.environ.get("LABSIM_MUTANT_LOG")
    complaint = found.complaint()
    if log:  # go on after a failure, and tell all of them
        with open(log, "a") as stream:
            stream.write(f"{kind} {found.status} {found.peak >> 20} MiB {found.said.strip()[:200]!r}\n")
            if complaint:
                stream.write(f"== {mutant!r}\n{complaint}\n")
        return
    assert not complaint, f"{mutant!r}: {complaint}"


def test_the_sound_input_is_taken(inputs: Path, root: Path) -> None:
    """Or the mutants of it would show nothing."""
    for source, name, arguments in (
        ("campaign", "campaign", ["check", "campaign", "-q"]),
        ("campaign/drops/D05", "drop", ["track", "drop", "-o", "out", "-q"]),
        (
            "video.avi",
            "in/video.avi",
            ["track", "in/video.avi", "-o", "out", "-q", "--fps", "5000", "--pixel-um", "40"],
        ),
        ("campaign/ct/C01", "scan", ["ct", "scan", "-o", "out", "-q"]),
        ("store", "store", ["runs", "verify", "--store", "store", "-q"]),
        (
            "model.toml",
            "model.toml",
            ["simulate", *QUICK, *SHORT, "--model", "model.toml", "-o", "out", "-q"],
        ),
        ("result", "result", ["rerun", "result", "-o", "out", "-q"]),
    ):
        found = attempt(arguments, fresh(root, inputs / source, name))
        assert found.status == 0 and not found.complaint(), (name, found)


CAMPAIGN_FILES = (
    "campaign.toml",
    "drops/D05/drop.toml",
    "drops/D06/drop.toml",
    "ct/C01/scan.toml",
    "drops/D05/track.csv",
)


def test_campaigns(inputs: Path, root: Path) -> None:
    @mutants(
        "campaign", st.sampled_from(CAMPAIGN_FILES), st.lists(st.one_of(TEXT, BYTES), min_size=1, max_size=3)
    )
    def run(name: str, changes: list) -> None:
        folder = fresh(root, inputs / "campaign", "campaign")
        for change in changes:
            change_file(folder / "campaign" / name, change)
        judge("campaign", attempt(["check", "campaign", "--quiet"], folder), (name, changes))

    run()


# kind -> sound input, its name in the folder of the case, the file that is changed, the command
TEXTS = {
    "track": ("campaign/drops/D05", "drop", "drop/track.csv", ["track", "drop", "-o", "out", "--quiet"]),
    "log": ("campaign/ct/C01", "scan", "scan/slices/scan_rec.log", ["ct", "scan", "-o", "out", "--quiet"]),
    "model": (
        "model.toml",
        "model.toml",
        "model.toml",
        ["simulate", *QUICK, *SHORT, "--model", "model.toml", "-o", "out", "--store", "out/store", "--quiet"],
    ),
    # run.json, from which rerun takes a command to run
    "made_by": ("result", "result", "result/run.json", ["rerun", "result", "-o", "out", "--quiet"]),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_one_text_file(kind: str, inputs: Path, root: Path) -> None:
    source, name, file, arguments = TEXTS[kind]

    @mutants(kind, st.lists(st.one_of(TEXT, BYTES), min_size=1, max_size=3))
    def run(changes: list) -> None:
        folder = fresh(root, inputs / source, name)
        for change in changes:
            change_file(folder / file, change)
        found = attempt(arguments, folder)
        if kind == "made_by" and found.status == 1:  # different, and says so
            assert "Traceback" not in found.said and not found.strays
            counts[kind, 1] += 1
        else:
            judge(kind, found, changes)

    run()


def test_what_a_summary_says_it_was_made_by(inputs: Path, root: Path) -> None:
    """rerun repeats a command that it reads from a file: only what writes into its output folder."""

    @mutants(
        "made_by",
        st.lists(
            st.tuples(st.sampled_from(["value", "without", "added"]), PLACE, EVIL), min_size=1, max_size=2
        ),
    )
    def run(changes: list) -> None:
        folder = fresh(root, inputs / "result", "result")
        file = folder / "result" / "run.json"
        file.write_text(change_json(file.read_text(), changes))
        found = attempt(["rerun", "result", "-o", "out", "--quiet"], folder)
        if found.status == 1:  # different, and says so
            assert "Traceback" not in found.said and not found.strays, (changes, found)
            counts["made_by", 1] += 1
        else:
            judge("made_by", found, changes)

    run()


def test_videos(inputs: Path, root: Path) -> None:
    @mutants("video", BYTES, st.booleans())
    def run(changes: list, head: bool) -> None:
        folder = fresh(root, inputs / "video.avi", "in/video.avi")
        content = (folder / "in/video.avi").read_bytes()
        cut = 300 if head else 0  # half of them hit the header, where the sizes are
        made = (
            change_bytes(content[:cut], changes) + content[cut:] if head else change_bytes(content, changes)
        )
        (folder / "in/video.avi").write_bytes(made)
        arguments = ["track", "in/video.avi", "-o", "out", "--quiet", "--fps", "5000", "--pixel-um", "40"]
        judge("video", attempt(arguments, folder), (changes, head))

    run()


def test_slices(inputs: Path, root: Path) -> None:
    @mutants("slices", st.integers(0, 39), BYTES, st.booleans())
    def run(number: int, changes: list, head: bool) -> None:
        folder = fresh(root, inputs / "campaign" / "ct" / "C01", "scan")
        files = sorted((folder / "scan" / "slices").glob("*.tif"))
        content = files[number % len(files)].read_bytes()
        made = (
            change_bytes(content[:400], changes) + content[400:] if head else change_bytes(content, changes)
        )
        files[number % len(files)].write_bytes(made)
        judge("slices", attempt(["ct", "scan", "-o", "out", "--quiet"], folder), (number, changes, head))

    run()


def test_stores(inputs: Path, root: Path) -> None:
    """Verified, and read back by the command that would use it: the same numbers, from a sound file or a new run."""
    sound = next((inputs / "store").glob("??/*.h5"))
    content = sound.read_bytes()

    @mutants("store", BYTES)
    def run(changes: list) -> None:
        folder = fresh(root, inputs / "store", "store")
        file = folder / "store" / sound.relative_to(inputs / "store")
        file.write_bytes(change_bytes(content, changes))
        found = attempt(["runs", "verify", "--store", "store", "--quiet"], folder, "store")
        if file.read_bytes() != content:
            said = [line for line in found.said.splitlines() if line.startswith("error: ")]
            assert found.status == 2 and len(said) == 1, (changes, found.said)
            assert "Traceback" not in found.said
            counts["store", 2] += 1
        else:
            judge("store", found, changes)

    run()


@pytest.mark.parametrize("target", ["../../outside", "/etc/hostname", "link", "loop", "folder"])
def test_paths_that_lead_elsewhere(inputs: Path, root: Path, target: str) -> None:
    """Records named with .., absolute, through links and loops: read or refused, and nothing is written there."""
    folder = fresh(root, inputs / "campaign", "campaign")
    (folder / "outside").write_text("frame,tip_row_px\n0,1\n")
    drop = folder / "campaign" / "drops" / "D05"
    if target == "link":
        (drop / "track.csv").unlink()
        (drop / "track.csv").symlink_to(folder / "outside")
    elif target == "loop":
        (folder / "campaign" / "drops" / "D07").symlink_to(
            folder / "campaign" / "drops", target_is_directory=True
        )
    else:
        text = (drop / "drop.toml").read_text()
        value = {"folder": "."}.get(target, target)
        (drop / "drop.toml").write_text(text.replace('"track.csv"', f'"{value}"'))
    for arguments in (["check", "campaign", "-q"], ["track", "campaign/drops/D05", "-o", "out", "-q"]):
        judge("campaign", attempt(arguments, folder), target)


@pytest.mark.parametrize("name", ["-D05", "D 05", "D\n05", "ü" * 60, "$(touch evil)", "a;b", "%2e%2e"])
def test_names_are_only_names(inputs: Path, root: Path, name: str) -> None:
    folder = fresh(root, inputs / "campaign", "campaign")
    (folder / "campaign" / "drops" / "D05").rename(folder / "campaign" / "drops" / name)
    shutil.rmtree(folder / "campaign" / "drops" / "D06")
    judge("campaign", attempt(["track", "campaign", "-o", "out", "--workers", "1", "-q"], folder), name)
    assert all((folder / "out") in path.parents for path in (folder / "out").rglob("*"))


@pytest.mark.parametrize("where", ["campaign/out", "link/out", "campaign/../campaign/drops/out"])
def test_output_never_goes_into_a_campaign(inputs: Path, root: Path, where: str) -> None:
    folder = fresh(root, inputs / "campaign", "campaign")
    (folder / "link").symlink_to(folder / "campaign", target_is_directory=True)
    found = attempt(["track", "campaign", "-o", where, "-q"], folder)
    assert found.status == 2 and "--out" in found.said and not found.strays


@pytest.fixture(scope="module", autouse=True)
def tell_counts() -> Iterator[None]:
    yield
    total = sum(counts.values())
    table = {kind: {status: n for (k, status), n in sorted(counts.items()) if k == kind} for kind in SHARES}
    print(f"\n{total} mutants, by kind and exit status: {json.dumps(table)}")
