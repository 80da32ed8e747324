"""The look of all pictures: ink and colours that stay apart for colour-blind eyes and in grey."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ...records import FloatArray
from .formats import further_formats

INK, BLUE, ORANGE, GREEN, PURPLE, GREY = "#222222", "#0072B2", "#D55E00", "#009E73", "#8E4A9E", "#8A8A8A"
COLOURS = (ORANGE, BLUE)  # nominal, extended
# filling factor of dust, measured and simulated alike, so that pictures can be compared by eye
PHI: dict[str, Any] = {"cmap": "viridis", "vmin": 0.12, "vmax": 0.30}
STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "figure.dpi": 110,
    "savefig.dpi": 150,
    "lines.linewidth": 1.6,
    "pdf.fonttype": 42,  # letters stay letters, which a journal asks for
    "svg.fonttype": "none",
    "svg.hashsalt": "labsim",
}
DATE = {"pdf": "CreationDate", "svg": "Date"}


@contextmanager
def new_figure(
    path: Path, width: float = 6.4, height: float = 4.4, layout: str | None = "constrained"
) -> Iterator[Figure]:
    """A figure in labsim's look, written to ``path`` and, beside it, in the further formats that were asked for.

    It belongs to no window: what shows pictures in a notebook or on a screen stays as it was.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout=layout)  # type: ignore[arg-type]
        yield figure
        figure.savefig(path)
        for suffix in further_formats.get():
            # without the date: the same result is the same file
            figure.savefig(path.with_suffix(f".{suffix}"), metadata={DATE[suffix]: None})


@contextmanager
def new_corner(path: Path, values: FloatArray, **options: Any) -> Iterator[Figure]:
    """A new picture of samples (n, k), each against each; options : of ``corner.corner``."""
    from ...inference.fits.posterior import import_arviz  # pictures without samples need neither

    import_arviz()  # which corner imports
    import corner

    side = 2.1 * values.shape[1] + 1.3
    with new_figure(path, side, side, layout=None) as figure:
        corner.corner(values, fig=figure, color=BLUE, show_titles=True, **options)
        yield figure
