#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# python_robot.sh PROGRAMS SOURCES PYTHON MODULE: angio-check-machine on the robot that is written with the Python module, with a
# simulated X-ray, over this machine's loopback. Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
python=$3
export PYTHONPATH=$4
robot=$sources/examples/10_python/own_robot.py
lines=$(wc -l <"$robot")
[ "$lines" -lt 40 ] || { echo "own_robot.py has $lines lines"; exit 1; }
begin robot "$python" "$robot" "$bus" 150
listens robot
# Rubbish first: a robot must live on.
"$python" - "$bus" <<'RUBBISH'
import os, sys
import angio
bus = angio.Bus(sys.argv[1])
for size in (0, 3, 8, 20, 40, 100, 1000):
    bus.publish("CARM_COMMAND", os.urandom(size))
RUBBISH
# The same detector with a sixteenth of the pixels: what a busy host spends on images, the robot does not get.
"$python" - "$data/carm.yaml" "$folder/carm.yaml" <<'SMALL'
import sys
import angio
machine = angio.read_carm_calibration(sys.argv[1])
machine.carm.pixel_spacing_m *= 4
machine.carm.image_width_px //= 4
machine.carm.image_height_px //= 4
angio.write_carm_calibration(sys.argv[2], machine)
SMALL
begin xray "$programs/angio-simulate" --bus "$bus" --calibration "$folder/carm.yaml" --xray-only --frame-rate-hz 8 --duration-s 150
check() {
  "$programs/angio-check-machine" --calibration "$folder/carm.yaml" --watch-s 2 --json "$folder/rows.json" --bus "$bus" --move || true
  "$python" "$sources/tests/network/check_rows.py" "$folder/rows.json"
}
# As in check_machine.sh: a host that stands still for a third of a second lets commands run out.
check || { echo "once more"; check; } || { echo "and again"; check; }
alive robot || { cat "$folder/robot.err"; exit 1; }
