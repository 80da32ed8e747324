"""What moves the projectile: books of a push, a path that is followed, a start in the dust, whose runs are shared."""

import math

import numpy as np
import pytest

from labsim.errors import SimulationError
from labsim.records import Material, Motion, Projectile
from labsim.runs.run_file import make_key, read_run_file, say_setting, write_run_file
from labsim.sph import DropSetting, check_setting, simulate
from labsim.sph.bodies import elastic_material
from labsim.sph.motions import list_motions, make_path
from labsim.sph.particles import place_particles
from labsim.sph.profile import measure_distance, volume_below
from labsim.sph.tips import make_profile

RADIUS = 5e-4


def a_push(tip="cone", motion=None, **changes):
    motion = motion or Motion("pushed", values=(("speed", 0.3), ("end_depth", 1.2e-3)))
    values = {"impact_speed": 1.0, "material": Material(), "spacing": RADIUS / 5, "motion": motion}
    return DropSetting(Projectile(tip, RADIUS, 1e-6), **(values | changes))


@pytest.fixture(scope="module")
def push():
    return simulate(a_push())


def test_motions_of_this_day():
    assert list_motions() == ["free", "prescribed", "pushed"]


def test_a_push_goes_on_at_its_speed_to_its_depth(push):
    assert push.stopped and push.warnings == ()
    np.testing.assert_allclose(push.depth, np.minimum(0.3 * push.time, 1.2e-3), atol=1e-15)
    assert push.penetration_depth == push.depth[-1] == 1.2e-3
    assert push.stopping_time == pytest.approx(4e-3, abs=2e-5)
    np.testing.assert_allclose(push.velocity[:-1], 0.3, rtol=1e-9)


def test_the_book_of_a_push_holds_the_work_of_its_driver(push):
    """Work is force times way; all of it is found again in the dust, and none of it depends on how heavy the projectile is."""
    print({name: round(energy / push.energies["driver"], 5) for name, energy in push.energies.items()})
    assert push.energies["driver"] == pytest.approx(np.trapezoid(push.force, push.depth), rel=0.01)
    assert abs(push.energy_error) < 0.01
    assert abs(push.momentum_error) < 1e-12
    assert push.energies["plastic"] > 0.8 * push.energies["driver"]
    assert push.energies["kinetic_at_contact"] == 0.0
    heavy = simulate(a_push().replace(projectile=Projectile("cone", RADIUS, 1e-3)))
    assert np.array_equal(heavy.force, push.force) and heavy.energies == push.energies


def test_a_path_there_and_back():
    """The tip is where the table says; the way back costs little, and the run does not end at the turn."""
    table = ((0.0, 0.0), (1.5e-3, 6e-4), (2.5e-3, 3e-4), (3.0e-3, 3e-4))
    run = simulate(a_push("hemisphere", Motion("prescribed", table=table)))
    time, depth = np.transpose(table)
    np.testing.assert_allclose(run.depth, np.interp(run.time, time, depth), atol=1e-15)
    assert run.stopped and run.stopping_time == pytest.approx(3e-3, abs=2e-5)
    assert run.penetration_depth == 3e-4
    back = (run.time > 1.6e-3) & (run.time < 2.5e-3)
    assert run.force[back].mean() < 0.2 * run.force[~back].max()
    assert abs(run.energy_error) < 0.01 and abs(run.momentum_error) < 1e-12


def test_a_push_that_has_no_time_to_end_says_so():
    run = simulate(a_push(duration=5e-4))
    assert not run.stopped
    assert "did not reach the end of its path within 0.5 ms" in run.warnings


@pytest.mark.parametrize("tip", ["cone", "sphere"])
def test_held_in_a_heavy_liquid_it_is_lighter_by_what_it_displaces(tip):
    """Archimedes: dust that bears next to no shear, under a hundred times its weight so that settling is small beside it."""
    start, gravity, duration = 1.5e-3, 1000.0, 1.2e-2
    held = Motion("prescribed", start, table=((0.0, start), (duration, start)))
    dust = elastic_material(45e3, 1e-3)
    run = simulate(
        a_push(
            tip, held, material=dust, gravity=gravity, spacing=RADIUS / 8, width=3 * RADIUS, depth=7 * RADIUS
        )
    )
    profile = make_profile(run.setting.projectile)
    weight = 0.15 * 2000.0 * gravity * volume_below(profile, start)
    lift = run.force[run.time > duration / 2].mean()
    print(f"{tip}: lift {lift / weight:.4f} of the weight of the displaced dust")
    assert lift == pytest.approx(weight, rel=0.04)


