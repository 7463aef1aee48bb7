#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""A C-arm of one's own on the bus: obeys CARM_COMMAND, says CARM_STATE. Types by: lcm-gen -p --ppath DIR types/*.lcm"""
import math, select, socket, struct, sys, time

sys.path.insert(0, sys.argv[1] if len(sys.argv) > 1 else ".")  # Where lcm-gen wrote the package angio_lcm.
from angio_lcm.carm_command_t import carm_command_t
from angio_lcm.carm_state_t import carm_state_t

GROUP, PORT = "239.255.76.67", int(sys.argv[2]) if len(sys.argv) > 2 else 7667
DURATION_S = float(sys.argv[3]) if len(sys.argv) > 3 else math.inf
FASTEST = [0.44, 0.44, 0.15, 0.15, 0.15]  # rad/s, rad/s, m/s, m/s, m/s: the machine's own limits come first.
LONGEST_VALID_US, SILENCE_US, FURTHEST_AHEAD = 1_000_000, 1_000_000, 1000
SHORT = 0x4C433032  # An LCM message that fits one datagram: this word, a number, the channel's name, NUL, the bytes.


def open_bus():
    bus = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bus.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    bus.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)  # 1: other hosts of the local network hear us too.
    bus.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + struct.pack("=I", 0))
    bus.bind((GROUP, PORT))
    return bus


def command_in(datagram):
    """The command in a datagram, or None: whatever cannot be understood moves nothing."""
    channel, _, data = datagram[8:].partition(b"\0")
    if len(datagram) < 8 or struct.unpack(">I", datagram[:4])[0] != SHORT or channel != b"CARM_COMMAND":
        return None
    try:
        command = carm_command_t.decode(data)
    except (ValueError, struct.error):
        return None
    valid = 0 < command.valid_for_us <= LONGEST_VALID_US or not any(command.joint_velocity)
    return command if valid and all(map(math.isfinite, command.joint_velocity)) else None


bus, state, wanted, valid_until_us, whose, newest, heard_us = open_bus(), carm_state_t(), [0.0] * 5, 0, None, 0, 0
end_s, last_us = time.monotonic() + DURATION_S, time.monotonic_ns() // 1000
while time.monotonic() < end_s:
    while select.select([bus], [], [], 0.01)[0]:  # Until nothing has come for 10 ms, or the state is due.
        (datagram, sender), now_us = bus.recvfrom(65535), time.monotonic_ns() // 1000
        if command := command_in(datagram):  # One program moves the arm, until it is silent; anybody may stop it.
            follows = sender == whose and 0 < command.sequence - newest <= FURTHEST_AHEAD
            if follows or (now_us - heard_us > SILENCE_US and any(command.joint_velocity)):
                whose, newest, heard_us, follows = sender, command.sequence, now_us, True
            if follows or not any(command.joint_velocity):
                wanted, valid_until_us = command.joint_velocity, now_us + command.valid_for_us
        if now_us - last_us > 10_000:
            break
    now_us = time.monotonic_ns() // 1000
    velocity = wanted if now_us < valid_until_us else [0.0] * 5  # Silence means stop.
    state.joint_velocity = [max(-m, min(m, v)) for v, m in zip(velocity, FASTEST)]
    # Here a real machine is moved and its encoders are read.
    state.joint_position = [q + 1e-6 * (now_us - last_us) * v for q, v in zip(state.joint_position, state.joint_velocity)]
    state.utime, state.sequence, last_us = now_us, state.sequence + 1, now_us
    bus.sendto(struct.pack(">II", SHORT, state.sequence & 0xFFFFFFFF) + b"CARM_STATE\0" + state.encode(), (GROUP, PORT))
