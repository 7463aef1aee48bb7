# SPDX-License-Identifier: GPL-2.0-or-later
"""A catheter's controller, stepped from Python: it steers, and angio-replay makes the same commands of its log, bit for bit."""
import subprocess

import numpy as np
import pytest

import angio

PERIOD_US = 66_667
SETTINGS = {"roadmap_frames": 2}


@pytest.fixture
def lab(small_lab, tmp_path):
    """A tree and a C-arm as its calibration says, 256 pixels a side, for speed; a catheter 30 mm inside branch 0."""
    tree, truth = small_lab
    path = tmp_path / "carm.yaml"
    angio.write_carm_calibration(str(path), truth)
    return tree, angio.read_carm_calibration(str(path)), path


def test_steers_a_catheter(lab, programs, data, tmp_path):
    tree, calibration, path = lab
    start = angio.TreeLocation(branch=0, arc_m=0.03)
    target = angio.TreeLocation(branch=13, arc_m=0.01)
    joints = calibration.carm.joints_for(angio.ViewAngles(), (calibration.T_dsa_cb @ [*tree.centroid, 1])[:3])
    xray = angio.SimulatedXray(tree, calibration.carm, calibration.T_dsa_cb, settings={"bolus": {"enabled": True, "trigger": "demand"}})
    catheter = angio.SimulatedCatheter(tree, start)
    xray.show(catheter)
    controller = angio.CatheterController(tree, calibration, start, target, SETTINGS)
    log_path = tmp_path / "run.lcm"
    moved = searched = 0
    xray.begin_injection(0)
    with angio.LogWriter(str(log_path)) as log:
        for k in range(120):
            now_us = k * PERIOD_US
            if k == 30:
                xray.end_injection(now_us)
            catheter.advance(now_us)
            frame = xray.render(now_us, joints)
            said = angio.CatheterInput(time_us=now_us, frame_sequence=frame.sequence, drive=catheter.state(),
                                       arm=angio.CArmState(time_us=now_us, sequence=k + 1, joints=joints))
            report = controller.propose(frame, said)
            if k == 110:  # As when somebody stops the drive.
                report = angio.CatheterController.withheld(report, "stopped")
                said.verdict = angio.ServoVerdict.taken_back
            assert abs(report.command.insertion_speed_m_per_s) <= abs(report.answer.command.insertion_speed_m_per_s)  # Cut, never more.
            controller.commit(report.command)
            controller.learn()
            catheter.obey(report.command, now_us + 60_000)
            moved += report.command.insertion_speed_m_per_s != 0
            searched += report.belief is not None
            for channel, message in (("XRAY_FRAME", frame), ("CATHETER_INPUT", said), ("CATHETER_COMMAND", report.command)):
                log.write(channel, message)
    # It had its roadmap, found the catheter along it, and pushed it along; a pixel is 0.7 mm at the isocentre.
    assert searched > 20 and moved > 10 and controller.navigation not in (angio.NavigationState.waiting, angio.NavigationState.given_up)
    assert catheter.truth().path_m > 0.035 and report.catheter_px.shape[1] == 2
    assert np.linalg.norm(report.belief.tip.tip_model - catheter.truth().tip_model) < 3e-3
    assert report.belief.status == angio.BeliefStatus.seen and report.registration.converged and report.view_request is None
    assert report.answer.state == report.state and report.answer.why == report.why and angio.NavigationAnswer.another_view.__doc__
    assert catheter.truth().max_push_n <= 0.8

    settings = tmp_path / "settings.yaml"
    settings.write_text("roadmap_frames: 2\n")
    command = [str(programs / "angio-replay"), str(log_path), "--compare", "--machine", "catheter", "--to-branch", "13", "--tree", str(data / "hepatic-tace/tree.csv")]
    done = subprocess.run(command + ["--calibration", str(path), "--settings", str(settings)], capture_output=True, text=True)
    assert done.returncode == 0 and "120 of 120 logged commands are the same" in done.stdout, done.stdout + done.stderr


def test_a_frame_that_is_refused_moves_nothing(lab):
    tree, calibration, _ = lab
    controller = angio.CatheterController(tree, calibration, angio.TreeLocation(arc_m=0.03), angio.TreeLocation(branch=13))
    joints = np.zeros(5)
    report = controller.refuse(angio.SimulatedXray(tree, calibration.carm, calibration.T_dsa_cb).render(0, joints), "not now")
    assert report.hold_reason == "not now" and report.belief is None and report.command.insertion_speed_m_per_s == 0
    controller.commit(report.command)


def test_wrong_input_is_refused(lab):
    tree, calibration, _ = lab
    inside = angio.TreeLocation(arc_m=0.03)
    with pytest.raises(angio.InputError, match="navigator: target"):
        angio.CatheterController(tree, calibration, inside, angio.TreeLocation(branch=100000))
    with pytest.raises(angio.InputError, match="max_force_n"):
        angio.CatheterController(tree, calibration, inside, angio.TreeLocation(branch=13), {"navigator": {"max_force_n": -1}})
    with pytest.raises(angio.InputError, match="catheter start"):
        angio.SimulatedCatheter(tree, angio.TreeLocation(branch=100000))
