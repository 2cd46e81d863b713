"""PETSc's solvers and options, and the distribution of rows over the ranks."""
