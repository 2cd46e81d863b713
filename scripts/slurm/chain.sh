#!/usr/bin/env bash
# Several jobs one after the other, where a site does not let jobs be put back into the queue:
#
#     bash scripts/slurm/chain.sh 5 my_case.toml     # five jobs; those after the one that finishes have nothing to do
#
# Each starts when the one before has ended, however it did (afterany), and goes on after its last step: pbem run
# --resume. A finished run that is resumed ends at once.
set -euo pipefail

if [ $# -lt 1 ]; then
    echo "usage: $0 JOBS [CASE.toml]" >&2
    exit 2
fi
jobs=$1
shift
script=$(dirname "${BASH_SOURCE[0]}")/crack_field.sh
before=()
for ((number = 1; number <= jobs; number++)); do
    # CHAIN: the next job goes on, this one is not put back.
    id=$(CHAIN=1 sbatch --parsable --no-requeue ${before[@]+"${before[@]}"} "$script" "$@")
    id=${id%%;*}
    echo "job $number of $jobs: $id"
    before=("--dependency=afterany:$id")
done
