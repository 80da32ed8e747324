"""Campaigns of the mesh that labsim is judged by: what a plan says is what is hidden, and nothing else is."""

import sys
import tomllib
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.accuracy import fresh
from benchmarks.campaigns import film, scan
from benchmarks.lagrangian_mesh import film_campaigns, mesh


def test_a_plan_hides_what_the_mesh_and_the_camera_know(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["fresh.py", "--seed", "3", "--listed", "40", "--unlisted", "40"])
    fresh.main()
    plan = tomllib.loads(capsys.readouterr().out)["campaign"]
    assert len({each["name"] for each in plan}) == len(plan) == 30 + 40 + 8 + 40
    assert {each["note"] for each in plan if each["cause"] == "unknown"} == set(fresh.KINDS)
    assert {each["cause"] for each in plan} > set(fresh.LISTED)
    known = {
        "dust": {field.name for field in fields(mesh.Dust)},
        "body": {field.name for field in fields(mesh.Forces)},
        "measure": {"pixel", "frame", "surface_row", "mass", "wobble", "line_time", "clock_drift"},
        "ct": {"scale", "blur_mm"},
    }
    for each in plan:
        hides = {key for key in each if key in (*known, "drift", "small_strength")}
        assert bool(hides) == (each["cause"] != "none")
        for table in hides & set(known):
            assert set(each[table]) <= known[table]
        assert each["scans"] or "ct" not in each


def test_points_hold_the_volume_of_their_cells_and_lie_in_them():
    result = mesh.run_drop(mesh.Dust(), 0.5e-3, 0.1, mesh.Numerics(cells=4.0))
    points = film_campaigns.spread_points(result, 0.5e-3 / 4.0)
    assert points[:, 2].sum() == pytest.approx(result.volume.sum(), rel=1e-12, abs=0.0)
    assert points[:, 2] @ points[:, 3] == pytest.approx(
        np.sum(result.volume * result.phi), rel=1e-12, abs=0.0
    )
    rings = 2.0 * np.pi * points[:, 0]  # V = ∮ 2 π r dA: areas of the points add up to that of the half plane
    corner = result.nodes_r[-1, 0] * (result.nodes_z[:, 0].mean() - result.nodes_z[0, -1])
    assert (points[:, 2] / rings).sum() == pytest.approx(corner, rel=0.03)


def test_a_crust_is_scanned_without_the_steps_of_the_cells():
    """Rows of 40 µm of dust that the bead did not reach, in cells of 83 µm and more."""
    radius = film_campaigns.SMALL
    dust = mesh.Dust(crust=(0.15, 0.6e-3))
    result = mesh.run_drop(dust, radius, 0.1, mesh.Numerics(cells=6.0))
    points = film_campaigns.spread_points(result, radius / 12.0)
    density = scan.map_density(points, dust.fill, -float(result.nodes_z[0, 0]), radius, radius / 12.0)
    depth = np.arange(0.3e-3, 2.0e-3, 40e-6)
    seen = np.mean(
        [
            density(np.column_stack([np.full(depth.size, r), -depth]))
            for r in radius * np.linspace(3.0, 3.4, 5)
        ],
        axis=0,
    )
    assert np.abs(seen / scan.SOLID - dust.fill(depth)).max() < 1.5e-4  # in steps 8.6e-4


def test_rows_read_one_after_another_are_seen_where_the_tip_is_by_then():
    speed = 0.8
    time = np.linspace(0.0, 4e-3, 2001)
    still = SimpleNamespace(
        time=time, depth=speed * time, speed=np.full(time.size, speed), stopping_depth=1.0
    )
    usual = film.Filming(frame_rate=10e3, pixel_size=20e-6, after=3e-3)
    slow = film.Filming(frame_rate=10e3, pixel_size=20e-6, after=3e-3, line_time=1e-5)
    (_, straight, surface), (_, read, _) = (
        film.film(still, speed, each, np.random.default_rng(2)) for each in (usual, slow)
    )
    shown, later = straight - surface, read - surface
    deep = shown > 20.0  # x = v (t + line x / pixel): deeper by 1 / (1 - v line / pixel)
    assert np.median(later[deep] / shown[deep]) == pytest.approx(1.0 / (1.0 - speed * 1e-5 / 20e-6), rel=2e-3)
