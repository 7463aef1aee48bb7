# SPDX-License-Identifier: GPL-2.0-or-later
"""Evaluation and calibration give what the programs write."""
import json
import re
import subprocess

import numpy as np
import pytest

import angio
from program import without_times


def cases_of(results, method):
    return {name: without_times(case) for name, case in results["methods"][method]["cases"].items()}


def test_cases(programs, data, tmp_path):
    cases, out = str(data / "static-phantom/cases.yaml"), tmp_path / "out.json"
    subprocess.run([str(programs / "angio-evaluate"), "cases", cases, "--method", "oriented_kernel", "--out", str(out)], check=True, capture_output=True)
    said, done = json.loads(out.read_text()), []
    found = angio.evaluate_cases(cases, progress=done.append)
    assert cases_of(found, "oriented_kernel") == cases_of(said, "oriented_kernel") and found["settings"] == said["settings"]
    assert done == [1, 2, 3, 4]


def test_simulation(programs, data, tmp_path):
    tree_path, out = str(data / "hepatic-tace/tree.csv"), tmp_path / "out.json"
    subprocess.run([str(programs / "angio-evaluate"), "simulation", "--tree", tree_path, "--trials", "4", "--filled", "0.5", "--noise-px", "1", "--spurious", "5",
                    "--out", str(out)], check=True, capture_output=True)
    said = json.loads(out.read_text())
    tree = angio.read_vessel_tree(tree_path)
    world = {"trials": 4, "filled": 0.5, "noise_px": 1, "spurious": 5}
    found = angio.evaluate_simulation([tree], simulation=world)
    assert cases_of(found, "oriented_kernel") == cases_of(said, "oriented_kernel")
    # One of its trials, taken out and registered by itself, is the same again.
    trial = angio.simulated_trial(tree, 2, world)
    alone = without_times(angio.Registration(tree).search(trial.views, trial.start).as_dict())
    third = cases_of(said, "oriented_kernel")[sorted(said["methods"]["oriented_kernel"]["cases"])[2]]
    # A simulation does not ask for what it is usable, nor for intervals.
    assert third.pop("usable_for") == [] and alone.pop("usable_for")
    assert third.pop("interval_90_mm") is None and alone.pop("interval_90_mm")
    assert alone == third
    error = angio.pose_error(tree, trial.views[0].camera, trial.start, trial.truth)
    assert error.mtre_m > 1e-4


def test_catheter(programs, data, tmp_path):
    """Settings and options reach the sequence too: of a rigid tree the results differ."""
    folder, cases, out = data / "hepatic-tace", str(tmp_path / "cases.yaml"), tmp_path / "out.json"
    frames = "".join(f"  - {{name: '{k}', centerline: {folder}/frames/c000{k}.csv, initial_pose: {folder}/nominal_pose.yaml}}\n" for k in range(6))  # For speed.
    (tmp_path / "cases.yaml").write_text(f"sequence: true\ntree: {folder}/tree.csv\ncamera: {folder}/camera.yaml\ncases:\n{frames}")
    subprocess.run([str(programs / "angio-evaluate"), "catheter", cases, "--learn-frames", "3", "--rigid", "--no-times", "--out", str(out)], check=True, capture_output=True)
    said, done = json.loads(out.read_text()), []
    found = angio.evaluate_catheter(cases, learn_frames=3, rigid=True, progress=done.append)
    for way in found["ways"].values():
        way["summary"].pop("time_ms", None)
    assert found == said and done == [1, 2, 3] and len(found["ways"]) == 3
    with pytest.raises(angio.InputError, match="learn_frames.*0.*1"):
        angio.evaluate_catheter(cases, learn_frames=0)
    with pytest.raises(angio.InputError, match="deformation_std_mm"):
        angio.evaluate_catheter(cases, settings={"sequence": {"deformation_std_mm": -1}})


