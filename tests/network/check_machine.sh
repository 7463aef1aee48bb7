#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# check_machine.sh PROGRAMS SOURCES: angio-check-machine on the robot in another language with a simulated X-ray, and on
# the simulated machine, over this machine's loopback. Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
python_types
own=$bus simulated=$(bus_at $((port + 1)))
begin robot python3 "$sources/examples/06_own_robot/own_robot.py" "$folder" "$port" 150
listens robot
# Small images: two X-rays are rendered at once.
calibration=$data/carm.yaml
begin xray "$programs/angio-simulate" --bus "$own" --xray-only --frame-rate-hz 10 --duration-s 150
begin machine "$programs/angio-simulate" --bus "$simulated" --frame-rate-hz 10 --duration-s 150
# The table is shown whatever it says; what a busy host may spoil (rates, ages, latencies) is not asserted here.
check() {
  local name=$1 code=0
  shift
  "$programs/angio-check-machine" --calibration "$calibration" --watch-s 2 --json "$folder/$name.json" "$@" \
    >"$folder/$name.txt" 2>"$folder/$name.err" || code=$?
  echo "== $name: exit code $code"
  cat "$folder/$name.txt"
  return "$code"
}
both() {
  begin spy "$programs/angio-spy" --bus "$simulated" --once --duration-s 26 --json "$folder/spy.json"
  check own --bus "$own" --move &
  first=$!
  check simulated --bus "$simulated" --move || true
  wait "$first" || true
  wait "${started[spy]}" || true
  python3 "$sources/tests/network/check_rows.py" "$folder/own.json" "$folder/simulated.json" || return 1
  # A command every 20 ms, and none in answer to its own that come round.
  python3 - "$folder/spy.json" <<'CHECK' || return 1
import json, sys
commands = json.load(open(sys.argv[1]))["channels"]["CARM_COMMAND"]["messages"]
assert 100 < commands < 26 * 60, commands
CHECK
}
# A host that stands still for a third of a second lets commands run out, and a joint goes less far: both machines, one
# after the other, have to pass in one of three tries.
both || { echo "once more"; both; } || { echo "and again"; both; }
# What is left of the checklist (examples/06_own_robot/README.md): states, the picture, the first motion, its replay.
tree=$data/tree.csv
"$programs/angio-spy" --bus "$own" --once --duration-s 1.5 --json "$folder/states.json" >/dev/null
"$programs/angio-inspect" --bus "$own" --tree "$tree" --calibration "$calibration" --picture "$folder/now.png" | tee "$folder/inspect.txt"
grep -q "agrees with itself and the calibration" "$folder/inspect.txt" && grep -q "left L, right R, top H, bottom F" "$folder/inspect.txt"
test -s "$folder/now.png"
begin servo "$programs/angio-servo" --bus "$own" --record "$folder/first.lcm" --view-primary-deg 6 \
  --view-secondary-deg 3 --settings "$sources/examples/06_own_robot/first_motion.yaml"
"$programs/angio-operator" arm --bus "$own" --timeout-s 10
"$programs/angio-operator" start --bus "$own" --timeout-s 10
sleep 4
end servo || { cat "$folder/servo.err"; exit 1; }
cat "$folder/servo.out"
"$programs/angio-spy" --bus "$own" --once --duration-s 1 --json "$folder/after.json" >/dev/null
"$programs/angio-replay" "$folder/first.lcm" --compare --settings "$sources/examples/06_own_robot/first_motion.yaml" \
  --view-primary-deg 6 --view-secondary-deg 3 | tee "$folder/replay.txt"
python3 - "$folder/states.json" "$folder/after.json" <<'CHECK'
import json, sys
before, after = (json.load(open(path))["channels"]["CARM_STATE"] for path in sys.argv[1:])
assert before["undecodable"] == 0 and before["missing"] == 0, before
moved = float(after["last_value"].split()[0]) - float(before["last_value"].split()[0])
assert moved > 1, (before, after)  # At 2.5 deg a second, towards LAO 6; it stands where Ctrl-C stopped it.
CHECK
# Watching moves nothing, and says so.
check watched --bus "$simulated" || true
python3 - "$folder/watched.json" <<'CHECK'
import json, sys
rows = {row["name"]: row for row in json.load(open(sys.argv[1]))}
assert rows["motion"]["verdict"] == "not_seen", rows["motion"]
assert rows["image orientation"]["verdict"] == "pass", rows["image orientation"]
CHECK
# A machine that another program steers is left alone.
cat >"$folder/foreign.py" <<'FOREIGN'
import socket, struct, sys, time
sys.path.insert(0, sys.argv[1])
from angio_lcm.carm_command_t import carm_command_t
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
command = carm_command_t()
for n in range(40):
    command.sequence = n + 1
    out.sendto(struct.pack(">II", 0x4C433032, n) + b"CARM_COMMAND\0" + command.encode(), ("239.255.76.67", int(sys.argv[2])))
    time.sleep(0.05)
FOREIGN
begin foreign python3 "$folder/foreign.py" "$folder" "$((port + 1))"
if check steered --bus "$simulated" --move; then exit 1; fi
grep -qE "comes from another program, [0-9.]+:[0-9]+" "$folder/steered.err" || { cat "$folder/steered.err"; exit 1; }
