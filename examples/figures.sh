#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Measures what the figures of the READMEs are made of, and prints it. Build first (./test.sh or ./demo.sh).
#   examples/figures.sh [rows] [worlds] [certificates] [turning] [deformed_view] [loop_worlds] [seeing] [volumes] [paper] [table1] [clinical] [phantom] [seeds] [calibration] [servoing] [catheter_alone] [navigating] [microcatheter] [soak] [speed] [sheet]
# Without a name: rows, worlds, seeing, paper, table1, seeds, calibration, servoing and speed. With ANGIO_SHARED_DATA naming a folder that holds
# brava/*.swc, the rows run on those trees too; TRIALS=40 runs fewer. navigating (part of servoing) takes an aortic arch
# from steve-dualdevicenav there, or from ARCH; TARGETS=6 runs fewer, FIRST_SEED=1 the journeys that settings were tuned on.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=build/bin
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Arteries of brains that ANGIO_SHARED_DATA may have.
brains=()
for one in BG0002 BG18 BH0006 BH0014; do
  [ -f "${ANGIO_SHARED_DATA:-}/brava/$one.swc" ] && brains+=(--tree "$ANGIO_SHARED_DATA/brava/$one.swc")
done

table1() {
  echo "### 100 starts off by 2 deg / 5 mm (std per axis) on the hepatic tree, noise-free, the paper's Table I protocol"
  "$bin"/example-03-write-case-set --out "$work/cases" >/dev/null
  printf 'iterative_pnp: {neighbours_each_side: 0, spacing_px: 0, prior: covariance}\n' > "$work/covariance.yaml"
  printf 'iterative_pnp: {neighbours_each_side: 0, spacing_px: 0}\n' > "$work/paper.yaml"
  for prior in paper covariance; do
    for deformation in "" --nonrigid; do
      echo; echo "iterative_pnp $deformation, prior: $prior"
      "$bin"/angio-evaluate cases "$work/cases/cases.yaml" --method iterative_pnp $deformation --settings "$work/$prior.yaml" --out "$work/$prior$deformation.json"
      for figure in rms_projection_residual_isocentre_mm rotation_deg centroid_mm; do
        echo "$figure: $(sed -n "/^   \"summary\"/,\$p" "$work/$prior$deformation.json" | grep -A6 "\"$figure\"" | grep -E 'mean|median|p75|p95' | tr -d '\n')"
      done
      sed -n '/^   "summary"/,$p' "$work/$prior$deformation.json" | grep '"gfr_nearest_5px_percent"'
    done
  done
}

rows() {
  local trees=(--tree examples/data/hepatic-tace/tree.csv --tree examples/data/static-phantom/tree.csv "${brains[@]}")
  local simulate=("$bin"/angio-evaluate simulation "${trees[@]}" --method iterative_pnp,iterative_pnp:best,oriented_kernel --trials "${TRIALS:-100}" --seed 11)
  echo "### Registration on simulated views, all methods on the same trials: ${#trees[@]} / 2 trees"
  echo; echo "noise-free, 2 deg / 5 mm"; "${simulate[@]}"
  echo; echo "noise-free, 5 deg / 10 mm"; "${simulate[@]}" --rotation-std-deg 5 --translation-std-mm 10
  echo; echo "half of the tree in view, 1 px noise, 5 spurious curves, 2 deg / 5 mm"
  "${simulate[@]}" --visible-fraction 0.5 --noise-px 1 --spurious 5
  echo; echo "the same, two views, 5 deg / 10 mm"
  "${simulate[@]}" --visible-fraction 0.5 --noise-px 1 --spurious 5 --views 2 --rotation-std-deg 5 --translation-std-mm 10
  for one in 3 5; do
    echo; echo "smooth deformation of $one mm rms, nonrigid, 2 deg / 5 mm"
    "${simulate[@]}" --deformation-rms-mm "$one" --nonrigid
  done
  clinical
  phantom
}

# Whole brains and measured motions of lungs in two halves: nothing was tuned on the second.
halves=("tuned on:BG0002 BG10 BH0006 BH0021 BH0032:case_002 case_054 case_056 case_097"
        "held out:BG05 BG18 BH0014 BH0026 BH0037:case_105 case_107 case_109 case_111 case_113")

# Depth by a turn of the C-arm, of brains that are bent, at rest and breathing. Needs ANGIO_SHARED_DATA.
deformed_view() {
  local seed
  for seed in 1 2 3 4 5 6 7 8; do
    echo; echo "### view of a bent liver by what a turn told, seed $seed"
    "$bin"/angio-servo --simulate --autostart --task view --settings examples/08_tasks/deformed_view.yaml --seed "$seed" \
      --out "$work/deformed_view" | grep -E "registered|view \[deg\]|loop "
  done
}

