#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# A catheter's journey over several views, three programs on the loopback in real time: angio-simulate is the laboratory,
# angio-navigate steers the catheter and asks for views, angio-servo brings the C-arm there. Both loops are recorded, and
# replayed bit for bit.
#   journey.sh BIN SOURCES [BRANCH] [OUT]     BRANCH 13 has six forks on its way; logs are kept in OUT when it is given.
set -euo pipefail
bin=$1 sources=$2 branch=${3:-13}
work=${4:-$(mktemp -d)}
mkdir -p "$work"
bus="udpm://239.255.76.67:$((20000 + $$ % 20000))?ttl=0"
max_s=300

pids=()
end() {
  for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait 2>/dev/null || true
  [ -n "${kept:-}" ] || rm -rf "$work"
}
[ $# -lt 4 ] || kept=yes
trap end EXIT

"$bin/angio-spy" --bus "$bus" --duration-s 0.2 >/dev/null 2>"$work/spy.err" || {
  grep -q multicast "$work/spy.err" && { echo "no multicast on this machine"; exit 77; }
}

# The example's detector with a quarter of the pixels: two cores have three programs to run.
sed -e 's/pixel_spacing_mm: .*/pixel_spacing_mm: 0.5071171875/' -e 's/image_size_px: .*/image_size_px: [512, 512]/' \
  "$sources/examples/data/hepatic-tace/carm.yaml" >"$work/carm.yaml"
common=(--tree "$sources/examples/data/hepatic-tace/tree.csv" --calibration "$work/carm.yaml")
tasks=$sources/examples/08_tasks

# Three programs in real time; succeeds when the catheter has arrived.
journey() {
  pids=()
  "$bin/angio-simulate" --bus "$bus" "${common[@]}" --settings "$tasks/journey_lab.yaml" --catheter-branch 0 \
    --frame-rate-hz 10 --duration-s $max_s >"$work/lab.out" 2>&1 &
  pids+=($!)
  "$bin/angio-servo" --bus "$bus" "${common[@]}" --task view --view-from bus --settings "$tasks/journey_carm.yaml" \
    --autostart --record "$work/carm.lcm" --duration-s $max_s >"$work/carm.out" 2>&1 &
  pids+=($!)
  "$bin/angio-navigate" --bus "$bus" "${common[@]}" --to-branch "$branch" --ask-for-views \
    --autostart --record "$work/catheter.lcm" --duration-s $max_s >"$work/catheter.out" 2>"$work/catheter.err" || true
  for pid in "${pids[@]}"; do kill -INT "$pid"; done
  for pid in "${pids[@]}"; do wait "$pid" || true; done
  pids=()
  grep -q '^arrived;' "$work/catheter.out"
}

fail() {
  echo "$1"
  cat "$work/catheter.err" "$work/catheter.out"
  tail -n 5 "$work/carm.out"
  exit 1
}
# Times differ from run to run, and a host that stands still for seconds is a fault that a person resets: one more try.
journey || journey || fail "the catheter has not arrived"
views=$(grep -c 'held: waits for a view' "$work/catheter.err" || true)
[ "$views" -ge 2 ] || fail "the journey had $views views, and should have two at least"
"$bin/angio-replay" "$work/catheter.lcm" --machine catheter --to-branch "$branch" "${common[@]}" --compare \
  --ask-for-views || fail "the catheter's log is not replayed bit for bit"
"$bin/angio-replay" "$work/carm.lcm" --task view --view-from bus --settings "$tasks/journey_carm.yaml" "${common[@]}" \
  --compare || fail "the C-arm's log is not replayed bit for bit"
echo "arrived in branch $branch over $views views; both logs are replayed bit for bit"
