"""Error bars where neighbouring pixels err together: against scatter that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.truths.video import Recording, fall_and_stop, make_frames, render
from labsim.video import follow_projectile


@pytest.mark.parametrize(("size", "codec"), [(8, "mjpg"), (16, "h264")])
def test_noise_shared_in_blocks(monkeypatch, size, codec) -> None:
    """Blocks that err as a whole: the widening is measured from single frames, to 30 % of what the rows truly scatter."""
    from labsim.video.projectile import rod

    factors = []
    measure = rod.measure_widening
    monkeypatch.setattr(
        rod, "measure_widening", lambda *given: factors.append(measure(*given)) or factors[-1]
    )
    monkeypatch.setattr(rod, "raise_to_scatter", lambda row, sigma, *_: sigma)
    monkeypatch.setattr(rod, "compare_lengths", lambda *_: 1.0)
    monkeypatch.setattr(rod, "widen_for_hidden", lambda codec: 1.0)
    recording = Recording()
    depth, _ = fall_and_stop(90, 45.37, 2.3, 30.0)
    pictures, rows = render(recording, depth, 5)
    rng = np.random.default_rng(5)
    shared = rng.normal(0, 6.0, (len(pictures), -(-384 // size), -(-128 // size)))
    spoilt = [
        np.clip(p + np.kron(s, np.ones((size, size)))[:384, :128], 0, 255).round().astype(np.uint8)
        for p, s in zip(pictures, shared, strict=True)
    ]
    frames = replace(make_frames(spoilt), lossy=True, codec=codec)
    track = follow_projectile(frames, surface_row=recording.surface_row).track
    score = ((track.tip_row - rows) / track.sigma)[track.valid]
    assert min(factors) > 1.5
    assert 0.7 < np.std(score) < 1.3, np.std(score)
