#!/usr/bin/env bash
# Lint, types, tests. Everything runs, also after a failure; the exit code is that of the first failure.
# Arguments go to pytest: scripts/test.sh tests/unit -k kernel
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
bash scripts/setup.sh

failure=0
check() { "$@" || { local code=$?; [ "$failure" -ne 0 ] || failure=$code; }; }

check .venv/bin/python -m ruff check .
check .venv/bin/python -m mypy pbem
check .venv/bin/python -m pytest "$@"
exit "$failure"