def test_dust_around_an_embedded_tip_starts_at_rest_with_none_in_it():
    setting = a_push(motion=Motion("pushed", 1e-3, (("end_depth", 1.2e-3),)))
    dust, wall = place_particles(setting)
    whole, _ = place_particles(a_push())
    profile = make_profile(setting.projectile)
    assert np.all(measure_distance(dust[0], dust[1], -1e-3, profile) > 0.0)
    assert dust.shape[1] == wall.size < whole.shape[1]
    kept = measure_distance(whole[0], whole[1], -1e-3, profile) > 0.0
    assert np.array_equal(dust, whole[:, kept])
    ring = 2 * math.pi * whole[0] * setting.spacing**2
    assert ring[~kept].sum() == pytest.approx(volume_below(profile, 1e-3), rel=0.05)


def test_a_push_from_below_meets_what_a_push_from_above_meets(push):
    """The cone that starts in the dust has nothing compacted before it; half its radius later that is made up for."""
    deep = simulate(a_push(motion=Motion("pushed", 6e-4, (("speed", 0.3), ("end_depth", 1.2e-3)))))
    force = [run.force[run.depth > 1.1e-3].mean() for run in (push, deep)]
    print(f"force at 1.1 to 1.2 mm: {force[0]:.3e} N from the surface, {force[1]:.3e} N from 0.6 mm")
    assert deep.time[0] == 0.0 and deep.depth[0] == 6e-4
    assert force[1] == pytest.approx(force[0], rel=0.15)


def test_two_motions_do_not_share_their_runs():
    def key(*values, kind="pushed", start=0.0, **changes):
        return make_key(a_push(motion=Motion(kind, start, values), **changes))

    usual = key(("speed", 0.3))
    others = [
        key(("speed", 0.2)),
        key(("speed", 0.3), ("end_depth", 1e-3)),
        key(("speed", 0.3), start=1e-3),
        key(kind="free"),
    ]
    assert len({usual, *others}) == 5
    assert usual == key(("speed", 0.3), ("end_depth", 2e-3))  # its default, written out
    assert usual == key(("speed", 0.3), impact_speed=0.5)  # a led projectile has the speed of its path
    assert key(kind="free") != key(kind="free", impact_speed=0.5)


def test_a_push_comes_back_from_its_file(push, tmp_path):
    again = read_run_file(write_run_file(tmp_path / "run.h5", push))
    assert again.setting == push.setting and again.energies == push.energies
    assert "cone R 0.5 mm, pushed from 0 to 1.2 mm at 0.3 m/s" in say_setting(again.setting)


@pytest.mark.parametrize(
    ("motion", "key", "says"),
    [
        (Motion("dragged"), "motion.kind", "none of free, prescribed, pushed"),
        (Motion("pushed", values=(("depth", 1e-3),)), "motion.depth", "speed, end_depth"),
        (Motion("pushed", values=(("speed", -1.0),)), "motion.speed", "use 0.0001 to 100"),
        (Motion("pushed", 3e-3), "motion.end_depth", "not below the start"),
        (Motion("pushed", values=(("speed", 50.0),)), "motion", "sound speed"),
        (Motion("prescribed"), "motion.table", "two or more"),
        (Motion("prescribed", table=((0.0, 1e-3), (1e-3, 2e-3))), "motion.start_depth", "the same"),
        (Motion("prescribed", table=((0.0, 0.0), (0.0, 1e-3))), "motion", "rise from 0"),
        (Motion("pushed", table=((0.0, 0.0), (1.0, 1e-3))), "motion.table", "leave it out"),
        (Motion("free", 1.0), "motion.start_depth", "three tip radii"),
    ],
)
def test_a_motion_that_cannot_be_made(motion, key, says):
    with pytest.raises(SimulationError) as caught:
        check_setting(a_push(motion=motion, depth=5e-3))
    assert caught.value.key == key
    assert says in str(caught.value)


def test_an_empty_path_is_a_free_one():
    assert all(each.size == 0 for each in make_path(Motion()))
