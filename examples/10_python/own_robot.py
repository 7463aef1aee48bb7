#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""A C-arm of one's own on the bus: obeys CARM_COMMAND, says CARM_STATE. own_robot.py [URL [SECONDS]]"""
import sys
import time

import angio
import numpy as np

bus = angio.Bus(sys.argv[1] if len(sys.argv) > 1 else "udpm://239.255.76.67:7667?ttl=0")
duration_s = float(sys.argv[2]) if len(sys.argv) > 2 else float("inf")
fastest = np.array([0.44, 0.44, 0.15, 0.15, 0.15])  # rad/s, rad/s, m/s, m/s, m/s: the machine's own limits come first.
now_us = lambda: time.monotonic_ns() // 1000
gate, state = angio.CommandGate(), angio.CArmState(time_us=now_us())
wanted, valid_until_us = np.zeros(5), 0


def obey(command):  # One that cannot be decoded, or is not finite, does not come here.
    global wanted, valid_until_us
    too_long = command.velocity.any() and not 0 < command.valid_for_us <= 1_000_000
    if too_long or gate.refusal(command, bus.sender, now_us()) is not None:  # One program moves the arm, anybody stops it.
        return
    gate.obeyed(command, bus.sender, now_us())
    wanted, valid_until_us = command.velocity.copy(), now_us() + command.valid_for_us


bus.subscribe("CARM_COMMAND", obey)
bus.subscribe("SERVO_SESSION", lambda session: gate.begin(session, bus.sender, now_us()))
end_us = now_us() + 1e6 * duration_s
while now_us() < end_us:
    while (wait_us := state.time_us + 10_000 - now_us()) > 0:
        bus.handle(1e-6 * wait_us)
    now, last = now_us(), state.time_us
    velocity = np.clip(wanted, -fastest, fastest) if now < valid_until_us else np.zeros(5)  # Silence means stop.
    # Here a real machine is moved and its encoders are read.
    state = angio.CArmState(time_us=now, sequence=state.sequence + 1, velocity=velocity, joints=state.joints + 1e-6 * (now - last) * velocity)
    bus.publish("CARM_STATE", state)
