#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs, builds everything, and runs the whole test suite. Options are passed on to CTest: ./test.sh -R registration
set -euo pipefail
cd "$(dirname "$0")"
.ci/build.sh
exec ctest --test-dir build --output-on-failure -j "$(nproc)" "$@"
