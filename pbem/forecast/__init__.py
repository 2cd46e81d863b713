"""What a run will take - memory, time, disk - and what the machine and the job grant; without MPI and PETSc."""
