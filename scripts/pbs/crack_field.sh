#!/usr/bin/env bash
# A large field of cracks with friction on several nodes, for PBS Pro and OpenPBS; the next job of a chain goes on:
#
#     qsub scripts/pbs/crack_field.sh                                        # makes the case at the first start
#     qsub -v CASE=my_case.toml scripts/pbs/crack_field.sh                   # a case of yours
#     qsub -W depend=afterany:JOB -v CASE=my_case.toml scripts/pbs/crack_field.sh     # goes on when JOB has ended
#
#PBS -N pbem
#PBS -l select=2:ncpus=32:mpiprocs=32:ompthreads=1:mem=96gb
#PBS -l walltime=04:00:00
#PBS -j oe
#PBS -r y
set -euo pipefail
cd "${PBS_O_WORKDIR:-.}"

# --- Software: one of these three, with the names of your site. -------------------------------------------------------
# (a) modules, pbem in an environment on top of them:
# module load gcc openmpi petsc python
# source "$HOME/pbem/.venv/bin/activate"
# (b) a virtual environment, or conda's, in which mpi4py and petsc4py are built with the MPI that starts the ranks:
# source "$HOME/pbem/.venv/bin/activate"
# (c) a container, with the same kind of MPI inside as the mpiexec outside:
# PBEM=(apptainer exec "$HOME/pbem.sif" pbem)
if [ -z "${PBEM+set}" ]; then PBEM=(pbem); fi

# The mpiexec of the MPI with which mpi4py is built; one that knows PBS takes nodes and ranks from the job. Otherwise
# LAUNCH=(mpiexec -n 64 --hostfile "$PBS_NODEFILE"). One copy of pbem for each rank is refused with a message.
if [ -z "${LAUNCH+set}" ]; then LAUNCH=(mpiexec -n "$(wc -l <"$PBS_NODEFILE")"); fi

# The ranks are the threads.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1

# --- The case. --------------------------------------------------------------------------------------------------------
case_file=${CASE:-crack_field.toml}
if [ ! -e "$case_file" ] && [ -z "${CASE:-}" ]; then
    # 20 000 cracks of 8 elements: 960 000 unknowns, with the hierarchical operator.
    "${PBEM[@]}" make cracks -o "$case_file" --count "${CRACKS:-20000}" --elements 8 --density 0.1 --friction 0.6 \
        --sxx -1 --syy -2 --sxy 1 --steps 20 --compact
fi
results=$(basename "$case_file" .toml).h5

# --- Run, or go on after the last step that the result file holds; every step is kept when PBS ends the job. ---------
resume=()
if [ -e "$results" ]; then resume=(--resume); fi
"${LAUNCH[@]}" "${PBEM[@]}" run "$case_file" -o "$results" ${resume[@]+"${resume[@]}"}
