#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# logger.sh PROGRAMS SOURCES: what lcm-logger hears of a live loop gives the same commands again, bit for bit.
# Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
need lcm-logger
small_detector
shared=(--tree "$data/tree.csv" --calibration "$folder/carm.yaml")

# A live loop that lcm-logger listens to. Fails when a datagram that the loop had is not in the log: UDP may lose one on
# a host that has no time for the logger, and a part of a run cannot be compared with the loop.
record() {
  begin logger lcm-logger --force --lcm-url="$bus&recv_buf_size=4194304" "$folder/run.lcm"
  listens logger
  begin servo "$programs/angio-servo" --bus "$bus" "${shared[@]}" --autostart --duration-s 9 --record "$folder/own.lcm"
  sleep 1
  "$programs/angio-simulate" --bus "$bus" "${shared[@]}" --duration-s 6 --frame-rate-hz 4 --transport png >/dev/null
  local code=0
  wait "${started[servo]}" || code=$?
  unset "started[servo]"
  end logger || true
  cat "$folder/servo.out" "$folder/servo.err"
  [ "$code" = 0 ] || { echo "angio-servo ended with $code"; exit 1; }
  [ "$(messages run)" = "$(messages own)" ]
}
# How many frames and commands a log has.
messages() {
  "$programs/angio-spy" --bus "file://$folder/$1.lcm?speed=0" --json "$folder/spy.json" >/dev/null
  python3 -c 'import json, sys
channels = json.load(open(sys.argv[1]))["channels"]
print(*(channels.get(name, {"messages": 0})["messages"] for name in sys.argv[2:]))' \
    "$folder/spy.json" XRAY_FRAME SERVO_INPUT CARM_COMMAND
}
rounds=0
until record; do
  rounds=$((rounds + 1))
  echo "lcm-logger has $(messages run) frames, inputs and commands; angio-servo $(messages own)"
  [ $rounds -lt 3 ] || exit 1
  rm -f "$folder/own.lcm"
done
"$programs/angio-replay" "$folder/run.lcm" "${shared[@]}" --compare --out "$folder/commands.csv"
[ "$(wc -l <"$folder/commands.csv")" -gt 3 ]
"$programs/angio-spy" --bus "file://$folder/run.lcm?speed=0"
"$programs/angio-view" --bus "file://$folder/run.lcm?speed=0" --tree "$data/tree.csv" --out "$folder/run.mp4"
[ -s "$folder/run.mp4" ]
