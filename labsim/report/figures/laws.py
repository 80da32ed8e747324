"""The free law of an unknown cause, drawn with its band and the formula that was learned: static and to hover over."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from ...diagnosis.unlisted.free_law import RecoveredLaw
from ...diagnosis.unlisted.learned_law import Formula
from ...records import FloatArray
from .interactive import MARGIN, Spec
from .style import BLUE, INK, ORANGE, new_figure

POINTS = 121
WIDEST = 30  # characters of a line beside the height of a figure


def trace_law(law: RecoveredLaw) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places over what the data reach, the law there and its standard deviation, as they are shown (strength in %)."""
    low, high = law.law.reach
    place = np.unique(
        np.concatenate([np.linspace(low, high, POINTS), [k for k in law.law.grid if low <= k <= high]])
    )
    mean, sigma = law.at(place)
    factor = law.law.place.factor
    return place, factor * mean, factor * sigma


def trace_formula(
    law: RecoveredLaw, formula: Formula | None, place: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """What a formula adds at this place in the equations and its standard deviation, as they are shown; None where it adds
    nothing there."""
    found = formula.trace(law.law, place) if formula is not None else None
    factor = law.law.place.factor
    return found and (factor * found[0], factor * found[1])


def draw_laws(laws: Sequence[RecoveredLaw], path: Path, formula: Formula | None = None) -> Path:
    """A panel a law: its mean with the band of 68 %, its knots marked, and the formula that was learned, dashed,
    with a band of its own."""
    with new_figure(path, max(3.4 * len(laws), 5.0), 3.2) as figure:
        for ax, law in zip(np.atleast_1d(figure.subplots(1, len(laws))), laws, strict=True):
            place, mean, sigma = trace_law(law)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.fill_between(place, mean - sigma, mean + sigma, color=BLUE, alpha=0.25, lw=0)
            ax.plot(place, mean, color=BLUE)
            shown = [k for k in law.law.knots if place[0] <= k <= place[-1]]
            ax.plot(shown, np.interp(shown, place, mean), "o", color=BLUE, ms=4)
            learned = trace_formula(law, formula, place)
            if learned is not None:
                value, error = learned
                ax.fill_between(place, value - error, value + error, color=ORANGE, alpha=0.2, lw=0)
                ax.plot(place, value, "--", color=ORANGE, label="formula")
                ax.legend(frameon=False)
            along, up = law.law.place.axes
            ax.set_xlabel(along)
            ax.set_ylabel("\n".join(wrap(up, WIDEST)))
    return path


def plot_law(law: RecoveredLaw, formula: Formula | None = None) -> Spec:
    """The same, for the page."""
    place, mean, sigma = trace_law(law)
    around = np.concatenate([place, place[::-1]])
    band = np.concatenate([mean + sigma, (mean - sigma)[::-1]])
    digits = ".1f"
    data = [
        {
            "type": "scatter", "x": around, "y": band, "fill": "toself", "mode": "none", "line": {"width": 0},
            "hoverinfo": "skip", "meta": "band",
        },
        {
            "type": "scatter", "mode": "lines", "x": place, "y": mean, "meta": "extended", "name": law.law.name,
            "line": {"width": 1.8}, "customdata": sigma, "hovertemplate": f"%{{y:{digits}}} ± %{{customdata:{digits}}}",
        },
    ]  # fmt: skip
    learned = trace_formula(law, formula, place)
    if learned is not None:
        value, error = learned
        data.append(
            {
                "type": "scatter", "x": around, "y": np.concatenate([value + error, (value - error)[::-1]]), "fill": "toself",
                "mode": "none", "line": {"width": 0}, "hoverinfo": "skip", "meta": "noise",
            }
        )  # fmt: skip
        data.append(
            {
                "type": "scatter", "mode": "lines", "x": place, "y": value, "meta": "nominal", "name": "formula",
                "line": {"width": 1.8, "dash": "dash"}, "customdata": error,
                "hovertemplate": f"%{{y:{digits}}} ± %{{customdata:{digits}}}",
            }
        )  # fmt: skip
    along, up = law.law.place.axes
    layout = {
        "height": 280,
        "margin": MARGIN | {"t": 8},
        "showlegend": False,
        "hovermode": "x unified",
        "xaxis": {"title": {"text": along}, "zeroline": False, "hoverformat": ".3g"},
        "yaxis": {"title": {"text": "<br>".join(wrap(up, WIDEST))}, "zeroline": True},
    }
    return {"data": data, "layout": layout}
