#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds the fuzzers and runs each for a bounded time: run.sh [seconds, 60] [reader ...]; node_datagrams are those that
# both machines' nodes hear through a real socket. What is found is left in
# build-fuzz/findings/<reader>, and made smaller for a minute; the exit code is 1 when anything was found.
set -euo pipefail
cd "$(dirname "$0")/../.."
seconds=${1:-60}
build=${ANGIO_FUZZ_BUILD:-build-fuzz}
if [[ ! $seconds =~ ^[1-9][0-9]*$ ]]; then
  echo "usage: tests/fuzz/run.sh [seconds] [reader ...]" >&2
  exit 2
fi
cmake --preset fuzz -B "$build" > /dev/null
cmake --build "$build" --target fuzz_reader fuzz_nodes > /dev/null

# Files in memory: a disk would be what is tried. libFuzzer's programs end without taking theirs away.
memory=/dev/shm
if [[ ! -w $memory ]]; then memory=${TMPDIR:-/tmp}; fi
TMPDIR=$(mktemp -d -p "$memory" angio-fuzz-XXXXXX)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT
export UBSAN_OPTIONS=print_stacktrace=1
limits=(-timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=512 -max_len=16384)

fuzz() {  # reader, options and files of libFuzzer ...
  local program=fuzz_reader
  if [[ $1 == node_datagrams ]]; then program=fuzz_nodes; fi
  ANGIO_FUZZ_READER=$1 "$build/bin/$program" "${limits[@]}" "${@:2}"
}

readers=("${@:2}")
if [[ ${#readers[@]} -eq 0 ]]; then
  # Asked for none, the program lists those that it knows.
  list=$(fuzz '' 2>&1 || true)
  read -ra readers <<< "${list#*must be one of } node_datagrams"
fi
failed=0
printf '%-18s %12s %10s %10s\n' reader executions coverage findings
for reader in "${readers[@]}"; do
  grown=$build/grown/$reader found=$build/findings/$reader log=$build/fuzz-$reader.log
  rm -rf "$found"
  mkdir -p "$grown" "$found"
  if ! fuzz "$reader" -dict=tests/fuzz/keywords.dict -max_total_time="$seconds" -print_final_stats=1 \
    -artifact_prefix="$found/" "$grown" "tests/fuzz/corpus/$reader" > "$log" 2>&1; then
    failed=1
  fi
  findings=$(find "$found" -type f | wc -l)
  for file in "$found"/crash-*; do
    if [[ -e $file ]]; then
      fuzz "$reader" -minimize_crash=1 -max_total_time=60 -exact_artifact_path="$found/minimized-${file##*/}" "$file" \
        >> "$log" 2>&1 || true
    fi
  done
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | head -1)
  coverage=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)
  printf '%-18s %12s %10s %10s\n' "$reader" "${runs:-none}" "${coverage:-none}" "$findings"
done
exit "$failed"
