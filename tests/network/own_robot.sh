#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# own_robot.sh PROGRAMS SOURCES: plain ViSP code drives a robot in another language, over this machine's loopback.
# Exit code 77: skipped, and why.
set -euo pipefail
programs=$1 sources=$2
for needed in python3 lcm-gen; do
  command -v "$needed" >/dev/null || { echo "skipped: there is no $needed"; exit 77; }
done
folder=$(mktemp -d)
robot=
trap '[ -z "$robot" ] || kill "$robot" 2>/dev/null || true; rm -rf "$folder"' EXIT
port=$((20000 + $$ % 20000))
bus="udpm://239.255.76.67:$port?ttl=0"
lcm-gen -p --ppath "$folder" "$sources"/modules/messaging/types/*.lcm

lines=$(wc -l <"$sources/examples/06_own_robot/own_robot.py")
[ "$lines" -lt 60 ] || { echo "own_robot.py has $lines lines"; exit 1; }
python3 "$sources/examples/06_own_robot/own_robot.py" "$folder" "$port" 25 2>"$folder/err" &
robot=$!
sleep 0.5
if ! kill -0 "$robot" 2>/dev/null; then
  grep -qiE "No such device|unreachable|not permitted" "$folder/err" && { echo "skipped: no multicast: $(tail -n 1 "$folder/err")"; exit 77; }
  cat "$folder/err"
  exit 1
fi
# Rubbish first: a robot must live on.
python3 - "$port" <<'RUBBISH'
import os, socket, sys
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for size in (0, 3, 8, 20, 40, 100, 1000):
    for head in (b"", b"LC02\0\0\0\1CARM_COMMAND\0"):
        out.sendto(head + os.urandom(size), ("239.255.76.67", int(sys.argv[1])))
RUBBISH
"$programs/example-07-plain-visp" "$bus"
sleep 0.5
"$programs/angio-spy" --bus "$bus" --duration-s 1.5 --once --json "$folder/spy.json"
python3 - "$folder/spy.json" <<'CHECK'
import json, sys
state = json.load(open(sys.argv[1]))["channels"]["CARM_STATE"]
assert state["type"] == "carm_state_t" and state["undecodable"] == 0 and state["missing"] == 0, state
assert state["messages"] > 30, state
assert state["last_value"].startswith("+20.0") or state["last_value"].startswith("+19.9"), state
CHECK
echo "driven, and heard"
