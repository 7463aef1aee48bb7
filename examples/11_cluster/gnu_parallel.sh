#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# An experiment in shards on the processors of one machine, or on several by ssh, with GNU parallel: makes the shards
# that are not there yet, and merge makes FOLDER/result.json of all. When one failed or was killed it is named; the same
# command makes that one alone.
# Usage: gnu_parallel.sh SHARDS FOLDER PROGRAM ARGUMENT...
#   gnu_parallel.sh 8 runs build/bin/angio-evaluate simulation --tree tree.csv --trials 10000
# PARALLEL has further options: "--jobs 4", "--sshlogin node1,node2 --workdir .". Machines share the folder and have the
# program and its input files under the same paths.
set -euo pipefail
shards=$1 folder=$2 program=$3
shift 2
mkdir -p "$folder"
missing=()
for ((number = 1; number <= shards; ++number)); do
  [ -f "$folder/shard-$number.json" ] || missing+=("$number")
done
if [ ${#missing[@]} -gt 0 ]; then
  echo "making shards ${missing[*]} of $shards"
  # Exit codes do not matter here: merge names what is missing.
  parallel --quote "$@" --shard "{}/$shards" --out "$folder/shard-{}.json" ::: "${missing[@]}" || true
fi
shopt -s nullglob
"$program" merge "$folder"/shard-*.json --out "$folder/result.json"