# Certificates of trees that the project has itself; those of brains are among the worlds.
certificates() {
  local tree one
  printf 'starts: {box_rotation_deg: 45, box_translation_mm: 60}\n' > "$work/box.yaml"
  for tree in hepatic-tace static-phantom; do
    for one in 1 0.6; do
      echo; echo "### $tree, +-45 deg / +-60 mm, $one of the tree in view, certified, 30 s"
      "$bin"/angio-evaluate simulation --tree "examples/data/$tree/tree.csv" --noise-px 1 --spurious 5 --seed "${SEED:-61}" \
        --trials "${CERTIFIED:-100}" --method oriented_kernel --rotation-std-deg 15 --translation-std-mm 20 \
        --settings "$work/box.yaml" --visible-fraction "$one" --certify
    done
  done
}

# The loop in the clinic's worlds: contrast agent in a part of the vessels, and vessels that a measured motion deforms.
loop_worlds() {
  local world one runs=${RUNS:-20} first=${FIRST_SEED:-101} lungs="${ANGIO_SHARED_DATA:-}/lung-motion"
  for world in "--filled 0.5" "--filled 0.3" "--missing-branches 0.3"; do
    for one in view centre; do
      echo; echo "### $one, $world, $runs runs from seed $first"
      # shellcheck disable=SC2086
      "$bin"/angio-simulate-loop "$one" --runs "$runs" --first-seed "$first" $world --threads "${THREADS:-1}"
    done
  done
  if [ ! -d "$lungs" ]; then echo "### measured motions: skipped, ANGIO_SHARED_DATA has no lung-motion"; return; fi
  for one in ${LUNGS:-case_105 case_107 case_109 case_111 case_113}; do
    echo; echo "### view by what a turn told, the liver deformed by 3 mm rms as $one"
    "$bin"/angio-servo --simulate --task view --settings examples/08_tasks/deformed_view.yaml --seed "$first" \
      --deformation-mm 3 --deformation-field "$lungs/$one.csv" --out "$work/loop_worlds" | grep -E "registered|view \\[deg\\]|loop "
  done
}

turning() {
  local half one bend breath shared="${ANGIO_SHARED_DATA:-}"
  if [ ! -f "$shared/brava/BG05.swc" ]; then echo "### turning: skipped, ANGIO_SHARED_DATA has no brava/*.swc"; return; fi
  for half in "${halves[@]}"; do
    local name trees lungs bent=()
    IFS=: read -r name trees lungs <<< "$half"
    for one in $trees; do bent+=(--tree "$shared/brava/$one.swc"); done
    for one in $lungs; do bent+=(--deformation-field "$shared/lung-motion/$one.csv"); done
    for bend in 3 5; do
      for breath in 0 15; do
        echo; echo "### A turn of 6 deg within 1 s, brains bent by $bend mm rms, breathing $breath mm, $name"
        "$bin"/angio-evaluate simulation "${bent[@]}" --method oriented_kernel --nonrigid --seed "${SEED:-11}" \
          --trials "${TRIALS:-40}" --noise-px 1 --spurious 5 --deformation-mm "$bend" --turn-deg 6 --turn-s 1 --breath-mm "$breath"
      done
    done
  done
}

