"""PETSc's solvers and options, and how rows are shared by the ranks."""
