import pytest

from benchmarks.truths.phantom import Phantom
from labsim.ct import reduce_scan


@pytest.fixture(scope="session")
def reduced_phantoms(tmp_path_factory):
    """Function: phantom -> (phantom, its reduced scan), each made once."""
    made = {}

    def make(**changes):
        phantom = Phantom(**changes)
        if phantom not in made:
            scan = phantom.write(tmp_path_factory.mktemp("phantom") / "slices")
            made[phantom] = reduce_scan(scan)
        return phantom, made[phantom]

    return make