def test_catheter_runs(programs, data, tmp_path):
    tree, out = str(data / "hepatic-tace/tree.csv"), tmp_path / "out.json"
    options = ["--runs", "2", "--frames", "3", "--seed", "5", "--rotation-deg", "1", "--translation-mm", "10", "--deformation-mm", "1", "--breath-mm", "2",
               "--beside-mm", "0.5", "--noise-px", "0.8"]
    subprocess.run([str(programs / "angio-evaluate"), "catheter-runs", "--tree", tree, *options, "--no-times", "--out", str(out)], check=True, capture_output=True)
    said, done = json.loads(out.read_text()), []
    found = angio.evaluate_catheter_runs([tree], 2, frames=3, seed=5, rotation_deg=1, translation_mm=10, deformation_mm=1, breath_mm=2, beside_mm=0.5, noise_px=0.8,
                                         progress=done.append)
    assert found == said and done == [1, 2] and found["summary"]["frames"] == 6
    with pytest.raises(angio.InputError, match="trees"):
        angio.evaluate_catheter_runs([])


def test_registration_calibration(programs, data, tmp_path):
    """T_dsa_cb of registered runs: the file is the program's, and so are the predictions of views that are left out."""
    cases, by_program, by_module = str(data / "static-phantom/cases.yaml"), tmp_path / "program.yaml", tmp_path / "module.yaml"
    options = ["--angle-sigma-deg", "0.7", "--run", "im2", "--leave-one-out"]
    done = subprocess.run([str(programs / "angio-calibrate"), "registration", cases, *options, "--out", str(by_program)], check=True, capture_output=True, text=True)
    found = angio.calibrate_registration_cases(cases, run="im2", leave_one_out=True, settings={"angle_std_deg": 0.7}, out=str(by_module))
    assert without_date(by_module) == without_date(by_program)
    rows = done.stdout.split("left out  ")[1].splitlines()[1:]
    told = [[view.name, f"{np.degrees(view.rotation_rad):.3f}", f"{np.degrees(view.moved_rad):.3f}"] for view in found["leave_one_out"]]
    assert told == [row.split() for row in rows] and len(told) == 4
    assert set(found["statuses"].values()) == {"converged"} and found["not_registered"] == "" and len(found["views"]) == 4
    translation_mm = re.search(r"translation_mm: \[(.*?)\]", by_module.read_text()).group(1).split(",")
    assert np.allclose(1e3 * found["T_dsa_cb"][:3, 3], np.array(translation_mm, float), rtol=1e-12)  # Of that run, as written.
    assert abs(found["runs"]["im2"]["shift_m"][1]) > 1e-3 and found["record"]["residual_rms"] > 0
    with pytest.raises(angio.InputError, match="run.*im9"):
        angio.calibrate_registration_cases(cases, run="im9")


def test_camera_calibration(data):
    """Zhang's own views: points as arrays and the file give the same camera, which is that of his paper."""
    folder = data / "calib-zhang"
    by_file = angio.calibrate_camera_views(str(folder / "views.yaml"), settings={"distortion": "radial", "skew": True})
    assert abs(by_file.camera.fx_px - 832.5) < 1 and abs(by_file.camera.cy_px - 206.6) < 1  # Zhang 2000, table 1: 832.50, 206.59.
    assert len(by_file.T_camera_phantom) == 5 and len(by_file.record["views"]) == 5


def test_camera_calibration_of_arrays():
    """Views of a known camera give that camera."""
    random = np.random.default_rng(1)
    camera = angio.XrayCamera(1024, 1024, 4000, 4000, 512, 500)
    points = random.uniform(-0.06, 0.06, (40, 3))
    views = []
    for _ in range(6):
        T = angio.exp_se3([0, 0, 0, *random.normal(0, 0.4, 3)])
        seen = camera.project(points @ T[:3, :3].T + [0, 0, 0.8])
        views.append((list(range(40)), seen))
    found = angio.calibrate_camera(points, views, 1024, 1024)
    assert abs(found.camera.fx_px - 4000) < 1e-3 and abs(found.camera.cy_px - 500) < 1e-3


