"""The tips in their folder, and what nominal dust does to each when it is pushed in at constant speed.

python -m benchmarks.solver.draw_tips -o docs/pictures/tips.png [--cells 6]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from labsim.records import Material, Motion, Projectile
from labsim.report.figures.style import new_figure
from labsim.sph import DropSetting, simulate
from labsim.sph.profile import outline
from labsim.sph.setting import base_area
from labsim.sph.tips import find_tip, list_tips, make_profile

RADIUS, END, SPEED = 5e-4, 1.5e-3, 0.3  # m, m, m/s


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--cells", type=int, default=6)
    given = parser.parse_args()
    tips = [tip for tip in list_tips() if not hasattr(find_tip(tip), "GEOMETRIES")]
    with new_figure(given.output, 9.0, 3.6) as figure:
        shapes, curves = figure.subplots(1, 2, width_ratios=(1.5, 1))
        for number, tip in enumerate(tips):
            projectile = Projectile(tip, RADIUS, 1e-6)
            r, z = outline(make_profile(projectile), 3.5 * RADIUS)
            x = np.concatenate([-r[::-1], r]) / RADIUS + 2.6 * number
            (line,) = shapes.plot(x, np.concatenate([z[::-1], z]) / RADIUS)
            shapes.text(2.6 * number, -0.5, tip, ha="center", color=line.get_color())
            setting = DropSetting(
                projectile,
                1.0,
                Material(),
                spacing=RADIUS / given.cells,
                motion=Motion("pushed", values=(("speed", SPEED), ("end_depth", END))),
            )
            run = simulate(setting)
            curves.plot(
                run.depth * 1e3, run.force / base_area(setting) / 1e3, color=line.get_color(), label=tip
            )
            print(
                f"{tip}: {run.force[run.depth > END - 1e-4].mean() / base_area(setting):.0f} Pa at the end, energy "
                f"{run.energy_error:+.2%}, contact {run.energy_share('contact'):+.2%}, viscosity {run.viscous_share:.1%}"
            )
        shapes.set(aspect="equal", xticks=[], ylabel="height (tip radii)")
        shapes.set_ylim(-0.8, 3.6)
        curves.set(xlabel="depth of the tip (mm)", ylabel="force over section (kPa)")
        curves.legend()


if __name__ == "__main__":
    main()
