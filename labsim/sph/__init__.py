"""The bundled SPH solver: a drop setting in, depth against time and the filling factor out. SI throughout."""
