#!/usr/bin/env bash
# A run as a batch system starts it: checked first, carried on after a stop, with its log and tables beside the results.
#
#     bash scripts/tasks/batch.sh CASE.toml [FOLDER] [RANKS]
set -euo pipefail

case=${1:?"usage: bash scripts/tasks/batch.sh CASE.toml [FOLDER] [RANKS]"} folder=${2:-.} ranks=${3:-1}
mkdir -p "$folder"
pbem=${PBEM:-pbem}
name=$(basename "$case" .toml)
results=$folder/$name.h5
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}

"$pbem" check "$case"
mode=()
[ ! -e "$results" ] || mode=(--resume)
code=0
mpirun -n "$ranks" "$pbem" run "$case" -o "$results" ${mode[@]+"${mode[@]}"} --profile "$folder/$name.profile.csv" \
    >>"$folder/$name.log" 2>&1 || code=$?
tail -n 3 "$folder/$name.log"
[ "$code" -eq 0 ] || exit "$code"
"$pbem" info "$results" >"$folder/$name.txt"
"$pbem" export "$results" -o "$folder/$name.steps.csv" --what steps
"$pbem" plot "$results" -o "$folder/$name.png"