def test_hand_eye():
    """Exact poses give the transform that they were made with."""
    random = np.random.default_rng(2)
    X, Z = angio.exp_se3(random.normal(0, 0.3, 6)), angio.exp_se3(random.normal(0, 0.3, 6))
    hands = [angio.exp_se3(random.normal(0, 0.5, 6)) for _ in range(12)]
    cameras = [np.linalg.inv(hand @ X) @ Z for hand in hands]
    found = angio.calibrate_hand_eye(hands, cameras)
    assert np.allclose(found["T_hand_camera"], X, atol=1e-6) and np.allclose(found["T_base_object"], Z, atol=1e-6)


@pytest.fixture(scope="module")
def simulated(programs, tmp_path_factory):
    """Views and poses of a simulated C-arm, and its camera, by the programs."""
    folder = tmp_path_factory.mktemp("calibration")

    def calibrate(*options):
        subprocess.run([str(programs / "angio-calibrate"), *map(str, options)], check=True, capture_output=True)

    calibrate("simulate", "--images", "none", "--out", folder / "data")
    calibrate("camera", folder / "data/camera/views.yaml", "--out", folder / "camera.yaml")
    return folder, calibrate


def without_date(path):
    return [line for line in path.read_text().splitlines() if "date" not in line]


def test_geometry_and_hand_eye_of_a_carm(simulated):
    """Files are those of angio-calibrate, but for their dates, and T_dsa_cb is what the loop reads of them."""
    folder, calibrate = simulated
    views, camera, poses = folder / "data/geometry/views.yaml", folder / "camera.yaml", folder / "data/hand-eye/poses.yaml"
    calibrate("geometry", views, "--camera", camera, "--out", folder / "carm.yaml")
    found = angio.calibrate_geometry_views(str(views), str(camera))
    found.write(str(folder / "carm-python.yaml"))
    assert without_date(folder / "carm-python.yaml") == without_date(folder / "carm.yaml")
    assert found.record["residual_rms"] > 0 and len(found.views) == len(found.record["views"])
    assert found.carm.source_isocenter_distance_m == pytest.approx(0.78, abs=0.05)
    rigid = angio.calibrate_geometry_views(str(views), str(camera), settings={"geometry": {"flex": "none"}})
    assert not any(name.startswith("flex") for name in rigid.record["parameters"])
    old = folder / "old-camera.yaml"
    old.write_text(re.sub(r"date: .*", "date: 2001-01-01T00:00:00Z", camera.read_text()))
    with pytest.warns(UserWarning, match="days"):
        angio.calibrate_geometry_views(str(views), str(old))

    carm = str(folder / "carm.yaml")
    calibrate("hand-eye", poses, "--carm", carm, "--known-mount", "--out", folder / "lab.yaml")
    patient = angio.calibrate_hand_eye_poses(str(poses), carm=carm, out=str(folder / "lab-python.yaml"), settings={"mount": "identity"})
    assert without_date(folder / "lab-python.yaml") == without_date(folder / "lab.yaml")
    assert np.allclose(angio.read_carm_calibration(str(folder / "lab.yaml")).T_dsa_cb, patient["T_dsa_cb"], atol=1e-9)
    truth = angio.read_carm_calibration(str(folder / "data/truth/carm.yaml")).T_dsa_cb
    off = angio.log_se3(np.linalg.inv(truth) @ patient["T_dsa_cb"])
    assert np.degrees(np.linalg.norm(off[3:])) < 0.5 and np.linalg.norm(off[:3]) < 5e-3
    with pytest.raises(angio.InputError, match="out.*needs carm"):
        angio.calibrate_hand_eye_poses(str(poses), out=str(folder / "none.yaml"))
