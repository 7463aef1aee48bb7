#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# hostile_datagrams.sh PROGRAMS SOURCES [COUNT]: COUNT datagrams that are no message of ours, on the bus of every program
# that listens, two of which record and one of which servoes: all live, none grows, the loop ends where it should.
# Exit code 77: skipped, and why. MAX_GROWTH_MIB: how much a program may grow, 2 unless told.
# shellcheck source=tests/network/common.sh
source "$(dirname "$0")/common.sh"
count=${3:-4000}
# A quarter of the pixels: an allocator that keeps the place of a frame or two is not taken for a program that grows.
sed 's/^pixel_spacing_mm: .*/pixel_spacing_mm: 0.5071171875/; s/^image_size_px: .*/image_size_px: [512, 512]/' \
  "$data/carm.yaml" >"$folder/carm.yaml"
python_types
begin angio-spy "$programs/angio-spy" --bus "$bus" --once --duration-s 3600
listens angio-spy
begin angio-simulate "$programs/angio-simulate" --bus "$bus" --frame-rate-hz 5 --calibration "$folder/carm.yaml"
begin angio-servo "$programs/angio-servo" --bus "$bus" --calibration "$folder/carm.yaml" \
  --record "$folder/servo.lcm" --view-primary-deg 12 --view-secondary-deg 6
begin angio-navigate "$programs/angio-navigate" --bus "$bus" --calibration "$folder/carm.yaml" --to-branch 13 \
  --record "$folder/navigate.lcm"
begin angio-register "$programs/angio-register" --bus "$bus" --tree "$data/tree.csv" --calibration "$folder/carm.yaml"
mkdir "$folder/view"
begin angio-view "$programs/angio-view" --bus "$bus" --out "$folder/view/%04d.png" --film-rate-hz 1
# It waits for a start that is refused, as the catheter's loop is idle; and one that no other program's commands end.
begin angio-operator "$programs/angio-operator" start --machine catheter --bus "$bus" --timeout-s 3600
begin angio-check-machine "$programs/angio-check-machine" --bus "$(bus_at $((port + 1)))" --watch-s 600
"$programs/angio-operator" arm --bus "$bus" --timeout-s 20
"$programs/angio-operator" start --bus "$bus" --timeout-s 20
# What each program keeps, in KiB: the least of 20 looks over 4 s. A frame that is being drawn, written or read takes
# some MiB for as long as that lasts.
keeps() {
  local -n least=$1
  local name now
  for _ in $(seq 20); do
    for name in "${!started[@]}"; do
      now=$(awk "/^VmRSS/ {print \$2}" "/proc/${started[$name]}/status" 2>/dev/null || echo 0)
      # shellcheck disable=SC2004 # Names, no numbers.
      if [ -z "${least[$name]:-}" ] || [ "$now" -lt "${least[$name]}" ]; then least[$name]=$now; fi
    done
    sleep 0.2
  done
}

cat >"$folder/hostile.py" <<'HOSTILE'
"""hostile.py TYPES PORT COUNT SEED: sends datagrams of which none is a message that a program can obey, each to PORT and
the next one."""
import os, random, socket, struct, sys, time

sys.path.insert(0, sys.argv[1])
import angio_lcm

port, count, seed = int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
rng = random.Random(seed)
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
SHORT, LONG = 0x4C433032, 0x4C433033
channels = {"CARM_STATE": "carm_state_t", "CARM_COMMAND": "carm_command_t", "SERVO_REQUEST": "servo_request_t",
            "SERVO_STATUS": "servo_status_t", "SERVO_INPUT": "servo_input_t", "XRAY_FRAME": "xray_frame_t",
            "REGISTRATION": "registration_t", "REGISTRATION_POINTS": "registration_points_t",
            "CATHETER_STATE": "catheter_state_t", "CATHETER_TIP": "catheter_tip_t",
            "CATHETER_COMMAND": "catheter_command_t", "CATHETER_REQUEST": "servo_request_t", "VIEW_REQUEST": "view_request_t"}


def sound_bytes(kind):
    message = getattr(__import__(f"angio_lcm.{kind}", fromlist=[kind]), kind)()
    if hasattr(message, "pixels"):
        message.pixels = b""
    return message.encode()


sound = {channel: sound_bytes(kind) for channel, kind in channels.items()}


