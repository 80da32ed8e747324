"""CT slices in, an axisymmetric map of the filling factor and its compacted volume out."""
