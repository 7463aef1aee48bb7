#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""What angio-check-machine must say of a right machine: check_rows.py ROWS.json... What a busy host may spoil (rates, ages,
latencies) has to be there, and is not judged."""
import json
import sys

JOINTS = ["primary", "secondary", "table x", "table y", "table z"]
RIGHT = [f"{joint} by {what}" for joint in JOINTS for what in ("its encoder", "the X-ray")]
RIGHT += ["joints", "frame geometry", "image orientation", "NaN", "CARM_STATE clock", "XRAY_FRAME clock"]
for path in sys.argv[1:]:
    rows = {row["name"]: row for row in json.load(open(path))}
    wrong = [rows.get(name, name) for name in RIGHT if name not in rows or rows[name]["verdict"] != "pass"]
    assert not wrong, (path, wrong)
    assert {"watchdog", "stop", "latency", "velocities", "frame age"} <= rows.keys(), (path, rows.keys())
