#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# A catheter's journey over several views, three programs on the loopback in real time: angio-simulate is the laboratory,
# angio-navigate steers the catheter and asks for views, angio-servo brings the C-arm there. Both loops are recorded, and
# replayed bit for bit.
#   journey.sh BIN SOURCES [BRANCH] [OUT]     BRANCH 13 has six forks on its way; logs are kept in OUT when it is given.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
branch=${3:-13} work=${4:-$folder}
mkdir -p "$work"
max_s=300
"$programs/angio-spy" --bus "$bus" --duration-s 0.2 >/dev/null 2>"$folder/spy.err" || {
  grep -q multicast "$folder/spy.err" && skip "no multicast: $(tail -n 1 "$folder/spy.err")"
}

small_detector
common=(--tree "$data/tree.csv" --calibration "$folder/carm.yaml")
tasks=$sources/examples/08_tasks

# Three programs in real time; succeeds when the catheter has arrived.
journey() {
  begin lab "$programs/angio-simulate" --bus "$bus" "${common[@]}" --settings "$tasks/journey_lab.yaml" \
    --catheter-branch 0 --frame-rate-hz 10 --duration-s $max_s
  begin carm "$programs/angio-servo" --bus "$bus" "${common[@]}" --task view --view-from bus \
    --settings "$tasks/journey_carm.yaml" --point-covariance --autostart --record "$work/carm.lcm" --duration-s $max_s
  "$programs/angio-navigate" --bus "$bus" "${common[@]}" --to-branch "$branch" --ask-for-views \
    --autostart --record "$work/catheter.lcm" --duration-s $max_s >"$work/catheter.out" 2>"$work/catheter.err" || true
  end lab || true
  end carm || true
  grep -q '^arrived;' "$work/catheter.out"
}

fail() {
  echo "$1"
  cat "$work/catheter.err" "$work/catheter.out"
  tail -n 5 "$folder/carm.out" "$folder/carm.err"
  exit 1
}
# Times differ from run to run, and a host that stands still for seconds is a fault that a person resets: one more try.
journey || journey || fail "the catheter has not arrived"
views=$(grep -c 'held: waits for a view' "$work/catheter.err" || true)
[ "$views" -ge 2 ] || fail "the journey had $views views, and should have two at least"
"$programs/angio-replay" "$work/catheter.lcm" --machine catheter --to-branch "$branch" "${common[@]}" --compare \
  --ask-for-views || fail "the catheter's log is not replayed bit for bit"
"$programs/angio-replay" "$work/carm.lcm" --task view --view-from bus --settings "$tasks/journey_carm.yaml" "${common[@]}" \
  --compare || fail "the C-arm's log is not replayed bit for bit"
# How many messages of a channel are in the C-arm's log.
messages() {
  python3 -c 'import json, sys
print(json.load(open(sys.argv[1]))["channels"].get(sys.argv[2], {"messages": 0})["messages"])' "$work/spy.json" "$1"
}
"$programs/angio-spy" --bus "file://$work/carm.lcm?speed=0" --json "$work/spy.json" >/dev/null
# A frame in which nothing was found, as when contrast agent washes out, has no covariance: one in a hundred may.
[ "$(messages REGISTRATION)" -gt 0 ] &&
  [ $((100 * $(messages REGISTRATION_POINTS))) -ge $((99 * $(messages REGISTRATION))) ] ||
  fail "$(messages REGISTRATION_POINTS) of $(messages REGISTRATION) registrations said how uncertain their points are"
echo "arrived in branch $branch over $views views; both logs are replayed bit for bit"
