#!/usr/bin/env bash
# A large field of cracks with friction on several nodes. If time runs out the job goes on by itself:
#
#     sbatch scripts/slurm/crack_field.sh                  # makes the case at the first start, then runs it
#     sbatch scripts/slurm/crack_field.sh my_case.toml     # runs a case of yours
#
#SBATCH --job-name=pbem
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=32       # ranks: one for each core, no more
#SBATCH --cpus-per-task=1          # a rank has one thread
#SBATCH --mem-per-cpu=3G           # memory of a rank; `pbem check CASE` tells that of all ranks together
#SBATCH --time=04:00:00
#SBATCH --signal=B:USR1@120        # this script (B:) is told two minutes before the end
#SBATCH --requeue                  # the job may be put back into the queue
#SBATCH --open-mode=append         # one log for all its starts
#SBATCH --output=%x-%j.log
set -euo pipefail

# --- Software: one of these three, with the names of your site. -------------------------------------------------------
# (a) modules, pbem in an environment on top of them:
# module load gcc openmpi petsc python
# source "$HOME/pbem/.venv/bin/activate"
# (b) a virtual environment, or conda's, in which mpi4py and petsc4py are built with the MPI that starts the ranks:
# source "$HOME/pbem/.venv/bin/activate"
# (c) a container. Its MPI has to understand srun (PMIx); PBEM is the command that the ranks run:
# PBEM=(apptainer exec "$HOME/pbem.sif" pbem)
if [ -z "${PBEM+set}" ]; then PBEM=(pbem); fi

# How the ranks are started. `srun --mpi=list` tells what yours can do: pmix for Open MPI, pmi2 or cray_shasta for
# others. Where it can do none of these: LAUNCH=(mpirun). One copy of pbem for each rank is refused with a message.
if [ -z "${LAUNCH+set}" ]; then LAUNCH=(srun --mpi=pmix --cpu-bind=cores --kill-on-bad-exit=1); fi

# The ranks are the threads.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1

# --- The case. --------------------------------------------------------------------------------------------------------
case_file=${1:-crack_field.toml}
if [ ! -e "$case_file" ] && [ $# -eq 0 ]; then
    # 20 000 cracks of 8 elements: 960 000 unknowns, with the hierarchical operator.
    "${PBEM[@]}" make cracks -o "$case_file" --count "${CRACKS:-20000}" --elements 8 --density 0.1 --friction 0.6 \
        --sxx -1 --syy -2 --sxy 1 --steps 20 --compact
fi
results=$(basename "$case_file" .toml).h5

# --- Run, or go on after the last step that the result file holds. A wrong launch or case ends with 2 here. ----------
resume=()
if [ -e "$results" ]; then resume=(--resume); fi

put_back() {
    trap - USR1
    echo "$(date): time runs out; the job goes on later after the last step in $results"
    kill -TERM "$run" 2>/dev/null || true
    wait "$run" || true
    if [ -z "${CHAIN:-}" ]; then scontrol requeue "$SLURM_JOB_ID"; fi
    exit 0
}
trap put_back USR1

# In the background: bash hears the signal only while it waits.
"${LAUNCH[@]}" "${PBEM[@]}" run "$case_file" -o "$results" ${resume[@]+"${resume[@]}"} &
run=$!
wait "$run"
