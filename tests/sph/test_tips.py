"""Every tip in its folder: its outline against geometry, uniform pressure on it, what it refuses, and whose runs it shares."""

import math

import numpy as np
import pytest
from scipy.spatial import KDTree

from labsim.errors import SimulationError
from labsim.records import Material, Projectile
from labsim.runs.run_file import canonical, make_key
from labsim.sph import DropSetting, check_setting
from labsim.sph import particles as rows
from labsim.sph.bodies import elastic_material, set_body
from labsim.sph.drop import evolve
from labsim.sph.particles import fill_at_rest
from labsim.sph.profile import (
    SIDE,
    Arc,
    Line,
    has_shaft,
    measure_distance,
    outline,
    shaft,
    volume_below,
    walk,
)
from labsim.sph.tips import find_tip, list_tips, make_profile

RADIUS = 5e-4
STEP = 1e-6  # m, between points of an outline
# the variants that the defaults leave out
ROUNDED = [
    ("cone", (("half_angle", math.radians(45)), ("point_radius", 1e-4))),
    ("cone", (("rod_radius", 3e-4),)),
    ("flat", (("edge_radius", 1e-4),)),
    ("ogive", (("point_radius", 1e-4), ("length_ratio", 2.0))),
    ("sphere", (("rod_radius", 2e-4),)),
]


def a_tip(tip, shape=()):
    return Projectile(tip, RADIUS, 1e-6, shape=shape)


def find_geometry(tip):
    return getattr(find_tip(tip), "GEOMETRIES", ("axisymmetric",))[0]


@pytest.mark.parametrize(("tip", "shape"), [*((tip, ()) for tip in list_tips()), *ROUNDED])
def test_distance_is_the_shortest_way_to_the_outline(tip, shape):
    """Of points in and out, against the nearest of many points on the outline; the sign against a count of crossings."""
    profile = make_profile(a_tip(tip, shape))
    rng = np.random.default_rng(1)
    x, z = rng.uniform(-2, 2, 4000) * RADIUS, rng.uniform(-1.5, 4, 4000) * RADIUS
    r, up = outline(profile, 9 * RADIUS, 2000)
    ends = zip(np.c_[r, up][:-1], np.c_[r, up][1:], strict=True)
    line = np.concatenate([np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / STEP))[:-1] for a, b in ends])
    shortest, _ = KDTree(line).query(np.c_[np.abs(x), z])
    found = measure_distance(x, z, 0.0, profile)
    inside = np.array([_is_inside(abs(at), height, line) for at, height in zip(x, z, strict=True)])
    np.testing.assert_allclose(np.abs(found), shortest, atol=STEP)
    near = shortest > STEP
    assert np.array_equal(found[near] < 0, inside[near])


def _is_inside(r, z, line):
    """Whether an odd number of crossings of the outline lies outwards at that height."""
    a, b = line[:-1], line[1:]
    cut = (a[:, 1] <= z) != (b[:, 1] <= z)
    at = a[cut, 0] + (z - a[cut, 1]) / (b[cut, 1] - a[cut, 1]) * (b[cut, 0] - a[cut, 0])
    return np.count_nonzero(at > r) % 2 == 1


def test_volumes():
    R, pi = RADIUS, math.pi
    for tip, shape, height, volume in (
        ("hemisphere", (), 3 * R, 2 / 3 * pi * R**3 + 2 * pi * R**3),
        ("sphere", (), 3 * R, 4 / 3 * pi * R**3),
        ("flat", (), R, pi * R**3),
        ("cone", (("half_angle", math.radians(45)),), R, pi / 3 * R**3),
        ("cone", (("half_angle", math.radians(45)), ("rod_radius", R / 2)), 2 * R, pi / 3 * R**3 + pi / 4 * R**3),
    ):  # fmt: skip
        assert volume_below(make_profile(a_tip(tip, shape)), height) == pytest.approx(volume, rel=1e-5)
    assert volume_below(make_profile(a_tip("cylinder")), 9 * R, planar=True) == pytest.approx(
        pi * R**2, rel=1e-5
    )


def test_an_ogive_meets_its_rod_without_a_kink_and_is_as_long_as_said():
    for shape in ((), (("length_ratio", 2.0),), (("length_ratio", 1.0),)):
        profile = make_profile(a_tip("ogive", shape))
        assert profile[-1, 1] == pytest.approx(dict(shape).get("length_ratio", 3.0) * RADIUS)
        assert tuple(profile[-2, 5:7]) == (1.0, 0.0)
    blunt = make_profile(a_tip("ogive", (("point_radius", RADIUS),)))
    assert blunt[-1, 1] == pytest.approx(RADIUS)  # nothing but a round end is left of it


