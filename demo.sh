#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs, builds, and drives a simulated C-arm to a view of a real liver's arteries by what its X-ray images show.
# Options are passed on: ./demo.sh --seed 3 --view-primary-deg -20
set -euo pipefail
cd "$(dirname "$0")"
.ci/build.sh
exec build/bin/angio-servo --simulate --out demo-output "$@"
