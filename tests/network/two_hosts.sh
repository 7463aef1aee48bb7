#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# two_hosts.sh PROGRAMS SOURCES: the machine on one host, the loop on another, a bad network between them. The hosts are
# network namespaces with a cable of two virtual ends; they end with the test. Exit code 77: skipped, and why.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
need ip awk
machine=angio-m-$$ loop=angio-l-$$
at_end() {
  ip netns del "$machine" 2>/dev/null
  ip netns del "$loop" 2>/dev/null
}
why=$(ip netns add "$machine" 2>&1) || skip "no network namespaces: $why"
why=$(ip netns add "$loop" 2>&1) || skip "no network namespaces: $why"
why=$(ip link add name cable-m netns "$machine" type veth peer name cable-l netns "$loop" 2>&1) || skip "no virtual cable: $why"
for end in "$machine cable-m 1" "$loop cable-l 2"; do
  read -r host cable number <<<"$end"
  ip -n "$host" link set lo up
  ip -n "$host" addr add "10.99.0.$number/24" dev "$cable"
  ip -n "$host" link set "$cable" multicast on up
  ip -n "$host" route add 224.0.0.0/4 dev "$cable" || skip "no multicast route"
done

# The network's faults: the kernel's where it has them, else made where the programs speak.
machine_faults=() loop_faults=()
if ip netns exec "$machine" tc qdisc add dev cable-m root netem delay 15ms 5ms loss 0.1% reorder 0.1% 2>/dev/null &&
  ip netns exec "$loop" tc qdisc add dev cable-l root netem delay 15ms 5ms loss 2% reorder 2% 2>/dev/null; then
  echo "faults by the kernel's netem"
else
  echo "faults by the programs' --disturb: this kernel has no netem"
  printf '%s\n' 'delay_ms: 15' 'jitter_ms: 10' 'loss_probability: 0.1' 'reorder_probability: 0.1' \
    'duplicate_probability: 0.1' 'reorder_delay_ms: 40' >"$folder/faults.yaml"
  machine_faults=(--disturb "$folder/faults.yaml") loop_faults=(--disturb "$folder/faults.yaml")
fi

bus='udpm://239.255.76.67:7667?ttl=1'
shared=(--bus "$bus" --tree "$data/tree.csv" --calibration "$data/carm.yaml")
begin servo ip netns exec "$loop" "$programs/angio-servo" "${shared[@]}" --autostart --duration-s 60 \
  --record "$folder/loop.lcm" "${loop_faults[@]}"
servo=${started[servo]}
begin simulate ip netns exec "$machine" "$programs/angio-simulate" "${shared[@]}" --duration-s 60 --frame-rate-hz 5 \
  --transport png --region 256,256,512,512 "${machine_faults[@]}"

# What is on the machine's side of the cable, for some seconds; and again and again until a condition holds.
spy() { ip netns exec "$machine" "$programs/angio-spy" --bus "$bus" --once --duration-s "$1" >"$folder/spy.txt"; }
angle() { awk '$1 == "CARM_STATE" { getline; print $1 + 0 }' "$folder/spy.txt"; }
commands() { awk '$1 == "CARM_COMMAND" { n = $3 } END { print n + 0 }' "$folder/spy.txt"; }
fail() { echo "failed: $1"; cat "$folder/spy.txt" "$folder"/*.err | tail -n 30; exit 1; }
await_commands() {
  for _ in 1 2 3 4 5 6; do
    spy 2
    if [ "$(commands)" -gt 2 ] && awk "BEGIN { exit !($(angle) > $1) }"; then return; fi
  done
  # The machine refuses commands whose frame is older than 300 ms: where everything is slow, it rightly stands still.
  awk '$1 == "CARM_COMMAND" && $11 > 300 { exit 1 }' "$folder/spy.txt" || skip "this computer is too busy: commands come too late"
  fail "$2"
}

await_commands 1 "commands must cross the cable, and the arm must turn towards LAO"
cat "$folder/spy.txt"

# The loop falls silent while the arm is on its way: it comes to rest, and stays.
kill -STOP "$servo"
spy 1.5
resting=$(angle)
spy 1.5
[ "$(commands)" -eq 0 ] || fail "a stopped loop says nothing"
[ "$(angle)" = "$resting" ] || fail "silence must stop the arm: it went from $resting to $(angle)"

kill -CONT "$servo"
await_commands "$resting - 0.5" "commands must flow again"
end servo
cat "$folder/servo.out"
"$programs/angio-replay" "$folder/loop.lcm" --tree "$data/tree.csv" --calibration "$data/carm.yaml" --compare