# Contrast agent in a part of the vessels, and bent trees. Needs ANGIO_SHARED_DATA.
worlds() {
  local half one shared="${ANGIO_SHARED_DATA:-}" trials=${TRIALS:-200}
  if [ ! -f "$shared/brava/BG05.swc" ]; then echo "### worlds: skipped, ANGIO_SHARED_DATA has no brava/*.swc"; return; fi
  for half in "${halves[@]}"; do
    local name trees lungs
    IFS=: read -r name trees lungs <<< "$half"
    local simulate=("$bin"/angio-evaluate simulation --noise-px 1 --seed "${SEED:-11}")
    local fields=()
    for one in $trees; do simulate+=(--tree "$shared/brava/$one.swc"); done
    for one in $lungs; do fields+=(--deformation-field "$shared/lung-motion/$one.csv"); done
    local ours=("${simulate[@]}" --trials "$trials" --spurious 5 --method oriented_kernel)
    local wide=(--rotation-std-deg 5 --translation-std-mm 10)
    echo; echo "### Contrast agent in a part of the vessels, whole brains, $name"
    echo; echo "half filled, 2 deg / 5 mm"; "${ours[@]}" --filled 0.5
    echo; echo "the same, iterative_pnp as it is"
    "${simulate[@]}" --trials 50 --spurious 5 --method iterative_pnp --filled 0.5
    echo; echo "the same, iterative_pnp at its best: 16 starts, prior as a covariance, what leaves the image ignored"
    "${simulate[@]}" --trials 50 --spurious 5 --method iterative_pnp:best --filled 0.5
    echo; echo "the same, the methods that the paper compares with"
    "${simulate[@]}" --trials 50 --spurious 5 --method nicp,cvo,dt_icp --filled 0.5
    echo; echo "half filled, 5 deg / 10 mm"; "${ours[@]}" --filled 0.5 "${wide[@]}"
    echo; echo "30 % filled, 5 deg / 10 mm"; "${ours[@]}" --filled 0.3 "${wide[@]}"
    echo; echo "all filled, 15 deg / 30 mm"; "${ours[@]}" --rotation-std-deg 15 --translation-std-mm 30
    echo; echo "the same, 60 % of the tree in view"
    "${ours[@]}" --rotation-std-deg 15 --translation-std-mm 30 --visible-fraction 0.6
    echo; echo "half filled, 2 deg / 5 mm, from X-ray images"
    "$bin"/angio-evaluate simulation $(for one in $trees; do echo --tree "$shared/brava/$one.swc"; done) --seed 11 \
      --trials "$((trials / 2))" --spurious 5 --method oriented_kernel --from images --filled 0.5
    printf 'starts: {box_rotation_deg: 45, box_translation_mm: 60}\n' > "$work/box.yaml"
    echo; echo "half filled, 15 deg / 30 mm"
    "${simulate[@]}" --trials "$((trials / 5))" --spurious 5 --method oriented_kernel --filled 0.5 --rotation-std-deg 15 --translation-std-mm 30
    echo; echo "half filled, +-45 deg / +-60 mm: searched as a box"
    "${simulate[@]}" --trials "$((trials / 8))" --spurious 5 --method oriented_kernel --filled 0.5 --rotation-std-deg 15 \
      --translation-std-mm 20 --settings "$work/box.yaml"
    for one in 1 0.6; do
      echo; echo "+-45 deg / +-60 mm, $one of the tree in view: searched as a box"
      "${ours[@]}" --rotation-std-deg 15 --translation-std-mm 20 --settings "$work/box.yaml" --visible-fraction "$one"
      echo; echo "the same, certified, two threads, 30 s"
      "${simulate[@]}" --trials "${CERTIFIED:-10}" --spurious 5 --method oriented_kernel --rotation-std-deg 15 \
        --translation-std-mm 20 --settings "$work/box.yaml" --visible-fraction "$one" --certify
    done
    echo; echo "the liver from X-ray images, 0.6 of it in view: searched as a box"
    "$bin"/angio-evaluate simulation --tree examples/data/hepatic-tace/tree.csv --seed "${SEED:-11}" --trials 40 \
      --method oriented_kernel --from images --visible-fraction 0.6 --rotation-std-deg 15 --translation-std-mm 20 \
      --settings "$work/box.yaml"
    for one in 1 3 5; do
      echo; echo "bent by $one mm rms, measured motion of lungs, rigid fit, 2 deg / 5 mm"
      "${ours[@]}" "${fields[@]}" --deformation-mm "$one"
      echo; echo "the same, nonrigid"
      "${ours[@]}" "${fields[@]}" --deformation-mm "$one" --nonrigid
      echo; echo "the same, the belief as wide as the starts are drawn"
      printf 'oriented_kernel: {prior_rotation_std_deg: 2, prior_translation_std_mm: 5}\n' > "$work/belief.yaml"
      "${ours[@]}" "${fields[@]}" --deformation-mm "$one" --nonrigid --settings "$work/belief.yaml"
      [ "$one" = 1 ] || { echo; echo "the same, two views"; "${ours[@]}" "${fields[@]}" --deformation-mm "$one" --nonrigid --views 2; }
      echo; echo "the same, one view, half of the tree in it"
      "${simulate[@]}" --trials "$((trials / 2))" --spurious 5 --method oriented_kernel "${fields[@]}" --deformation-mm "$one" \
        --nonrigid --visible-fraction 0.5
      echo; echo "the same, the ends of a turn of the C-arm by 6 deg, the patient at rest"
      "${ours[@]}" "${fields[@]}" --deformation-mm "$one" --nonrigid --views 2 --turn-deg 6
    done
  done
}

paper() {
  echo; echo "### The paper's Tables I and III"
  "$bin"/angio-evaluate paper --trials "${TRIALS:-100}"
  echo; echo "the methods it compares with, at other settings"
  "$bin"/angio-evaluate paper --trials "${TRIALS:-100}" --method nicp:source,cvo:source,dt_icp:l2
  echo; echo "Table II's analogue, parts of the tree in view, losses"
  "$bin"/angio-evaluate paper --table 2 --figure visible-fraction --trials "${REAL_TRIALS:-40}" \
    --method automask,pairwise_dnn,rgrb,dt_icp,nicp,cvo,iterative_pnp:paper,iterative_pnp:huber,iterative_pnp,iterative_pnp:best,oriented_kernel
  "$bin"/angio-evaluate paper --figure loss --figure 3d-3d --trials "${TRIALS:-100}"
  local harder
  for harder in "--spurious 5 --noise-px 1" "--filled 0.5" "--visible-fraction 0.5"; do
    echo; echo "the kernel, Huber's loss and the best, starts off by 2 deg / 5 mm, $harder"
    "$bin"/angio-evaluate simulation --tree examples/data/hepatic-tace/tree.csv --model-axes lip --seed 1 $harder \
      --trials "${TRIALS:-100}" --method iterative_pnp:paper,iterative_pnp:huber,iterative_pnp:best
  done
}

