"""The start on MPI ranks, and what ends a run on all of them."""
