#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Measures what the figures of the README are made of, and prints it. Build first (./test.sh or ./demo.sh).
#   examples/figures.sh [table1] [clinical] [seeds] [speed]      (all by default)
set -euo pipefail
cd "$(dirname "$0")/.."
bin=build/bin
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

table1() {
  echo "### 100 starts off by 2 deg / 5 mm (std per axis) on the hepatic tree, noise-free, the paper's Table I protocol"
  "$bin"/example-03-write-case-set --out "$work/cases" >/dev/null
  printf 'iterative_pnp: {neighbours_each_side: 0, spacing_px: 0, prior: covariance}\n' > "$work/covariance.yaml"
  printf 'iterative_pnp: {neighbours_each_side: 0, spacing_px: 0}\n' > "$work/paper.yaml"
  for prior in paper covariance; do
    for deformation in "" --nonrigid; do
      echo; echo "iterative_pnp $deformation, prior: $prior"
      "$bin"/angio-evaluate cases "$work/cases/cases.yaml" $deformation --settings "$work/$prior.yaml" --out "$work/$prior$deformation.json"
      for figure in rms_projection_residual_isocentre_mm rotation_deg centroid_mm; do
        echo "$figure: $(sed -n "/^   \"summary\"/,\$p" "$work/$prior$deformation.json" | grep -A6 "\"$figure\"" | grep -E 'mean|median|p75|p95' | tr -d '\n')"
      done
      sed -n '/^   "summary"/,$p' "$work/$prior$deformation.json" | grep '"gfr_nearest_5px_percent"'
    done
  done
}

clinical() {
  echo; echo "### 37 clinical catheter frames (hepatic-tace), no ground truth"
  "$bin"/angio-evaluate cases examples/data/hepatic-tace/cases.yaml
}

seeds() {
  echo; echo "### Closed and open loop, final error by seed"
  printf '| seed | closed loop: view [deg] | target [mm] | open loop: view [deg] | target [mm] |\n| --- | --- | --- | --- | --- |\n'
  for seed in 1 2 3 4 5 6 7 8 9 10; do
    "$bin"/angio-servo --simulate --seed "$seed" --out "$work/seed$seed" > "$work/seed$seed.txt"
    awk -v seed="$seed" '/^closed loop/ {c=$3" | "$4} /^open loop/ {o=$3" | "$4} END {print "| "seed" | "c" | "o" |"}' "$work/seed$seed.txt"
  done
}

speed() {
  echo; echo "### Time per stage, one thread"
  "$bin"/angio-benchmark --benchmark_min_time=0.5 2>/dev/null
}

for part in "${@:-table1 clinical seeds speed}"; do
  for one in $part; do "$one"; done
done