clinical() {
  local deformation
  echo; echo "### 37 clinical catheter frames (hepatic-tace), no ground truth"
  for deformation in "" --nonrigid; do
    echo; echo "$deformation"
    "$bin"/angio-evaluate cases examples/data/hepatic-tace/cases.yaml --method iterative_pnp,oriented_kernel $deformation --out "$work/clinical.json"
    for figure in mean_image_residual_px; do
      grep -A6 "\"$figure\": {" "$work/clinical.json" | grep '"mean"' | sed "s/^ */$figure, mean over frames: /"
    done
    echo "frames of use for centre: $(grep -c '"centre"' "$work/clinical.json" || true)"
  done
  echo; echo "the baseline, each frame for itself"
  cp -r examples/data/hepatic-tace "$work/frames-alone"
  sed -i 's/^sequence: true$/sequence: false/' "$work/frames-alone/cases.yaml"
  for deformation in "" --nonrigid; do
    "$bin"/angio-evaluate cases "$work/frames-alone/cases.yaml" --method iterative_pnp $deformation
  done
  echo; echo "the catheter's tip in the tree: all frames at once, frame by frame, and what the published programs reached"
  "$bin"/angio-evaluate catheter examples/data/hepatic-tace/cases.yaml
  catheter_runs
}

# Trees registered by a simulated catheter alone: a liver by two seeds, and the brains in their halves.
catheter_runs() {
  local half mm name trees lungs one
  for mm in 0 3 5; do
    for one in 1 21; do
      echo; echo "### catheter runs, liver deformed by $mm mm, seed $one"
      "$bin"/angio-evaluate catheter-runs --tree examples/data/hepatic-tace/tree.csv --seed "$one" --deformation-mm "$mm"
    done
    [ -d "${ANGIO_SHARED_DATA:-}/brava" ] || continue
    for half in "${halves[@]}"; do
      IFS=: read -r name trees lungs <<< "$half"
      local options=()
      for one in $trees; do options+=(--tree "$ANGIO_SHARED_DATA/brava/$one.swc"); done
      echo; echo "### catheter runs, brains $name, deformed by $mm mm"
      "$bin"/angio-evaluate catheter-runs "${options[@]}" --deformation-mm "$mm"
    done
  done
}

phantom() {
  local method
  echo; echo "### Four runs of a static phantom, ${STARTS:-50} starts each within +-10 deg / +-20 mm"
  for method in iterative_pnp oriented_kernel; do
    echo; "$bin"/example-04-static-phantom --method "$method" --starts "${STARTS:-50}"
  done
  echo; echo "### The same phantom, which is rigid, by fits that may bend it"
  "$bin"/example-04-static-phantom --method oriented_kernel --nonrigid --starts 25
}

