#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs packages, configures and builds with optimisation into build/, the targets named or all; quick when there is
# nothing to do. Named targets are built without what only volumes and tests need (libvtk9-dev has half of all packages under it).
set -euo pipefail
cd "$(dirname "$0")/.."
.ci/install_packages.sh ${1:+demo}
if ! [ -f build/build.ninja ]; then
  cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release
elif [ /var/lib/dpkg/status -nt build/build.ninja ]; then
  cmake build  # Looks for what was installed since.
fi
NINJA_STATUS='@%f/%t ' cmake --build build --target "${@:-all}" | .ci/progress.sh
