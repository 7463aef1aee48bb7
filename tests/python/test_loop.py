# SPDX-License-Identifier: GPL-2.0-or-later
"""The closed loop, stepped from Python: it reaches its view, and angio-replay makes the same commands of its log, bit for bit."""
import subprocess

import numpy as np
import pytest

import angio

VIEW = {"task": "view", "view": {"primary_deg": 6, "secondary_deg": 4}}


@pytest.fixture
def lab(small_lab, tmp_path):
    """A tree, the truth, and a calibration that is wrong by 2 deg and 3.7 mm, as its file says it; 256 pixels a side, for speed."""
    tree, truth = small_lab
    path = tmp_path / "carm.yaml"
    angio.write_carm_calibration(str(path), angio.miscalibrated(truth, tree.centroid, [0, 0, 1], np.radians(2), [3e-3, -2e-3, 1e-3]))
    return tree, truth, path


def start_of(tree, truth):
    return truth.carm.joints_for(angio.ViewAngles(), (truth.T_dsa_cb @ [*tree.centroid, 1])[:3])


def test_closes_the_loop(lab, programs, data, tmp_path):
    tree, truth, calibration = lab
    carm = truth.carm
    loop = angio.ServoLoop(tree, angio.read_carm_calibration(str(calibration)), VIEW)
    limits = angio.CArmLimits(carm.source_detector_distance_m - carm.source_isocenter_distance_m)
    arm = angio.SimulatedCArm(limits, start_of(tree, truth))
    xray = angio.SimulatedXray(tree, carm, truth.T_dsa_cb)
    log_path = tmp_path / "run.lcm"

    def off():
        T_camera_model = xray.T_camera_model(arm.state().joints)
        return angio.view_error(T_camera_model, loop.desired_T_camera_model, loop.target_model)

    before = off()
    with angio.LogWriter(str(log_path)) as log:
        for k in range(40):
            now_us = k * 66_667
            arm.advance(now_us)
            state, frame = arm.state(), xray.render(now_us, arm.state().joints)
            said = angio.ServoInput(time_us=now_us, frame_sequence=frame.sequence, state=state)
            report = loop.propose(frame, said)
            if k == 20:  # As when somebody stops the machine.
                report = angio.ServoLoop.withheld(report, "stopped")
                said.verdict = angio.ServoVerdict.taken_back
            loop.commit(report.command)
            loop.learn()
            arm.obey(report.command, now_us + 60_000)
            for channel, message in (("XRAY_FRAME", frame), ("SERVO_INPUT", said), ("CARM_COMMAND", report.command)):
                log.write(channel, message)
    after = off()
    # Calibration alone would keep its 2 deg; a pixel of this small image is 0.7 mm at the isocentre.
    assert np.degrees(before.direction_rad) > 5 and np.degrees(after.direction_rad) < 0.4
    assert after.target_m < 3e-3 and report.hold_reason is None and report.registration.converged

    settings = tmp_path / "settings.yaml"
    settings.write_text("task: view\nview:\n  primary_deg: 6\n  secondary_deg: 4\n")
    command = [str(programs / "angio-replay"), str(log_path), "--compare", "--tree", str(data / "hepatic-tace/tree.csv")]
    done = subprocess.run(command + ["--calibration", str(calibration), "--settings", str(settings)], capture_output=True, text=True)
    assert done.returncode == 0 and "40 of 40 logged commands are the same" in done.stdout, done.stdout + done.stderr


def test_a_frame_that_is_refused_moves_nothing(lab):
    tree, truth, _ = lab
    loop = angio.ServoLoop(tree, truth)
    report = loop.refuse(angio.SimulatedXray(tree, truth.carm, truth.T_dsa_cb).render(0, start_of(tree, truth)), "not now")
    assert report.hold_reason == "not now" and not report.observed and not report.command.velocity.any()
    loop.commit(report.command)


def test_a_machine_ignores_what_it_must_not_obey(lab):
    tree, truth, _ = lab
    arm = angio.SimulatedCArm(angio.CArmLimits(0.3), np.zeros(5))
    arm.obey(angio.CArmCommand(sequence=1, valid_for_us=2_000_000, velocity=[0.1, 0, 0, 0, 0]), 0)
    arm.advance(100_000)
    assert arm.ignored.bad_validity == 1 and not arm.state().velocity.any()
