"""Static strength tests with their curves, and the dynamic one beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...inference.fits.blocks import Block
from ...inference.fits.fitting import Fit
from ...inference.observations.static_tests import StaticTests, StrengthFit
from ...inference.problem import Problem
from ...records import Campaign
from ...sph.sirono import compressive_strength
from .style import BLUE, COLOURS, GREEN, GREY, INK, ORANGE, PURPLE, new_figure

LOOKS = {
    "compression_omnidirectional": ("compression from all sides", BLUE, "o"),
    "compression_unidirectional": ("compression along one direction", GREEN, "s"),
    "tension": ("tension", ORANGE, "v"),
    "shear": ("shear", PURPLE, "d"),
}


def draw_strength(
    campaign: Campaign, fits: Sequence[StrengthFit], path: Path, dynamic: float | None = None
) -> Path:
    """Stress against filling factor, logarithmic; dynamic : p_m (Pa) of the drops, whose Σ is drawn."""
    with new_figure(path) as figure:
        ax = figure.subplots()
        low, high = 1.0, 0.0
        for fit in fits:
            words, colour, sign = LOOKS[fit.kind]
            for test in (each for each in campaign.strength_tests if each.kind == fit.kind):
                phi, stress = np.array(test.points).T
                ax.errorbar(
                    phi, stress / 1e3, stress / 1e3 * test.relative_sigma, fmt=sign, color=colour, ms=4, lw=1
                )
                low, high = min(low, phi.min()), max(high, phi.max())
            phi = np.array([p for t in campaign.strength_tests if t.kind == fit.kind for p, _ in t.points])
            along = np.linspace(phi.min(), phi.max(), 200)
            ax.plot(along, fit.stress(along) / 1e3, color=colour, label=words)
        if dynamic is not None:
            along = np.linspace(low, high, 200)
            strength = compressive_strength(along, campaign.material.replace(p_m=dynamic))
            ax.plot(along, strength / 1e3, color=INK, ls="--", label="Σ of the drops")
        ax.axvline(campaign.sample.filling_factor, color=GREY, lw=0.8, ls=":")
        ax.annotate(
            "as prepared",
            (campaign.sample.filling_factor, 0.02),
            xycoords=("data", "axes fraction"),
            xytext=(4, 0),
            textcoords="offset points",
            color=GREY,
            fontsize=8.5,
        )
        ax.set(yscale="log", xlabel="filling factor φ", ylabel="stress, kPa")
        ax.legend()
    return path


def draw_tests(problem: Problem, fits: Sequence[tuple[str, Fit]], path: Path) -> Path:
    """Static tests beside the drops, a panel a test: stress against filling factor, measured and by the law of each fit."""
    tests, blocks = find_tests(problem, fits)
    assert tests is not None
    with new_figure(path, 3.4 * len(tests.tests) + 0.6, 3.2) as figure:
        panels = figure.subplots(1, len(tests.tests), squeeze=False)[0]
        at = 0
        for ax, test in zip(panels, tests.tests, strict=True):
            phi, stress = np.array(test.points).T
            order, own = np.argsort(phi), slice(at, at + phi.size)
            at = own.stop
            ax.errorbar(
                phi, stress / 1e3, stress / 1e3 * test.relative_sigma, fmt="o", color=INK, ms=3.5, lw=1, label="measured"
            )  # fmt: skip
            for (name, _), block, colour in zip(fits, blocks, COLOURS, strict=False):
                law = stress * np.exp(-block.residual[own])
                ax.plot(phi[order], law[order] / 1e3, color=colour, label=name.replace("_", " "))
            ax.set(yscale="log", xlabel="filling factor φ", ylabel="stress (kPa)", title=LOOKS[test.kind][0])
        panels[0].legend()
    return path


def find_tests(problem: Problem, fits: Sequence[tuple[str, Fit]]) -> tuple[StaticTests | None, list[Block]]:
    """The static tests that drops are compared with, none where there are none, and what each fit says of them: its residuals are
    ln of measured over the law's."""
    found = problem.find(StaticTests)
    if found is None:
        return None, []
    place, tests = found
    return tests, [fit.blocks[place] for _, fit in fits]