@pytest.mark.parametrize("tip", list_tips())
def test_uniform_pressure_pushes_with_pressure_times_area(tip):
    """A closed box of dust that hardly bears shear comes to rest under one pressure p: on the projectile in it acts p A, with A
    the section where it leaves the box; on one that does not leave it acts nothing."""
    spacing, pressure, duration = RADIUS / 12, 900.0, 1e-2
    geometry, projectile = find_geometry(tip), Projectile(tip, RADIUS, 1e9)
    setting = set_body(elastic_material(45e3, 1e-3), spacing, duration, geometry=geometry).replace(
        projectile=projectile
    )
    width, height, under = 3 * RADIUS, 6 * RADIUS, 2.04 * RADIUS  # no lattice plane is a plane of symmetry
    x, z = np.meshgrid(np.arange(spacing / 2, width, spacing), np.arange(spacing / 2, height, spacing))
    x, z = x.ravel(), z.ravel()
    profile = make_profile(projectile)
    distance = measure_distance(x, z, under, profile)
    x, z, distance = (each[distance > 0] for each in (x, z, distance))
    dust = fill_at_rest(setting, x, z, np.full(x.size, 0.15), pressure)
    wall = (x > width - 3 * spacing) | (z < 3 * spacing) | (z > height - 3 * spacing)
    result = evolve(
        setting,
        dust,
        wall,
        np.array([under, -1e-7, 0.0, 0.0, 0.0]),
        planes=() if geometry == "axisymmetric" else (0.0,),
    )
    edge = 6 * spacing
    inner = (x > edge / 2) & (x < width - edge) & (z > edge) & (z < height - edge) & (distance > edge / 2)
    rest = result.state[rows.PRESSURE][inner].mean()
    late = result.log[:, 0] > duration / 2
    whole, top = (
        (math.pi * RADIUS**2, math.pi * outline(profile, height - under)[0][-1] ** 2)
        if geometry == "axisymmetric"
        else (RADIUS, outline(profile, height - under)[0][-1])
    )
    force = result.log[late, 3].mean() * (2 * math.pi if geometry == "axisymmetric" else 1.0)
    share = force / (rest * whole)
    print(
        f"{tip}: push / (p A) {share:.4f}, expected {top / whole:.4f}; p {rest:.0f} of {pressure:.0f} Pa at the start"
    )
    assert has_shaft(profile) == (top > 0.01 * whole)
    assert share == pytest.approx(top / whole, abs=0.01)


@pytest.mark.parametrize(
    ("projectile", "key", "says"),
    [
        (a_tip("wedge"), "projectile.tip", "none of cone, cylinder"),
        (a_tip("_hidden"), "projectile.tip", "none of"),
        (a_tip("cone", (("angle", 0.5),)), "projectile.angle", "half_angle, point_radius, rod_radius"),
        (a_tip("hemisphere", (("half_angle", 0.5),)), "projectile.half_angle", "no number of its own"),
        (a_tip("cone", (("half_angle", 3.0),)), "projectile.half_angle", "use 0.0872665 to 1.48353"),
        (a_tip("cylinder"), "projectile.tip", "planar"),
    ],
)
def test_a_tip_that_cannot_be_made(projectile, key, says):
    with pytest.raises(SimulationError) as caught:
        check_setting(DropSetting(projectile, 0.6, Material(), spacing=RADIUS / 5))
    assert caught.value.key == key
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("pieces", "says"),
    [
        ((Arc(1e-3, SIDE),), "ends in the open"),
        ((Line(math.inf),), "cannot be walked"),
        ((Arc(1e-3, 4.0),), "cannot be walked"),
        ((Arc(1e-3, math.pi), Line(1e-3)), "crosses the axis"),
    ],
)
def test_a_walk_that_is_no_outline(pieces, says):
    with pytest.raises(SimulationError, match=says):
        walk(pieces)


def test_a_rod_as_wide_or_thinner():
    assert shaft(1e-3) == shaft(1e-3, 1e-3) == (Line(math.inf),)
    assert walk((Arc(1e-3, SIDE), *shaft(1e-3, 4e-4)))[-1, 0] == pytest.approx(4e-4)


def test_two_cones_do_not_share_their_runs():
    """All of a projectile is in a run's key; a number that is written out at its default is no other projectile."""

    def key(tip, *shape):
        return make_key(DropSetting(a_tip(tip, shape), 0.6, Material(), spacing=RADIUS / 5))

    keys = [key("cone"), key("cone", ("half_angle", 0.5)), key("cone", ("point_radius", 1e-5)), key("flat")]
    assert len(set(keys)) == 4
    default = next(each.default for each in find_tip("cone").PARAMETERS if each.name == "half_angle")
    assert key("cone", ("half_angle", default)) == keys[0]


def test_the_text_of_a_tip_from_elsewhere_is_in_the_key(tmp_path):
    path = tmp_path / "blunt.py"
    text = (
        "from labsim.sph.profile import SIDE, Arc, shaft\nPARAMETERS = ()\n"
        "def draw(radius, values):\n    return Arc(0.5 * radius, SIDE), *shaft(0.5 * radius)\n"
    )
    keys = []
    for factor in ("0.5", "0.6"):
        path = tmp_path / factor / "blunt.py"
        path.parent.mkdir()
        path.write_text(text.replace("0.5", factor))
        setting = DropSetting(a_tip(str(path)), 0.6, Material(), spacing=RADIUS / 10)
        check_setting(setting)
        assert str(tmp_path) not in canonical(setting)
        keys.append(make_key(setting))
    assert keys[0] != keys[1]
