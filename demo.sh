#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs, builds what it runs, and shows a registration and three closed loops, one after another: a phantom's tree on
# a real X-ray run; and on a real liver's arteries, by what simulated X-ray images show, a C-arm reaches a view, its table
# keeps a breathing target in the middle, a catheter goes to a branch. Options are passed on to the first loop:
# ./demo.sh --seed 3 --view-primary-deg -20
set -euo pipefail
cd "$(dirname "$0")"
out=demo-output
phantom=examples/data/static-phantom

.ci/build.sh angio-register  # The first picture does not wait for what the loops need.
printf '\n== register: a coronary phantom on a frame of a real X-ray run, from where the tags of DICOM put it\n\n'
mkdir -p "$out"
build/bin/angio-register --tree $phantom/tree.csv --image $phantom/dicom/im5.dcm --frame 2 \
  --t-dsa-cb $phantom/dicom/t_dsa_cb.yaml --overlay "$out/registered.png"
printf 'Picture: %s/registered.png\n\n' "$out"

.ci/build.sh demo

printf '\n== view: from straight through to LAO 30, CRA 15, with a calibration that is wrong by 3 deg and 10 mm\n\n'
build/bin/angio-servo --simulate --out "$out" --film "$out/view.mp4" "$@"

printf '\n== centre: a breath of 15 mm and a heartbeat, held in the middle by the table alone\n\n'
build/bin/angio-servo --simulate --task centre --settings examples/08_tasks/centre.yaml --out "$out/centre" \
  --film "$out/centre.mp4"

printf '\n== navigate: a catheter to a branch of the tree, over views that it asks the C-arm for; both loops on one bus\n\n'
build/bin/angio-simulate-loop navigate --targets 1 --out "$out/navigate.json" --film "$out/navigate.mp4"
printf '\nFilms: %s/view.mp4, centre.mp4, navigate.mp4\n' "$out"
