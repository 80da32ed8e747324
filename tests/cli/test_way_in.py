"""The way in: help, completion, an empty campaign, what check says, how progress is shown."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from labsim.campaign import read_campaign
from labsim.cli import list_command_files, main, options
from labsim.cli import new as new_command

P01 = Path(__file__).parents[2] / "data" / "campaigns" / "p01"
P06 = P01.with_name("p06")
PUBLISHED = P01.parents[1] / "guettler2009"


def call(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(each) for each in arguments])
    return int(left.value.code or 0)


def run_labsim(*arguments: str, **variables: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "labsim", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, "COLUMNS": "80", "LINES": "24", "TERM": "dumb", **variables},
        timeout=60,
    )
    return done.stdout


def test_help_fits_a_screen() -> None:
    lines = run_labsim("--help").splitlines()
    assert len(lines) < 24, "a line is left for the prompt"
    assert all(len(line) <= 80 for line in lines)


@pytest.mark.parametrize("command", list_command_files())
def test_every_command_has_json_and_quiet(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(command, "--help") == 0
    shown = capsys.readouterr().out
    assert "--json" in shown and "--quiet" in shown


def test_the_shell_completes_commands_options_and_itself() -> None:
    script = run_labsim(_LABSIM_COMPLETE="source_bash")
    assert "complete -o default -F _labsim_completion labsim" in script
    found = run_labsim(_LABSIM_COMPLETE="complete_bash", COMP_WORDS="labsim di", COMP_CWORD="1")
    assert found.split() == ["diagnose"]
    found = run_labsim(_LABSIM_COMPLETE="complete_bash", COMP_WORDS="labsim calibrate --bulk", COMP_CWORD="2")
    assert found.split() == ["--bulk-modulus-Pa"]


def test_every_key_of_a_new_campaign_is_explained(tmp_path: Path) -> None:
    folder = tmp_path / 'a "new" series'
    assert call("new", folder, "-q") == 0
    for file, text in (
        ("campaign.toml", None),
        ("drops/D01/drop.toml", new_command.DROP),
        ("ct/C01/scan.toml", new_command.SCAN),
    ):
        written = (folder / file).read_text()
        tomllib.loads(written)
        assert text is None or written == text
        for line in written.splitlines():
            if re.match(r"\w+ = ", line):
                assert re.search(r"\s#\s+\S", line), f"{file}: {line}"
    # the examples that are commented out are as good as the others
    written = (folder / "campaign.toml").read_text()
    (folder / "campaign.toml").write_text(re.sub(r"(?m)^# (?=\[(?:model|source)|\w+ = )", "", written))
    rows = "".join(f"{k},{200 + 4 * k}\n" for k in range(60))
    (folder / "drops/D01/track.csv").write_text("frame,tip_row_px\n" + rows)
    (folder / "ct/C01/slices/0.tif").write_bytes(b"II*\0")
    read = read_campaign(folder)
    assert read.name == "a 'new' series" and len(read.drops) == 1 and len(read.scans) == 1


def test_json_of_new_is_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("new", tmp_path / "s", "--json") == 0
    assert json.loads(capsys.readouterr().out)["files"][0] == "campaign.toml"


def check(folder: Path, capsys: pytest.CaptureFixture[str], status: int = 0) -> dict:
    assert call("check", folder, "--json") == status
    return json.loads(capsys.readouterr().out)


def copy_drops(source: Path, target: Path, names: tuple[str, ...]) -> Path:
    for name in names:
        (target / "drops" / name).mkdir(parents=True)
        for file in (source / "drops" / name).iterdir():
            (target / "drops" / name / file.name).write_bytes(file.read_bytes())
    (target / "campaign.toml").write_bytes((source / "campaign.toml").read_bytes())
    return target


def test_a_sound_campaign_has_nothing_odd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = copy_drops(P01, tmp_path / "c", ("D03", "D07", "D13"))
    found = check(folder, capsys)
    assert found["warnings"] == []
    assert "nothing looks odd" in found["text"] and "no CT scan" in found["text"]
    assert found["measured"]["D03"]["apparent_gravity_m_s2"] == pytest.approx(9.81, rel=0.01)
    assert found["measured"]["D03"]["speed_over_free_fall"] == pytest.approx(1.0, abs=0.03)


def test_a_wrong_pixel_size_is_seen_by_gravity_and_height(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The campaign's pixels are 6 % larger than stated (data/campaigns/truth.json)."""
    found = check(copy_drops(P06, tmp_path / "c", ("D05", "D07", "D13", "D14")), capsys)
    together = next(line for line in found["warnings"] if line.startswith("both together"))
    pixel, rate = map(float, re.findall(r"([\d.]+) %", together))
    assert pixel == pytest.approx(106, abs=0.8) and rate == pytest.approx(100, abs=0.5)
    assert any("pixel_size_um" in line for line in found["warnings"])


