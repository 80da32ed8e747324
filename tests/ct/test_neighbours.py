"""Slices that are lost, doubled, out of order, black or of another scan are named; sound stacks are left in peace."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import tifffile

from benchmarks.truths.phantom import Phantom
from labsim.campaign import read_scan
from labsim.ct import open_stack, reduce_scan
from labsim.ct.slices.neighbours import find_bright_jumps, find_doubled
from labsim.errors import MeasurementError

DATA = Path(__file__).parents[2] / "data" / "ct" / "labelled_scans"


def lose(first, number):
    return lambda slices, other: np.delete(slices, range(first, first + number), axis=0)


def double(first, number):
    return lambda slices, other: np.insert(slices, first + number, slices[first : first + number], axis=0)


def swap(first, second, number):
    def damage(slices, other):
        order = np.arange(len(slices))
        order[first : first + number], order[second : second + number] = (
            np.arange(second, second + number),
            np.arange(first, first + number),
        )
        return slices[order]

    return damage


def take(first, last):
    return lambda slices, other: np.concatenate([slices[:first], other[first:last], slices[last:]])


def blacken(at):
    def damage(slices, other):
        slices = slices.copy()
        slices[at] = 0
        return slices

    return damage


# what is done, and the slices that one of the places must lie at
DAMAGE = {
    "two swapped": (swap(40, 44, 1), {39, 40, 43, 44}),
    "two swapped below the bead": (swap(52, 60, 1), {51, 52, 59, 60}),
    "blocks of 20 swapped": (swap(30, 60, 20), {29, 30, 59, 60}),
    "blocks of 20 swapped below": (swap(45, 75, 20), {44, 45, 64, 65}),
    "one lost": (lose(40, 1), {39, 40}),
    "ten lost beside the bead": (lose(35, 10), set(range(33, 41))),
    "ten lost below the bead": (lose(44, 10), {43, 44}),
    "one doubled": (double(40, 1), {40}),
    "ten doubled": (double(40, 10), {40}),
    "one of another scan": (take(40, 41), {39, 40}),
    "one of another scan below": (take(50, 51), {49, 50}),
    "lower half of another scan": (take(54, 108), {53, 54}),
    "lower half of another scan, through the bead": (take(40, 108), {39, 40}),
    "a black slice": (blacken(70), {69, 70, 71}),
    "a black slice in the air": (blacken(5), {4, 5, 6}),
}


@pytest.fixture(scope="module")
def stacks():
    return [np.stack(list(open_stack(DATA / name / "slices"))) for name in ("p01-C01", "p05-C02")]


def reduce(folder, slices):
    (folder / "slices").mkdir(parents=True)
    shutil.copy(DATA / "p01-C01" / "scan.toml", folder)
    for k, image in enumerate(slices):
        tifffile.imwrite(folder / "slices" / f"slice_{k:04d}.tif", image)
    return reduce_scan(read_scan(folder))


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_named_with_its_slices(tmp_path, stacks, name):
    damage, places = DAMAGE[name]
    try:
        said = "; ".join(reduce(tmp_path, damage(*stacks)).map.warnings)
    except MeasurementError as trouble:
        said = str(trouble)
    assert re.search("jump|same picture|break off", said), said
    assert places & {int(number) for number in re.findall(r"slice_(\d{4})", said)}, said


def test_one_slice_lost_at_the_middle_of_the_bead_makes_it_too_flat(tmp_path, stacks):
    said = "; ".join(reduce(tmp_path, lose(34, 1)(*stacks)).map.warnings)
    assert "times as high as it is wide" in said and "some are lost or doubled" in said


@pytest.mark.parametrize(
    "changes", [{}, {"noise": 0.0}, {"noise": 0.0, "cup": 0.01}, {"gradient": 10.0}, {"tilt": 0.09}]
)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_sound_phantoms_are_left_in_peace(reduced_phantoms, changes, seed):
    said = "; ".join(reduced_phantoms(seed=seed, **changes)[1].map.warnings)
    assert not re.search("jump|same picture|high", said), said


@pytest.mark.parametrize(
    "changes",
    [
        {"radius": 8.9, "centre": (51.8, 51.1, 29.3), "noise": 0.1, "saturated": True, "bits": 8},
        {"radius": 8.2, "centre": (46.0, 52.0, 34.3), "noise": 0.1, "saturated": True, "gradient": 10.0},
        {"radius": 11.4, "centre": (51.8, 51.5, 43.4), "blur": 0.97, "zone_width": 1.07},
        {"radius": 13.9, "centre": (52.0, 54.3, 43.7), "noise": 0.01, "saturated": True, "zone": 0.03},
        {"radius": 10.4, "centre": (47.5, 48.5, 41.2), "saturated": True, "gradient": 10.0},
    ],
)
@pytest.mark.parametrize("seed", [12, 13])
def test_other_sound_beads_are_left_in_peace(reduced_phantoms, changes, seed):
    said = "; ".join(reduced_phantoms(seed=seed, **changes)[1].map.warnings)
    assert not re.search("jump|same picture|as high|are stated|halo|opposite", said), said


def test_slices_without_noise_may_be_alike(tmp_path):
    find_doubled(open_stack(Phantom(noise=0.0).write(tmp_path / "s").slices))


def test_a_spheres_own_area_is_no_jump():
    rows = np.arange(60)
    assert find_bright_jumps(np.pi * np.maximum(14.0**2 - (rows - 30.4) ** 2, 0)) == []
    cut = np.where(rows < 27, np.pi * np.maximum(14.0**2 - (rows - 30.4) ** 2, 0), 0.0)
    assert find_bright_jumps(cut) == [26]
