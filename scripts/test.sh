#!/usr/bin/env bash
# Lint, types, tests. Everything runs, also after a failure; the exit code is that of the first failure.
# Arguments go to pytest: scripts/test.sh tests/unit -k kernel
# Files of tests are shared out to one process more than there are cores; more than four would want much memory.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
bash scripts/setup.sh

failure=0
check() { "$@" || { local code=$?; [ "$failure" -ne 0 ] || failure=$code; }; }

check .venv/bin/python -m ruff check .
# Types are checked while the tests begin: that takes one core for a minute.
types=$(mktemp)
if .venv/bin/python -c 'import sys, numpy; sys.exit(numpy.__version__ >= "2")'; then
    .venv/bin/python -m mypy pbem >"$types" 2>&1 &
else
    echo "mypy: left out. NumPy 2 describes arrays by their number of axes, the code does not; types are checked with NumPy 1." \
        >"$types" &
fi
checker=$!
trap 'kill "$checker" 2>/dev/null || true; rm -f "$types"' EXIT
# nproc counts no more cores than OpenMP may use threads, which says nothing of how many processes there is room for.
# One more than cores, as tests wait for programs that they start and stop.
workers=$(($(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc) + 1))
# One thread for each process: those of BLAS would wait for each other on cores that other processes use.
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
# Where OpenBLAS does not know the processor, its products take several times as long; pbem run sees to that by itself.
kernels=${OPENBLAS_CORETYPE-$(.venv/bin/python -m pbem.blas_kernels)}
[ -z "$kernels" ] || export OPENBLAS_CORETYPE=$kernels
# The tests start hundreds of processes: where Python may not keep what it compiles, that is a third of their time.
unset PYTHONDONTWRITEBYTECODE
check .venv/bin/python -m pytest -n $((workers < 4 ? workers : 4)) --dist loadfile "$@"
check wait "$checker"
cat "$types"
exit "$failure"
