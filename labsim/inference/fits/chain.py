"""A chain on the disk between two blocks of steps: written whole, aside, renamed, and only gone on with by its own run.

The file opens with ``emcee.backends.HDFBackend``. emcee's own way of writing it, step by step in place, leaves a file that
HDF5 refuses when the process is killed within a write.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
from pathlib import Path

import emcee
import h5py
import numpy as np

from ...records import FloatArray

NAME = "mcmc"  # emcee's


def fingerprint(names: tuple[str, ...], seed: int, start: FloatArray, log_probability: FloatArray) -> str:
    """Names a target by its values at the walkers' start, (m, d) and (m,), bit for bit: another target, another name."""
    digest = hashlib.sha256(json.dumps([list(names), seed, emcee.__version__, np.__version__]).encode())
    digest.update(np.ascontiguousarray(start).tobytes())
    digest.update(np.ascontiguousarray(log_probability).tobytes())
    return digest.hexdigest()


def write_chain(path: Path, chain: emcee.backends.Backend, mark: str) -> Path:
    """The whole chain in emcee's HDF5 layout; whatever is killed, the file is the old one or the new one."""
    walkers, d = chain.shape
    whole = io.BytesIO()
    with h5py.File(whole, "w") as file:
        group = file.create_group(NAME)
        group.attrs.update(
            version=emcee.__version__,
            nwalkers=walkers,
            ndim=d,
            has_blobs=False,
            iteration=chain.iteration,
            mark=mark,
        )
        group.create_dataset("accepted", data=chain.accepted, fletcher32=True)
        for name, shape in (("chain", (None, walkers, d)), ("log_prob", (None, walkers))):
            values = chain.get_value(name)
            group.create_dataset(name, data=values, maxshape=shape, fletcher32=True)
        group.attrs["digest"] = _digest(
            chain.get_value("chain"), chain.get_value("log_prob"), chain.random_state
        )
        for number, value in enumerate(chain.random_state):
            group.attrs[f"random_state_{number}"] = value
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        aside.write_bytes(whole.getvalue())
        os.replace(aside, path)
    finally:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
    return path


def read_chain(path: Path, mark: str) -> emcee.backends.Backend | None:
    """The chain in memory, or None where there is none, where it is damaged, or where it is another run's."""
    try:
        with h5py.File(io.BytesIO(path.read_bytes()), "r") as file:
            group = file[NAME]
            if group.attrs["mark"] != mark:
                return None
            chain = emcee.backends.Backend()
            chain.reset(int(group.attrs["nwalkers"]), int(group.attrs["ndim"]))
            chain.iteration = int(group.attrs["iteration"])
            chain.chain, chain.log_prob = group["chain"][()], group["log_prob"][()]
            chain.accepted = group["accepted"][()]
            state = [group.attrs[f"random_state_{number}"] for number in range(5)]
            chain.random_state = (
                str(state[0]),
                np.asarray(state[1]),
                int(state[2]),
                int(state[3]),
                float(state[4]),
            )
            if group.attrs["digest"] != _digest(chain.chain, chain.log_prob, chain.random_state):
                return None
            if chain.iteration < 1 or len(chain.chain) != chain.iteration:
                return None
            return chain
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, MemoryError):
        return None


def _digest(chain: FloatArray, log_prob: FloatArray, state: tuple) -> str:
    digest = hashlib.sha256(np.ascontiguousarray(chain).tobytes())
    digest.update(np.ascontiguousarray(log_prob).tobytes())
    digest.update(
        np.asarray(state[1]).tobytes() + repr((int(state[2]), int(state[3]), float(state[4]))).encode()
    )
    return digest.hexdigest()
