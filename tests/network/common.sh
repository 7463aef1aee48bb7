# SPDX-License-Identifier: GPL-2.0-or-later
# common.sh: what the tests on a network share. To be sourced by them, with their arguments PROGRAMS SOURCES: sets
# `programs`, `sources`, `data` (the example's), `folder` (a temporary one), `port`, `group` and `bus` (of this process
# alone, on this machine). All that began() was told of ends with the script, and the folder goes.
# shellcheck shell=bash disable=SC2034
set -euo pipefail
programs=$1 sources=$2
data=$sources/examples/data/hepatic-tace
folder=$(mktemp -d)
port=$((20000 + $$ % 20000))
group=239.255.76.67
bus_at() { echo "udpm://$group:$1?ttl=0"; }
bus=$(bus_at "$port")
declare -A started=()  # Process ids by name.

# For a test that has more to take away: is called last.
at_end() { :; }
finish() {
  set +e
  for id in "${started[@]}"; do
    kill -CONT "$id" 2>/dev/null
    kill "$id" 2>/dev/null
  done
  wait 2>/dev/null
  at_end
  rm -rf "$folder"
  return 0
}
trap finish EXIT

skip() { echo "skipped: $1"; exit 77; }
need() { for one in "$@"; do command -v "$one" >/dev/null || skip "there is no $one"; done; }

# begin NAME COMMAND ...: in the background; what it says is in $folder/NAME.out and NAME.err.
begin() {
  local name=$1
  shift
  "$@" >"$folder/$name.out" 2>"$folder/$name.err" &
  started[$name]=$!
}
alive() { kill -0 "${started[$1]}" 2>/dev/null; }
# end NAME [SIGNAL]: its exit code.
end() {
  local id=${started[$1]} code=0
  kill "-${2:-INT}" "$id" 2>/dev/null || true
  wait "$id" || code=$?
  unset "started[$1]"
  return "$code"
}
# listens NAME: it began to listen on the bus some moments ago. Skips where this machine has no multicast.
listens() {
  sleep 0.5
  alive "$1" && return
  grep -qiE "no such device|unreachable|not permitted|multicast" "$folder/$1.err" &&
    skip "no multicast: $(tail -n 1 "$folder/$1.err")"
  cat "$folder/$1.out" "$folder/$1.err"
  exit 1
}
# The message types for Python, in $folder.
python_types() {
  need python3 lcm-gen
  lcm-gen -p --ppath "$folder" "$sources"/modules/messaging/types/*.lcm
}
# The example's C-arm with a quarter of the pixels, in $folder/carm.yaml: two cores have several programs to run.
small_detector() {
  sed -e 's/pixel_spacing_mm: .*/pixel_spacing_mm: 0.5071171875/' -e 's/image_size_px: .*/image_size_px: [512, 512]/' \
    "$data/carm.yaml" >"$folder/carm.yaml"
}
