#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# An experiment in shards on a Slurm cluster: a job array makes the shards that are not there yet, and merge makes
# FOLDER/result.json of all. When a task failed or was killed its shard is named; the same command makes that one alone.
# Usage: slurm.sh SHARDS FOLDER PROGRAM ARGUMENT...
#   slurm.sh 100 runs build/bin/angio-evaluate simulation --tree tree.csv --trials 10000
# SBATCH_PARTITION, SBATCH_TIMELIMIT and so on are sbatch's. All nodes need the folder, the program and its input files
# under the same paths.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
shards=$1 folder=$2 program=$3
shift 2
mkdir -p "$folder"
missing=""
for ((number = 1; number <= shards; ++number)); do
  [ -f "$folder/shard-$number.json" ] || missing+=",$number"
done
if [ -n "$missing" ]; then
  echo "making shards ${missing#,} of $shards"
  # The tasks' exit codes do not matter here: merge names what is missing.
  sbatch --wait --array="${missing#,}" --output="$folder/shard-%a.log" \
    "$here/shard.sbatch" "$shards" "$folder" "$@" || true
fi
shopt -s nullglob
"$program" merge "$folder"/shard-*.json --out "$folder/result.json"
