#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# install_packages.sh [demo]: installs the Debian packages that building, testing and running need, or only those that
# demo.sh needs; does nothing when all are there.
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config
  libvisp-core-dev libvisp-visual-features-dev libvisp-vs-dev libvisp-robot-dev libvisp-vision-dev libvisp-gui-dev
  libopencv-dev libeigen3-dev libceres-dev libnanoflann-dev libhwy-dev
  liblcm-dev liblcm-bin libopenigtlink-dev
  libyaml-cpp-dev nlohmann-json3-dev libcli11-dev
  libexpat1-dev libdcmtk-dev libpng-dev libtiff-dev libjpeg62-turbo-dev zlib1g-dev libzstd-dev libssl-dev
  libgtest-dev libgmock-dev libbenchmark-dev
)
# Volumes, the Python module, the API reference, and tests.
[ "${1:-}" = demo ] || packages+=(libinsighttoolkit5-dev libvtk9-dev doxygen python3
  python3-dev pybind11-dev python3-numpy python3-matplotlib python3-pytest)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q "ok installed" || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "cannot install ${missing[*]}: not root, and there is no sudo" >&2; exit 1; }
  root=(sudo)
fi
echo "installing ${#missing[@]} Debian packages: ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
if ! { "${root[@]}" apt-get update && "${root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y --no-install-recommends "${missing[@]}"; } >"$log" 2>&1; then
  echo "cannot install ${missing[*]}: $(grep -E '^(E|Err)' "$log" | tail -n 1)" >&2
  exit 1
fi
