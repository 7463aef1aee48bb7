# SPDX-License-Identifier: GPL-2.0-or-later
import re
import subprocess

import angio


def blocks(root):
    return re.findall(r"```python\n(.*?)```", (root / "modules/python/README.md").read_text(), re.S)


def test_what_the_page_shows_runs(root, programs, monkeypatch, tmp_path):
    """One block after the other, beside the examples and what angio-calibrate has made; a later one may go on with an earlier one's names."""
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    for words in (["simulate", "--images", "none", "--out", "data"], ["camera", "data/camera/views.yaml", "--out", "camera.yaml"]):
        subprocess.run([str(programs / "angio-calibrate"), *words], check=True, capture_output=True)
    assert len(blocks(root)) == 6
    names = {}
    for index, block in enumerate(blocks(root)):
        exec(compile(block, f"README.md, block {index}", "exec"), names)
    assert angio.read_carm_calibration("lab.yaml").T_dsa_cb.shape == (4, 4)
