# SPDX-License-Identifier: GPL-2.0-or-later
import re

import pytest


def blocks(root):
    return re.findall(r"```python\n(.*?)```", (root / "modules/python/README.md").read_text(), re.S)


@pytest.mark.parametrize("index", range(3))
def test_what_the_page_shows_runs(root, monkeypatch, index):
    monkeypatch.chdir(root)
    assert len(blocks(root)) == 3
    exec(compile(blocks(root)[index], f"README.md, block {index}", "exec"), {})
