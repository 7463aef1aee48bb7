#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# own_robot.sh PROGRAMS SOURCES: plain ViSP code drives a robot in another language, over this machine's loopback.
# Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
python_types

lines=$(wc -l <"$sources/examples/06_own_robot/own_robot.py")
[ "$lines" -lt 60 ] || { echo "own_robot.py has $lines lines"; exit 1; }
begin robot python3 "$sources/examples/06_own_robot/own_robot.py" "$folder" "$port" 25
listens robot
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
