#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Registers simulated cases by angio-register and by the module: how many are equal, bit for bit, and what a call from Python costs.
compare_with_program.py PROGRAMS TREE [CASES]"""
import pathlib
import statistics
import sys
import tempfile
import time

import angio
from program import Case, by_program, without_times

programs, tree_path = pathlib.Path(sys.argv[1]), sys.argv[2]
count = int(sys.argv[3]) if len(sys.argv) > 3 else 100
tree = angio.read_vessel_tree(tree_path)
registration = angio.Registration(tree)
equal, inside_ms, outside_ms, program_ms = 0, [], [], []
with tempfile.TemporaryDirectory() as folder:
    files = pathlib.Path(folder)
    camera, start, line = (str(files / name) for name in ("camera.yaml", "start.yaml", "line.csv"))
    for index in range(count):
        world = {"trials": count, "filled": 0.5 if index % 2 else 1, "noise_px": 1, "spurious": 5}
        trial = angio.simulated_trial(tree, index, world)
        angio.write_camera(camera, trial.views[0].camera)
        angio.write_centerline(line, trial.views[0].centerline)
        angio.write_pose(start, trial.start)
        said = by_program(programs, files, *Case(tree_path, camera, start, line).options())
        # What both read; the program's own time is that of its registration, without process and files.
        view, pose = angio.XrayView(angio.read_centerline(line), angio.read_camera(camera)), angio.read_pose(start)
        began = time.perf_counter()
        result = registration.search(view, pose)
        outside_ms.append(1e3 * (time.perf_counter() - began))
        found = result.as_dict(point_covariance=True)
        inside_ms.append(found["time_ms"]["total"])
        program_ms.append(said["time_ms"]["total"])
        equal += without_times(found) == without_times(said)
    overhead_ms = [a - b for a, b in zip(outside_ms, inside_ms)]
print(f"{equal} of {count} results are equal in all bits")
print(f"a call from Python takes {statistics.median(outside_ms):.2f} ms, of which {statistics.median(overhead_ms):.3f} ms are not the registration (medians)")
print(f"the registration itself takes {statistics.median(inside_ms):.2f} ms, in the program, which registers once and cold, {statistics.median(program_ms):.2f} ms")