def payload(channel):
    """Another type's fingerprint, an end cut off, or rubbish: never a message of the channel."""
    data = bytearray(sound[channel])
    kind = rng.randrange(4)
    if kind == 0:
        data[rng.randrange(8)] ^= 1 + rng.randrange(255)
    elif kind == 1:
        del data[rng.randrange(8, len(data)):]
    elif kind == 2:
        data = bytearray(os.urandom(rng.randrange(300)))
    else:
        data[:8] = b"\xff" * 8
        data += os.urandom(rng.randrange(50))
    return bytes(data)


def datagram():
    channel = rng.choice(list(channels))
    kind = rng.randrange(8)
    if kind < 3:
        return struct.pack(">II", SHORT, rng.getrandbits(32)) + channel.encode() + b"\0" + payload(channel)
    if kind == 3:  # A channel without its end: what once killed a recording loop.
        return struct.pack(">II", SHORT, rng.getrandbits(32)) + channel.encode()
    if kind == 4:
        return struct.pack(">II", SHORT, rng.getrandbits(32)) + os.urandom(rng.randrange(200))
    if kind == 5:  # A part of a long message that never becomes whole, of any size, place and number.
        size, offset = rng.choice([0, 1, 2000, 2**20, 2**26, 2**31, 2**32 - 1]), rng.choice([0, 1, 1400, 2**31, 2**32 - 1])
        number, parts = rng.choice([0, 1, 2, 65535]), rng.choice([0, 1, 3, 65535])
        head = struct.pack(">IIIIHH", LONG, rng.getrandbits(32), size, offset, number, parts)
        return head + channel.encode() + b"\0" * rng.randrange(2) + os.urandom(rng.randrange(1400))
    if kind == 6:
        return os.urandom(rng.randrange(1, 60))
    return struct.pack(">I", rng.choice([SHORT, LONG, 0])) + os.urandom(rng.randrange(12))


for n in range(count):
    hostile = datagram()
    for to in (port, port + 1):
        out.sendto(hostile, ("239.255.76.67", to))
    if n % 20 == 0:
        time.sleep(0.01)  # 2,000 a second.
HOSTILE
# What the programs need is there before memory is looked at: a loop's own buffers take some seconds of servoing.
python3 "$folder/hostile.py" "$folder" "$port" 4000 1
sleep 10
declare -A before after
keeps before
python3 "$folder/hostile.py" "$folder" "$port" "$count" 2
sleep 3
keeps after
failed=0
for name in "${!started[@]}"; do
  if ! kill -0 "${started[$name]}" 2>/dev/null; then
    echo "$name ended:"
    cat "$folder/$name.out" "$folder/$name.err"
    failed=1
    continue
  fi
  growth=$((after[$name] - before[$name]))
  printf '%-16s alive, %+.1f MiB\n' "$name" "$(awk "BEGIN {print $growth / 1024}")"
  if [ "$growth" -gt $((${MAX_GROWTH_MIB:-2} * 1024)) ]; then
    echo "$name grew"
    failed=1
  fi
done
# A busy host may need some seconds more until the view is reached.
reached=0
for _ in $(seq 20); do
  "$programs/angio-spy" --bus "$bus" --once --duration-s 1.5 --json "$folder/end.json" >/dev/null
  if python3 - "$folder/end.json" <<'END'; then reached=1; break; fi
import json, re, sys
status = json.load(open(sys.argv[1]))["channels"]["SERVO_STATUS"]["last_value"]
print(status)
error = re.search(r"view ([\d.]+) deg", status)
sys.exit(0 if error and " servo," in status and float(error[1]) < 0.1 else 1)
END
done
[ "$reached" = 1 ] || failed=1
for name in angio-servo angio-navigate; do
  end "$name" || { echo "$name: exit code $?"; tail -n 3 "$folder/$name.err"; failed=1; }
  tail -n 1 "$folder/$name.out"
done
# It has heard of no machine, and says so.
end angio-check-machine || true
grep -q "was ended before it had finished" "$folder/angio-check-machine.err" || { echo "angio-check-machine ended by itself"; failed=1; }
for name in servo navigate; do
  "$programs/angio-spy" --bus "file://$folder/$name.lcm?speed=0" --once >"$folder/log.txt" || { echo "$name.lcm cannot be read"; failed=1; }
done
[ "$failed" = 0 ] || { tail -n 5 "$folder"/*.err; exit 1; }
echo "$count datagrams, and all live"
