#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# logger.sh PROGRAMS SOURCES: what lcm-logger hears of a live loop gives the same commands again, bit for bit.
# Exit code 77: skipped, and why.
set -euo pipefail
programs=$1 data=$2/examples/data/hepatic-tace
command -v lcm-logger >/dev/null || { echo "skipped: there is no lcm-logger"; exit 77; }
folder=$(mktemp -d) started=()
finish() {
  for id in "${started[@]}"; do kill "$id" 2>/dev/null; done
  wait 2>/dev/null
  rm -rf "$folder"
  return 0
}
trap 'set +e; finish' EXIT
bus="udpm://239.255.76.67:$((20000 + $$ % 20000))?ttl=0"
shared=(--bus "$bus" --tree "$data/tree.csv" --calibration "$data/carm.yaml")
lcm-logger --lcm-url="$bus&recv_buf_size=4194304" "$folder/run.lcm" >/dev/null 2>"$folder/logger.err" &
logger=$! started+=($!)
sleep 0.3
kill -0 "$logger" 2>/dev/null || { echo "skipped: no multicast: $(tail -n 1 "$folder/logger.err")"; exit 77; }
"$programs/angio-servo" "${shared[@]}" --autostart --duration-s 9 >"$folder/servo.out" 2>&1 &
servo=$! started+=($!)
sleep 1
"$programs/angio-simulate" "${shared[@]}" --duration-s 6 --frame-rate-hz 4 --transport png >/dev/null
wait "$servo"
kill -INT "$logger"
wait "$logger" || true
cat "$folder/servo.out"
# A log is of a whole run, or a loop cannot be compared with it: it must hold the first command.
"$programs/angio-replay" "$folder/run.lcm" --tree "$data/tree.csv" --calibration "$data/carm.yaml" --compare \
  --out "$folder/commands.csv"
[ "$(wc -l <"$folder/commands.csv")" -gt 3 ]
"$programs/angio-spy" --bus "file://$folder/run.lcm?speed=0"
"$programs/angio-view" --bus "file://$folder/run.lcm?speed=0" --tree "$data/tree.csv" --out "$folder/run.mp4"
[ -s "$folder/run.mp4" ]
