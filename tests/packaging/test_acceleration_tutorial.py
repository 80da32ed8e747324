"""What `labsim check` prints on the page of the accelerometers' tutorial is what it says today."""

from __future__ import annotations

from pathlib import Path

import pytest

from labsim.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/acceleration-tutorial.md").read_text(encoding="utf-8")


def test_check_says_what_the_page_shows(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    with pytest.raises(SystemExit) as left:
        main(["check", "data/campaigns/f161"])
    assert left.value.code == 0
    shown = PAGE.split("labsim check data/campaigns/f161\n```")[1].split("\nThe depths")[0]
    assert [line.strip() for line in capsys.readouterr().out.splitlines() if line.strip()] == [
        line.strip() for line in shown.splitlines() if line.strip()
    ]
