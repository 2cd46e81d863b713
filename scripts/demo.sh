#!/usr/bin/env bash
# Runs the two-block case on two MPI ranks and draws it: demo/two_blocks.h5, demo/two_blocks.png.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
bash scripts/setup.sh

# Open MPI 4 and 5 refuse root, and more ranks than cores, unless told so. One thread a rank: the ranks are the threads.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export OMPI_MCA_rmaps_base_oversubscribe=1 PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
export OMP_NUM_THREADS=1

mkdir -p demo
mpirun -n 2 .venv/bin/pbem run cases/two_blocks.toml -o demo/two_blocks.h5 --force
.venv/bin/pbem info demo/two_blocks.h5
.venv/bin/pbem plot demo/two_blocks.h5 -o "$root/demo/two_blocks.png" # and says where the picture is
