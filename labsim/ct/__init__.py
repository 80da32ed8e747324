"""CT slices in, an axisymmetric map of the filling factor and its compacted volume out.

``reduce_scan`` measures, ``compress`` and ``balance_mass`` read its map, ``project`` shows a simulation as the scan
would have seen it, ``coarsen`` makes nearly independent cells.
"""

from .compressed import balance_mass, cell_volumes, coarsen, compress, count_voxels
from .project import project
from .reduce import ReducedScan, mask_near_bead, reduce_scan
from .save import make_dataset, summarise_scan, write_compressed, write_map
from .slices.stack import open_stack

__all__ = [
    "ReducedScan", "balance_mass", "cell_volumes", "coarsen", "compress", "count_voxels", "make_dataset", "mask_near_bead",
    "open_stack", "project", "reduce_scan", "summarise_scan", "write_compressed", "write_map",
]  # fmt: skip
