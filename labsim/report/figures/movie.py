"""A run as a movie: the filling factor around the projectile from contact to the stop."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ...records import FloatArray
from ...sph import DropRun, particles
from ...sph.drop import evolve, start_body
from ...video.overlay import write_movie
from .runs import fill_density_field
from .style import STYLE

PICTURES = 60


def draw_movie(run: DropRun, path: Path) -> Path:
    """run.mp4. A stored run holds the dust at the stop only, so the drop is simulated once more for this."""
    setting = run.setting
    dust, wall = particles.place_particles(setting)
    body = start_body(setting)
    seen: list[tuple[float, float, FloatArray]] = []
    kept = [particles.X, particles.Z, particles.DENSITY]

    def watch(time: float, state: FloatArray) -> None:
        if time >= len(seen) * run.stopping_time / PICTURES:
            seen.append((time, -float(body[0]), state[kept].copy()))

    evolve(setting, dust, wall, body, watch)
    return write_movie(_draw(run, seen), path)


def _draw(run: DropRun, seen: list[tuple[float, float, FloatArray]]) -> Iterator[npt.NDArray[np.uint8]]:
    for time, depth, (x, z, density) in seen:
        with rc_context(STYLE):
            figure = Figure(figsize=(6.8, 4.4), layout="constrained")
            canvas = FigureCanvasAgg(figure)
            fill_density_field(
                figure,
                run.setting,
                (x, z, density / run.setting.monomer_density),
                depth,
                run.penetration_depth,
                f"{time * 1e3:.2f} ms",
            )
            canvas.draw()
            picture = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        yield picture
