"""Forecast of the memory, time and disk space of a run, and the limits of machine and job; without MPI and PETSc."""
