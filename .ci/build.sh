#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs packages, configures and builds with optimisation into build/, the targets named or all; quick when there is
# nothing to do.
set -euo pipefail
cd "$(dirname "$0")/.."
.ci/install_packages.sh
[ -f build/build.ninja ] || cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release
NINJA_STATUS='@%f/%t ' cmake --build build --target "${@:-all}" | .ci/progress.sh
