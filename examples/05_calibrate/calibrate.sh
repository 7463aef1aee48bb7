#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# What is calibrating worth? A simulated C-arm that differs from its data sheet is driven to a view of a liver: once by
# the data sheet, once by what angio-calibrate finds out from X-ray images of a bead phantom and registered views of
# the anatomy. Build first (./demo.sh or ./test.sh).
#   examples/05_calibrate/calibrate.sh [folder] [seed]
set -euo pipefail
cd "$(dirname "$0")/../.."
bin=build/bin
out=${1:-calibration-output}
seed=${2:-1}
tree=examples/data/hepatic-tace/tree.csv
data_sheet=examples/data/hepatic-tace/carm.yaml

say() { printf '\n== %s\n\n' "$*"; }

say "A C-arm that nobody knows: beads before it, its joints, and views of the anatomy"
"$bin"/angio-calibrate simulate --out "$out/data" --seed "$seed"

say "K, from 20 X-ray images of the bead phantom"
"$bin"/angio-calibrate camera "$out/data/camera/views.yaml" --out "$out/camera.yaml" --report "$out/camera"

say "The arm: axes, encoders, table, source-detector distance, flex"
"$bin"/angio-calibrate geometry "$out/data/geometry/views.yaml" --camera "$out/camera.yaml" --out "$out/carm.yaml"

say "T_dsa_cb: where the pre-operative tree lies"
"$bin"/angio-calibrate hand-eye "$out/data/hand-eye/poses.yaml" --carm "$out/carm.yaml" --known-mount --out "$out/lab.yaml"

for belief in data_sheet lab; do
  calibration=$data_sheet
  [ "$belief" = lab ] && calibration=$out/lab.yaml
  say "To LAO 30, CRA 15 by ${calibration##*/}"
  "$bin"/angio-servo --simulate --tree "$tree" --truth "$out/data/truth/carm.yaml" --calibration "$calibration" \
    --out "$out/servo-by-$belief"
done
say "Pictures: $out/camera/index.html, $out/servo-by-data_sheet, $out/servo-by-lab"
