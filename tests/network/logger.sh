#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# logger.sh PROGRAMS SOURCES: what lcm-logger hears of a live loop gives the same commands again, bit for bit.
# Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
need lcm-logger
shared=(--bus "$bus" --tree "$data/tree.csv" --calibration "$data/carm.yaml")
begin logger lcm-logger --lcm-url="$bus&recv_buf_size=4194304" "$folder/run.lcm"
listens logger
begin servo "$programs/angio-servo" "${shared[@]}" --autostart --duration-s 9
sleep 1
"$programs/angio-simulate" "${shared[@]}" --duration-s 6 --frame-rate-hz 4 --transport png >/dev/null
wait "${started[servo]}"
end logger || true
cat "$folder/servo.out" "$folder/servo.err"
# A log is of a whole run, or a loop cannot be compared with it: it must hold the first command.
"$programs/angio-replay" "$folder/run.lcm" --tree "$data/tree.csv" --calibration "$data/carm.yaml" --compare \
  --out "$folder/commands.csv"
[ "$(wc -l <"$folder/commands.csv")" -gt 3 ]
"$programs/angio-spy" --bus "file://$folder/run.lcm?speed=0"
"$programs/angio-view" --bus "file://$folder/run.lcm?speed=0" --tree "$data/tree.csv" --out "$folder/run.mp4"
[ -s "$folder/run.mp4" ]