def test_what_is_wrong_with_single_drops_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = copy_drops(P01, tmp_path / "c", ("D03", "D05", "D06", "D07"))
    drop = folder / "drops/D05/drop.toml"
    drop.write_text(re.sub(r"height_mm = .*", "height_mm = 40.0", drop.read_text(), count=1))
    track = folder / "drops/D06/track.csv"  # ten frames in the dust: no curve
    rows = track.read_text().splitlines()
    track.write_text("\n".join([rows[0], *rows[-10:]]) + "\n")
    found = check(folder, capsys, status=2)
    assert any(line.startswith("D05: ") and "40 mm of free fall" in line for line in found["warnings"])
    assert any(line.startswith("D06: ") and "trusted frames" in line for line in found["unreadable"])
    assert not any(line.startswith(("D03", "D07")) for line in found["warnings"])


def test_dust_that_is_not_as_stated_is_seen_in_the_scan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from benchmarks.truths.phantom import Phantom

    folder = copy_drops(P01, tmp_path / "c", ("D03",))
    phantom = Phantom(filling_factor=0.165)
    scan = phantom.write(folder / "ct/C01/slices")
    text = new_command.SCAN.replace("radius_mm = 0.5", f"radius_mm = {scan.projectile.tip_radius * 1e3}")
    text = text.replace("mass_mg = 1.33", f"mass_mg = {scan.projectile.mass * 1e6}").replace(
        "bits = 8", "bits = 16"
    )
    text = text.replace("voxel_um = 40.0", "voxel_um = 37.0")
    text = text.replace("grey_air = 12.0", f"grey_air = {phantom.calibration.grey_air}")
    text = text.replace("density = 0.16", f"density = {phantom.calibration.grey_per_density}")
    (folder / "ct/C01/scan.toml").write_text(text)
    found = check(folder, capsys)
    odd = [line for line in found["warnings"] if line.startswith("C01")]
    assert any("0.165" in line and "states 0.15" in line for line in odd)


def test_published_figures_are_checked_without_tracks(capsys: pytest.CaptureFixture[str]) -> None:
    found = check(PUBLISHED, capsys)
    assert found["warnings"] == [] and "published figures" in found["text"]


def test_progress_in_a_log_tells_runs_done_and_time_left(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter(np.arange(0.0, 1000.0, 20.0))
    monkeypatch.setattr(options.time, "monotonic", lambda: float(next(clock)))
    with options.show_progress(quiet=False, stages=options.DIAGNOSE) as progress:
        progress(0, 0, "nominal model, the solver is compiled first, once on a machine")
        for done in (0, 3, 5, 8, 10):
            progress(done, 10, "what each cause changes, 4 new")
        progress(1, 1, "pore_gas@0.3")
        for _ in range(3):
            progress(1, 1, "sampling the posterior")
        progress(1, 1, "a formula")
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "stage 1 of 4, nominal model, the solver is compiled first, once on a machine",
        "stage 2 of 4, what each cause changes, 0 of 4 runs, 0 %",
        "stage 2 of 4, what each cause changes, 2 of 4 runs, 50 %, elapsed 80 s, about 40 s left",
        "stage 2 of 4, what each cause changes, 4 of 4 runs, 100 %, elapsed 2 min",
        "stage 3 of 4, pore_gas, 100 %",
        "stage 4 of 4, sampling the posterior, 100 %",
        "stage 4 of 4, a formula, 100 %",
    ]
    assert not any("\x1b" in line for line in lines)


def test_progress_in_a_log_promises_nothing_before_it_knows(capsys: pytest.CaptureFixture[str]) -> None:
    """The first call comes after the first piece of work: how long that took is not known."""
    with options.show_progress(quiet=False) as progress:
        progress(1, 300, "looking for what moves")
    assert capsys.readouterr().err == "looking for what moves, 0 %\n"


def test_progress_is_silent_when_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    with options.show_progress(quiet=True) as progress:
        progress(1, 2, "work")
    captured = capsys.readouterr()
    assert captured.err == captured.out == ""


def test_progress_on_a_terminal_shows_stage_runs_and_time() -> None:
    """A pseudo-terminal: the bar names the stage, the runs done of all, and the time left."""
    pty = pytest.importorskip("pty")
    code = (
        "import time\nfrom labsim.cli.options import show_progress\n"
        "with show_progress(False) as p:\n"
        "    for k in range(5):\n        p(k, 4, 'fingerprints, 4 new'); time.sleep(0.25)\n"
    )
    parent, child = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    process = subprocess.Popen([sys.executable, "-c", code], stderr=child, env=environment)
    os.close(child)
    said = b""
    while True:
        try:
            piece = os.read(parent, 65536)
        except OSError:
            break
        if not piece:
            break
        said += piece
    assert process.wait(timeout=30) == 0
    text = said.decode()
    assert "fingerprints, 2 of 4 runs" in text and "left" in text and "50%" in text


@pytest.mark.parametrize(("seconds", "said"), [(45, "45 s"), (600, "10 min"), (9000, "2.5 h")])
def test_time_in_words(seconds: float, said: str) -> None:
    assert options.say_time(seconds) == said