# From X-ray images: how well centrelines are found, and what becomes of the registration.
seeing() {
  local shared="${ANGIO_SHARED_DATA:-}" tree_of device seed
  local liver=(--tree examples/data/hepatic-tace/tree.csv --model-axes lip) coronary=(--tree examples/data/static-phantom/tree.csv)
  echo; echo "### Centrelines in simulated angiograms, vessels of 1-6 mm: liver, then coronary arteries"
  "$bin"/angio-evaluate extraction "${liver[@]}" --trials "${TRIALS:-40}" --seed 7
  echo "otsu: {cut: plain}" > "$work/plain.yaml"
  echo; echo "liver, Otsu's threshold of all pixels"
  "$bin"/angio-evaluate extraction "${liver[@]}" --trials 20 --seed 7 --extractor otsu --settings "$work/plain.yaml"
  echo; "$bin"/angio-evaluate extraction "${coronary[@]}" --trials "${TRIALS:-40}" --seed 7
  echo; echo "a tracked tree, expected 0.5 mm and 0.3 deg off (standard deviations): liver, with half of it filled, coronary arteries"
  local tracked=("$bin"/angio-evaluate extraction --trials "${TRIALS:-40}" --seed 7 --extractor ridge --predicted-mm 0.5)
  "${tracked[@]}" "${liver[@]}"
  echo; "$bin"/angio-evaluate extraction "${liver[@]}" --trials "${TRIALS:-40}" --seed 7 --extractor ridge --filled 0.5
  echo; "${tracked[@]}" "${liver[@]}" --filled 0.5
  echo; "${tracked[@]}" "${coronary[@]}"
  echo; echo "an injection that comes and goes with a catheter in the liver, then with a guidewire: frames alone, in their run, in one of a patient who breathes, in a run that is known to its end, in such a one that begins amid the injection"
  local run
  for device in catheter guidewire; do
    for run in "" "--frames-per-s 7.5" "--frames-per-s 7.5 --breath-mm 15" "--frames-per-s 7.5 --whole-run" "--frames-per-s 7.5 --whole-run --from-s 0.8"; do
      for seed in 11 7 53; do
        echo; echo "$device, seed $seed $run"
        # shellcheck disable=SC2086
        "$bin"/angio-evaluate extraction "${liver[@]}" --trials "${TRIALS:-40}" --seed "$seed" --extractor ridge --device "$device" $run
      done
    done
  done
  if [ ${#brains[@]} -gt 0 ]; then
    local brain_images=("$bin"/angio-evaluate extraction "${brains[@]}" --trials "${TRIALS:-40}" --seed 7)
    echo; echo "arteries of brains, then tracked, then on a grid as fine as the image"
    "${brain_images[@]}"
    echo; "${tracked[@]}" "${brains[@]}"; echo
    echo "ridge: {working_side_px: 1024}" > "$work/finer.yaml"
    "${brain_images[@]}" --extractor ridge --settings "$work/finer.yaml"
  fi
  echo; echo "### Centrelines in real frames: static phantom against the fitted tree, ARCADE against polygons"
  "$bin"/angio-evaluate extraction --cases examples/data/static-phantom/cases.yaml
  echo; echo "the same, Otsu's threshold of all pixels"
  "$bin"/angio-evaluate extraction --cases examples/data/static-phantom/cases.yaml --extractor otsu --settings "$work/plain.yaml"
  if [ -d "$shared/arcade-sample" ]; then
    echo; "$bin"/angio-evaluate extraction --annotations "$shared/arcade-sample/annotations.json"
    echo; echo "ten of its angiograms with all vessels marked by hand"
    examples/marked_angiograms.py "$bin"/angio-extract-centerline "$shared/arcade-sample/images"
  fi
  echo; echo "### Registration from images (the rows of registration: 1 px of noise is the dose's here, curves are wires)"
  for tree_of in liver coronary ${brains:+brains}; do
    local -n chosen=$tree_of
    local simulate=("$bin"/angio-evaluate simulation "${chosen[@]}" --from images --method oriented_kernel --trials "${TRIALS:-40}" --seed 11)
    echo; echo "$tree_of, 2 deg / 5 mm"; "${simulate[@]}"
    echo; echo "$tree_of, 5 deg / 10 mm"; "${simulate[@]}" --rotation-std-deg 5 --translation-std-mm 10
    echo; echo "$tree_of, half in view, 5 wires, 2 deg / 5 mm"; "${simulate[@]}" --visible-fraction 0.5 --spurious 5
    echo; echo "$tree_of, the same, two views, 5 deg / 10 mm"
    "${simulate[@]}" --visible-fraction 0.5 --spurious 5 --views 2 --rotation-std-deg 5 --translation-std-mm 10
  done
  for seed in 101 102; do
    echo; echo "coronary, half in view, 5 wires, 600 views of seed $seed: what fails"
    "$bin"/angio-evaluate simulation "${coronary[@]}" --from images --method oriented_kernel --trials 600 --seed "$seed" \
      --visible-fraction 0.5 --spurious 5 --out "$work/half.json" > /dev/null
    grep -E '"(success_mtre_2mm|failed_and_noticed|failed_and_trusted)_percent"' "$work/half.json"
  done
  echo; echo "### The whole chain on a run of 150 frames, tracked: image to pose"
  "$bin"/angio-simulate --out "$work/run" --frames 150 --start-primary-deg 10 --end-primary-deg 30 --start-rotation-deg 1 --start-translation-mm 3
  "$bin"/angio-evaluate cases "$work/run/cases.yaml" --method oriented_kernel --out "$work/run.json"
  grep -A4 '"total": {' "$work/run.json" | tail -5
}

# Needs ITK, and VMTK's data and liver masks under ANGIO_SHARED_DATA.
volumes() {
  local shared="${ANGIO_SHARED_DATA:?names the folder with vmtk-aorta and msd-hepatic-masks}" mask timed=()
  [ -x /usr/bin/time ] && timed=(/usr/bin/time -f "%e s, %M KiB at most")
  echo; echo "### Vessel trees from volumes: aorta against VMTK's centrelines, then masks of liver vessels"
  "$bin"/angio-extract-tree "$shared/vmtk-aorta/aorta-final-levelset.mha" --threshold 0 --inside below --ends sphere \
    --out "$work/aorta.csv" --compare "$shared/vmtk-aorta/aorta-centerline.vtp" --compare-frame RAS
  echo; echo "the same from the MR image, which shows other vessels too"
  "$bin"/angio-extract-tree "$shared/vmtk-aorta/aorta.mha" --threshold 900 --seed=-230.75,-117.22,25.42 \
    --out "$work/image.csv" --compare "$shared/vmtk-aorta/aorta-centerline.vtp" --compare-frame RAS
  for mask in 002 008 010; do
    echo; "${timed[@]}" "$bin"/angio-extract-tree "$shared/msd-hepatic-masks/hepaticvessel_${mask}_vsnet.nii.gz" \
      --label 1 --label 2 --out "$work/liver$mask.csv"
  done
}

seeds() {
  echo; echo "### Closed and open loop, final error by seed"
  printf '| seed | closed loop: view [deg] | target [mm] | open loop: view [deg] | target [mm] | on the way: table outside start and goal [mm] | target further than at the start [mm] |\n| --- | --- | --- | --- | --- | --- | --- |\n'
  for seed in 1 2 3 4 5 6 7 8 9 10; do
    "$bin"/angio-servo --simulate --seed "$seed" --out "$work/seed$seed" > "$work/seed$seed.txt"
    awk -v seed="$seed" '/^closed loop/ {c=$3" | "$4} /^open loop/ {o=$3" | "$4} /^way/ {w=$5" | "$14} END {print "| "seed" | "c" | "o" | "w" |"}' "$work/seed$seed.txt"
  done
}

calibration() {
  local data=examples/data calibrate="$bin/angio-calibrate" set
  echo; echo "### K from 20 views of a bead phantom, 0.1 px of noise a bead, against the truth"
  "$calibrate" simulate --study camera --trials "${TRIALS:-200}"
  echo; echo "### The arm's geometry against the truth"
  "$calibrate" simulate --study geometry --trials 40
  echo; echo "### Time of 120 views"
  "$calibrate" simulate --study timing
  echo; echo "### Zhang's own planar data (published: 832.5, 832.53, 303.959, 206.585, k1 -0.228601, k2 0.190353)"
  "$calibrate" camera "$data/calib-zhang/views.yaml" --distortion radial --skew
  local xcat="${ANGIO_SHARED_DATA:-}/xcat-coronary" frame
  if [ -d "$xcat" ]; then
    echo; echo "### 27 exact correspondences in two coronary angiograms (true f: 1194 / 0.184 = 6489.130 px, centre 480, 480)"
    awk 'BEGIN {print "name: xcat\npoints:"} NF == 3 {print "  - ["$1", "$2", "$3"]"}' "$xcat/frame1_3d.txt" > "$work/xcat.yaml"
    { echo "phantom: xcat.yaml"; echo "image_size_px: [960, 960]"; echo "pixel_spacing_mm: 0.184"; echo "views:"; } > "$work/xcat_views.yaml"
    for frame in 1 2; do
      awk 'BEGIN {print "bead,x_px,y_px"} NF == 2 {printf "%d,%.12f,%.12f\n", n++, 480 + $1 / 0.184, 480 + $2 / 0.184}' \
        "$xcat/frame${frame}_2d.txt" > "$work/xcat$frame.csv"
      echo "  - {name: frame$frame, beads: xcat$frame.csv, source_detector_distance_mm: 1194}" >> "$work/xcat_views.yaml"
    done
    "$calibrate" camera "$work/xcat_views.yaml" --noise-px 1e-6
  fi
  echo; echo "### T_dsa_cb from 15 poses of a LAO/RAO and CRA/CAU orbit, 0.1 deg / 0.3 mm; about one axis alone"
  "$calibrate" hand-eye --simulate-trials "${TRIALS:-200}"
  "$calibrate" hand-eye --simulate-trials 5 --cra-deg 0 || true
  echo; echo "### A real robot's 50 poses against the published transform; ViSP's tutorial against its answer"
  "$calibrate" hand-eye --moveit "$data/calib-moveit-handeye/pose_samples.json" --setup eye_to_hand \
    --reference "$data/calib-moveit-handeye/published.yaml"
  "$calibrate" hand-eye "$data/visp-handeye/poses.yaml" --reference "$data/visp-handeye/tutorial.yaml" --compare
  echo; echo "### Static phantom: T_dsa_cb from three runs predicts the fourth"
  "$calibrate" registration "$data/static-phantom/cases.yaml" --leave-one-out
  echo; echo "### What must be refused"
  for set in duplicate-poses swapped-beads wrong-units mirrored-phantom other-machine; do
    "$calibrate" simulate --out "$work/$set" --images none --hostile "$set" >/dev/null
    echo "$set:"
    "$calibrate" camera "$work/$set/camera/views.yaml" --out "$work/camera.yaml" 2>&1 >/dev/null | sed "s#$work/##g" || true
    "$calibrate" hand-eye "$work/$set/hand-eye/poses.yaml" --carm "$work/$set/truth/carm.yaml" --out "$work/lab.yaml" 2>&1 >/dev/null | sed "s#$work/##g" || true
  done
  examples/05_calibrate/calibrate.sh "$work/story"
}

# Images and registration in the loop, calibration wrong by 1 deg / 3 mm, 80 ms of latency, 15 frames a second.
servoing() {
  local simulate_loop="$bin/angio-simulate-loop" threads="${THREADS:-1}"
  echo; echo "### view: from any start to any view"
  "$simulate_loop" view --runs "${RUNS:-100}" --threads "$threads"
  echo; echo "### centre: 15 mm of breathing and a heartbeat, with prediction and without"
  "$simulate_loop" centre --runs "${RUNS:-100}" --threads "$threads"
  echo; echo "### centre: six places of the liver that were tuned on and five others, on drawn lines and on simulated X-ray"
  "$bin/test_servo" --gtest_filter='*CenteredLiver*' --gtest_brief=1
  catheter_alone
  navigating
  echo; echo "### faults: each run is disturbed for a while"
  "$simulate_loop" faults --runs "${FAULTS:-1000}" --threads "$threads"
}

# A point of a vessel kept in the middle by what a catheter alone shows of it, without contrast agent.
catheter_alone() {
  local seed
  for seed in $(seq 1 "${RUNS:-24}"); do
    echo; echo "### centre by a catheter alone, seed $seed"
    "$bin"/angio-servo --simulate --task centre --target-mm=-35.1,11.1,13.0 --seed "$seed" \
      --settings examples/08_tasks/catheter_alone.yaml --out "$work/catheter-alone-$seed"
  done
}

# A catheter to branches of a liver, of five brains, and of an aortic arch, whose catheter comes up the descending aorta.
# A microcatheter with forces in the liver and in arteries of brains that ANGIO_SHARED_DATA may have.
microcatheter() {
  local one elastic=("$bin"/angio-simulate-loop navigate --catheter elastic --threads "${THREADS:-1}")
  echo; echo "### An elastic microcatheter: liver, seeds from 101 and from 301, then brains"
  "${elastic[@]}" --targets "${TARGETS:-4}" --first-seed 101
  "${elastic[@]}" --targets "${TARGETS:-8}" --first-seed 301
  for one in BG05 BG0002 BG18; do
    [ -f "${ANGIO_SHARED_DATA:-}/brava/$one.swc" ] || continue
    echo; echo "$one"
    "${elastic[@]}" --targets "${TARGETS:-4}" --first-seed 101 --tree "$ANGIO_SHARED_DATA/brava/$one.swc"
  done
}

navigating() {
  local shared="${ANGIO_SHARED_DATA:-}" trees=(--tree examples/data/hepatic-tace/tree.csv) one
  local navigate=("$bin"/angio-simulate-loop navigate --targets "${TARGETS:-20}" --first-seed "${FIRST_SEED:-101}" --threads "${THREADS:-1}")
  for one in BG0002 BG05 BG18 BH0006 BH0014; do
    [ -f "$shared/brava/$one.swc" ] && trees+=(--tree "$shared/brava/$one.swc")
  done
  echo; echo "### navigate: a catheter to ${TARGETS:-20} branches of each tree, the nodes of both machines on one bus"
  "${navigate[@]}" "${trees[@]}"
  echo; echo "the same with an elastic catheter in the liver, then with a kinematic one to the same targets"
  for one in elastic kinematic; do
    "$bin"/angio-simulate-loop navigate --targets 4 --first-seed 101 --threads "${THREADS:-1}" --catheter "$one"
  done
  local arch="${ARCH:-$shared/steve-dualdevicenav}"
  [ -d "$arch" ] || return 0
  local neck=("$bin"/angio-simulate-loop navigate --threads "${THREADS:-1}" --tree "$arch" --root=-298,59.4,-64.9
    --max-edge-mm 25 --calibration examples/08_tasks/arch_carm.yaml) others="${ARCH_TARGETS:-76}" targets seed names stiffness settings
  # Seeds 101 and 102 were looked at.
  "${neck[@]}" --target-names LCCA,LVA,RCCA,RVA --targets "${TARGETS:-18}" --first-seed 103
  echo; echo "the same with an elastic catheter of 4 French, shaped for the artery"
  for one in "$others 4001 LVA,RCCA,RVA 5 arch_catheter" "$((others / 3)) 5001 LCCA 10 arch_left_carotid_catheter"; do
    read -r targets seed names stiffness settings <<< "$one"
    "${neck[@]}" --targets "$targets" --first-seed "$seed" --target-names "$names" --catheter elastic \
      --shaft-bending-n-mm2 300 --tip-bending-n-mm2 "$stiffness" --soft-length-mm 150 \
      --settings "examples/08_tasks/$settings.yaml"
  done
}

# How late a program is that only waits, 20 ms at a time, as long as another one lives.
standstills() {
  local never before now late worst=0 long=0
  exec {never}<> <(:)
  before=${EPOCHREALTIME/./}
  while kill -0 "$1" 2>/dev/null; do
    read -r -t 0.02 -u "$never" || true
    now=${EPOCHREALTIME/./}
    late=$((now - before - 20000))
    before=$now
    [ "$late" -le "$worst" ] || worst=$late
    [ "$late" -le 100000 ] || long=$((long + 1))
  done
  echo "a program that only waits was late by $((worst / 1000)) ms at most, $long times by more than 100 ms"
}

# Two programs on a bus, in real time, for MINUTES: a patient who breathes, kept centred on images of SIDE_PX. Memory of
# both after the first minute and at the end, and whether commands ever ran out; and whether the machine itself stood
# still, or others had its processors. The loop is what is tried: its patient has no bones, which cost more to show than
# to see.
soak() {
  local bus='udpm://239.255.76.67:7679?ttl=0' seconds=$((${MINUTES:-30} * 60)) side=${SIDE_PX:-512} pids sample began
  printf 'anatomy: {region: none}\nmotion:\n  breathing: {amplitude_mm: 15, diaphragm_mm: 0}\n  heartbeat: {amplitude_mm: 2}\n' > "$work/patient.yaml"
  awk -v side="$side" '/^image_size_px:/ {print "image_size_px: [" side ", " side "]"; next}
       /^pixel_spacing_mm:/ {printf "pixel_spacing_mm: %.12g\n", $2 * 1024 / side; next} {print}' \
    examples/data/hepatic-tace/carm.yaml > "$work/carm.yaml"
  echo; echo "### ${MINUTES:-30} minutes of centre, angio-simulate and angio-servo on a bus, in real time, $side x $side"
  local before=($(head -1 /proc/stat))
  "$bin"/angio-simulate --bus "$bus" --calibration "$work/carm.yaml" --settings "$work/patient.yaml" --duration-s "$seconds" > "$work/simulate.txt" &
  pids=($!)
  "$bin"/angio-servo --bus "$bus" --calibration "$work/carm.yaml" --task centre --autostart --duration-s "$((seconds + 1))" > "$work/servo.txt" 2> "$work/held.txt" &
  pids+=($!)
  standstills "${pids[0]}" > "$work/standstills.txt" &
  local witness=$!
  began=$SECONDS
  while sleep 5 && kill -0 "${pids[0]}" 2>/dev/null && kill -0 "${pids[1]}" 2>/dev/null; do
    sample="$((SECONDS - began))"
    for one in "${pids[@]}"; do sample="$sample $(awk '/^VmRSS/ {print $2}' "/proc/$one/status" 2>/dev/null)"; done
    echo "$sample" >> "$work/memory.txt"
  done
  wait "${pids[@]}" "$witness"
  cat "$work/simulate.txt" "$work/servo.txt" "$work/standstills.txt"
  local after=($(head -1 /proc/stat))
  awk -v used=$((after[1] - before[1] + after[3] - before[3])) -v stolen=$((after[8] - before[8])) \
    'BEGIN {printf "of the processor time asked for, the host gave %.1f %% to others\n", 100 * stolen / (used + stolen)}'
  sed 's/^frame [0-9]* held: //; s/[0-9.e-]*[0-9]/N/g' "$work/held.txt" | sort | uniq -c | sort -rn | head -5
  awk 'NF == 3 && $1 > 60 {if (!n++) {s = $2; v = $3} if ($2 > ms) ms = $2; if ($3 > mv) mv = $3; es = $2; ev = $3}
       END {printf "memory [KiB] after a minute, at the end, at most: angio-simulate %d %d %d, angio-servo %d %d %d\n", s, es, ms, v, ev, mv}' "$work/memory.txt"
}

# What extractors see in the real images, and in simulated ones: a picture to look at.
sheet() {
  local images=(--image examples/data/fevar-aaa-phantom/image.png --cases examples/data/static-phantom/cases.yaml)
  [ -d "${ANGIO_SHARED_DATA:-}/arcade-sample" ] && images+=(--annotations "$ANGIO_SHARED_DATA/arcade-sample/annotations.json")
  "$bin"/angio-evaluate extraction "${images[@]}" --tree examples/data/hepatic-tace/tree.csv --model-axes lip --trials 5 \
    --extractor ridge --sheet "${SHEET:-seeing.jpg}" --columns 5 --side-px 300
}

speed() {
  echo; echo "### Time per stage, one thread"
  "$bin"/angio-benchmark --benchmark_min_time=0.5 2>/dev/null
}

for part in "${@:-rows worlds seeing paper table1 seeds calibration servoing speed}"; do
  for one in $part; do "$one"; done
done
