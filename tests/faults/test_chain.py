"""A chain that was stopped goes on as if it had not been; a file that is not its own is never gone on with."""

from __future__ import annotations

from pathlib import Path

import emcee
import numpy as np
import pytest

from labsim.inference.fits import posterior as posterior_module
from labsim.inference.fits.posterior import Posterior, sample

CENTRE, COVARIANCE = np.array([7.0, 0.1]), np.array([[0.01, 0.002], [0.002, 0.04]])


def target(theta: np.ndarray) -> np.ndarray:
    left = theta - CENTRE
    return -0.5 * np.einsum("mi,ij,mj->m", left, np.linalg.inv(COVARIANCE), left)


def draw(backend: Path | None, seed: int = 3, log_probability=target, progress=None) -> Posterior:
    return sample(
        log_probability, ["a", "b"], CENTRE, COVARIANCE, seed=seed, backend=backend, progress=progress
    )


class Killed(BaseException):
    pass


def stop_after(blocks: int):
    def progress(done: float, total: float, text: str) -> None:
        if done >= blocks * posterior_module.CHECK_EVERY:
            raise Killed

    return progress


@pytest.fixture(scope="module")
def unbroken() -> Posterior:
    return draw(None)


@pytest.mark.parametrize("blocks", [1, 2, 3])
def test_a_stopped_chain_ends_as_the_unbroken_one(tmp_path: Path, unbroken: Posterior, blocks: int) -> None:
    file = tmp_path / "chain.h5"
    with pytest.raises(Killed):
        draw(file, progress=stop_after(blocks))
    assert emcee.backends.HDFBackend(str(file)).iteration == blocks * posterior_module.CHECK_EVERY
    seen: list[float] = []
    resumed = draw(file, progress=lambda done, total, text: seen.append(done))
    assert seen[0] == (blocks + 1) * posterior_module.CHECK_EVERY, "the blocks done before were done again"
    assert resumed.steps == unbroken.steps and resumed.r_hat == unbroken.r_hat
    for name in ("a", "b"):
        assert np.array_equal(resumed.samples(name), unbroken.samples(name))


def test_the_chain_of_another_target_or_seed_is_not_gone_on_with(tmp_path: Path, unbroken: Posterior) -> None:
    file = tmp_path / "chain.h5"
    draw(file, log_probability=lambda theta: 0.5 * target(theta))
    assert np.array_equal(draw(file).samples("a"), unbroken.samples("a"))
    draw(file, seed=4)
    assert np.array_equal(draw(file).samples("a"), unbroken.samples("a"))


@pytest.mark.parametrize("damage", ["cut", "flipped", "text", "empty"])
def test_a_damaged_chain_is_made_again(tmp_path: Path, unbroken: Posterior, damage: str) -> None:
    file = tmp_path / "chain.h5"
    draw(file)
    content = bytearray(file.read_bytes())
    if damage == "cut":
        content = content[: len(content) // 2]
    elif damage == "flipped":
        for place in range(3000, len(content), 997):
            content[place] ^= 0x10
    else:
        content = bytearray(b"no chain") if damage == "text" else bytearray()
    file.write_bytes(content)
    assert np.array_equal(draw(file).samples("b"), unbroken.samples("b"))
