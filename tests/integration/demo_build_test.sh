#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# demo.sh's target builds the programs that demo.sh runs and no other, no test and not the whole calibration, and its first
# picture waits for no simulation; the line of progress says what ninja's lines say, and keeps all others: demo_build_test.sh BUILD. Run in the sources' folder.
set -euo pipefail
build=$1
fail() { printf '%s\n' "$1" >&2; exit 1; }

# The target's own inputs are not among those that it has through others.
inputs=$(ninja -C "$build" -t inputs demo; ninja -C "$build" -t query demo | sed 's/^ *//')
built=$(grep -o '^bin/[a-z-]*$' <<< "$inputs" | sort -u)
# angio-servo starts angio-servo-simulated.
run=$({ grep -o 'build/bin/[a-z-]*' demo.sh | sed 's/^build.//'; echo bin/angio-servo-simulated; } | sort -u)
[ "$built" = "$run" ] || fail "demo.sh runs $run, its target builds $built"
for other in '^tests/' 'libangio_calibration\.a$' 'libangio_evaluation\.a$'; do
  if grep -q "$other" <<< "$inputs"; then fail "the demo's target needs $(grep -m 1 "$other" <<< "$inputs")"; fi
done
first=$(ninja -C "$build" -t inputs angio-register)
if grep -q 'libangio_simulation\.a$' <<< "$first"; then fail "angio-register needs the simulation"; fi

shown=$(printf '%s\n' '@1/30 Building CXX object modules/base/CMakeFiles/angio_base.dir/src/errors.cpp.o' \
  'a warning of the compiler' '@2/30 Linking CXX static library modules/base/libangio_base.a' \
  '@15/30 Building CXX object servo/CMakeFiles/angio_servo.dir/Unity/unity_1_cxx.cxx.o' '@30/30 Linking CXX executable bin/angio-replay' \
  'ninja: no work to do.' | .ci/progress.sh)
expected='Building: 1 of 30: modules/base/src/errors.cpp
a warning of the compiler
Building: 15 of 30, less than a minute left: servo
Building: 30 of 30: bin/angio-replay'
[ "$shown" = "$expected" ] || fail "the line of progress is:
$shown"
