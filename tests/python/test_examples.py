# SPDX-License-Identifier: GPL-2.0-or-later
import os
import subprocess
import sys


def test_register_and_plot(root, data, tmp_path):
    done = subprocess.run([sys.executable, str(root / "examples/10_python/register_and_plot.py"), str(data / "static-phantom"), str(tmp_path)],
                          capture_output=True, text=True, env={**os.environ, "MPLCONFIGDIR": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("converged: ") and "view" not in done.stderr
    for name in ("registered.png", "uncertainty.png"):
        assert (tmp_path / name).stat().st_size > 20_000  # A picture with something in it.
