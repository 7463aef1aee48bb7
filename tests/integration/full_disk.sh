#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Every program that writes, by each of its options that name a file or a folder: onto a full disk, into a read-only
# folder, onto a disk that fills, and two into one folder. Each that cannot ends with an error and one line that names
# the file, and leaves no file. What is full or read-only is refused before the work: here the work has no end where a
# program lets it be chosen, and what else it could write is not there afterwards. The disks are mounted in a namespace
# that ends with the test.
# Usage: full_disk.sh BIN_FOLDER EXAMPLES_DATA. Exit code 77: skipped, and why.
set -u
if [ "${3:-}" != inside ]; then
  unshare -rm true 2>/dev/null || { echo "skipped: user and mount namespaces are not permitted"; exit 77; }
  folder=$(mktemp -d) && trap 'rm -rf "$folder"' EXIT
  unshare -rm "$0" "$(realpath "$1")" "$(realpath "$2")" inside "$folder"
  exit
fi
bin=$1 data=$2 page=$(getconf PAGESIZE)
cd "$4" && mkdir full crowded short small read-only beside && touch failures tried || exit 1
# disk FOLDER OPTIONS FILLING_BYTES
disk() {
  mount -t tmpfs -o "$2" none "$1" || { echo "skipped: a tmpfs cannot be mounted"; exit 77; }
  head -c "$3" /dev/zero > "$1/filling" 2>/dev/null
}
disk full size=$((16 * page)) 1M
disk crowded nr_inodes=2 1      # Space, but no file more.
disk short size=$((16 * page)) $((15 * page))
disk small size=96k 0
mount --bind read-only read-only && mount -o remount,ro,bind read-only ||
  { echo "skipped: a read-only folder cannot be mounted"; exit 77; }

failed() { echo "FAILED: $*" | tee -a failures; }

# ends FOLDER PROGRAM ARGUMENT...: with @ in place of the folder.
ends() {
  local folder=$1 program=$2 code left
  shift 2
  mkdir "beside/$folder"
  timeout 30 "$bin/$program" "${@//@/$folder}" > /dev/null 2> "err-$folder"
  code=$?
  left=$(find "$folder" "beside/$folder" -type f ! -name filling 2> /dev/null)
  if [ $code != 1 ] || [ "$(grep -c "^$program: $folder/.*: cannot be " "err-$folder")" != 1 ] || [ -n "$left" ]; then
    failed "$program ${*//@/$folder}: exit code $code, left: $left"
    tail -n 3 "err-$folder"
  fi
  rm -rf "beside/$folder"
  find "$folder" -mindepth 1 ! -name filling -delete 2> /dev/null
}

# refuses PROGRAM ARGUMENT...: what is written beside @ could be.
refuses() {
  local program=$1 command="" option=""
  [[ $2 =~ ^[a-z][a-z-]*$ ]] && command=" $2"
  for argument in "$@"; do
    [[ $argument == @* ]] && echo "$program$command $option" >> tried
    option=$argument
  done
  ends full "$@" &
  ends read-only "$@" &
  wait
}

# stops PROGRAM ARGUMENT...: the disk has a page left, and what is written is longer.
stops() { ends short "$@"; }

tree=$data/hepatic-tace/tree.csv carm=$data/hepatic-tace/carm.yaml phantom=$data/static-phantom
bus="udpm://239.255.76.67:$((20000 + $$ % 20000))?ttl=0"
on_bus=(--bus "$bus" --tree "$tree" --calibration "$carm")
beside() { echo "beside/@/$1"; }
mkdir made
"$bin/angio-calibrate" simulate --out made --images none --tree "$tree" --nominal "$carm" > /dev/null || exit 1
"$bin/angio-servo" --bus 'file://made/run.lcm?mode=w' --tree "$tree" --calibration "$carm" --autostart \
  --duration-s 0.2 > /dev/null 2>&1
[ -s made/run.lcm ] || failed "no log was made"
evaluated=(simulation --tree "$tree" --trials 20) looped=(faults --tree "$tree" --calibration "$carm" --runs 1)
"$bin/angio-evaluate" "${evaluated[@]}" --shard 1/1 --out made/evaluated.json > /dev/null || exit 1
"$bin/angio-simulate-loop" "${looped[@]}" --shard 1/1 --out made/looped.json > /dev/null || exit 1
studied=(simulate --study camera --trials 60 --camera-views 6 --nominal "$carm")
"$bin/angio-calibrate" "${studied[@]}" --shard 1/1 --out made/studied.json > /dev/null || exit 1
# A tube as a surface.
awk 'function facet(a, b, c) {
    print "facet normal 0 0 0\nouter loop\nvertex " a "\nvertex " b "\nvertex " c "\nendloop\nendfacet"
  }
  function rim(k, z) { return 3 * cos(k * atan2(0, -1) / 6) " " 3 * sin(k * atan2(0, -1) / 6) " " z }
  BEGIN {
    print "solid tube"
    for (k = 0; k < 12; ++k) {
      facet(rim(k, 0), rim(k + 1, 0), rim(k + 1, 30)); facet(rim(k, 0), rim(k + 1, 30), rim(k, 30))
      facet("0 0 0", rim(k + 1, 0), rim(k, 0)); facet("0 0 30", rim(k, 30), rim(k + 1, 30))
    }
    print "endsolid tube"
  }' > made/tube.stl

run=(--tree "$phantom/tree.csv" --image "$phantom/dicom/im5.dcm" --frame 2 --t-dsa-cb "$phantom/dicom/t_dsa_cb.yaml")
refuses angio-register "${run[@]}" --out @/result.json --overlay "$(beside overlay.png)"
refuses angio-register "${run[@]}" --overlay @/overlay.png --out "$(beside result.json)"
refuses angio-register "${run[@]}" --out-pose @/pose.yaml --out "$(beside result.json)"
refuses angio-register "${run[@]}" --dicom-registration @/pose.dcm --out "$(beside result.json)"
refuses angio-register "${run[@]}" --dicom-overlay @/overlay.dcm --out "$(beside result.json)"
stops angio-register "${run[@]}" --overlay @/overlay.png

seen=(angio-extract-centerline "$phantom/dicom/im5.dcm" --frame 2)
refuses "${seen[@]}" --out @/line.csv --overlay "$(beside overlay.png)"
refuses "${seen[@]}" --overlay @/overlay.png --out "$(beside line.csv)"
stops "${seen[@]}" --out @/line.csv
stops "${seen[@]}" --out made/line.csv --overlay @/overlay.png

refuses angio-inspect "$tree" --picture @/tree.png
stops angio-inspect "$tree" --picture @/tree.svg
refuses angio-inspect "$phantom/dicom/im5.dcm" --frame 2 --out @/frame.png --write-camera "$(beside camera.yaml)"
refuses angio-inspect "$phantom/dicom/im5.dcm" --write-camera @/camera.yaml
stops angio-inspect "$phantom/dicom/im5.dcm" --out @/frame.tif
refuses angio-inspect "$phantom/dicom/im5.dcm" --convert-pose rtk --out @/geometry.xml --write-camera "$(beside camera.yaml)"
refuses angio-inspect "$carm" --write-urdf @/carm.urdf
refuses angio-inspect "${on_bus[@]}" --wait-s 3600 --picture @/frame.png

refuses angio-spy --bus "$bus" --duration-s 86400 --json @/spy.json
refuses angio-view --bus "$bus" --tree "$tree" --out @/film.mp4
refuses angio-view --bus "$bus" --tree "$tree" --out @/frame%04d.png
refuses angio-check-machine "${on_bus[@]}" --watch-s 600 --json @/table.json
refuses angio-servo "${on_bus[@]}" --autostart --record @/run.lcm
refuses angio-servo "${on_bus[@]}" --preview @/preview
refuses angio-navigate "${on_bus[@]}" --autostart --to-branch 13 --record @/run.lcm
refuses angio-operator arm --bus 'file://@/run.lcm?mode=w'
refuses angio-replay made/run.lcm --tree "$tree" --calibration "$carm" --out @/commands.csv
refuses angio-replay made/run.lcm --tree "$tree" --calibration "$carm" --to-mcap @/run.mcap
refuses angio-replay made/run.lcm --to-lcm @/again.lcm

carm_and_tree=(--tree "$tree" --calibration "$carm")
refuses angio-best-view "${carm_and_tree[@]}" --branch 13 --out @/best.json --picture "$(beside best.png)"
refuses angio-best-view "${carm_and_tree[@]}" --branch 13 --picture @/best.png --out "$(beside best.json)"
stops angio-best-view "${carm_and_tree[@]}" --branch 13 --out @/best.json
refuses angio-simulate "${carm_and_tree[@]}" --frames 9999 --out @/run
simulated=(--simulate "${carm_and_tree[@]}" --duration-s 3600)
refuses angio-servo "${simulated[@]}" --out @/loop
refuses angio-servo "${simulated[@]}" --out "$(beside loop)" --film @/film.mp4
refuses angio-servo "${simulated[@]}" --preview @/preview
for task in view centre faults; do
  refuses angio-simulate-loop $task "${carm_and_tree[@]}" --runs 100000 --out @/runs.json
done
refuses angio-simulate-loop navigate "${carm_and_tree[@]}" --targets 1000 --out @/runs.json --film "$(beside film.mp4)"
refuses angio-simulate-loop navigate "${carm_and_tree[@]}" --targets 1000 --film @/film.mp4 --out "$(beside runs.json)"

refuses angio-calibrate simulate --tree "$tree" --nominal "$carm" --images all --out @/data
views=$data/calib-zhang/views.yaml
refuses angio-calibrate camera "$views" --out @/camera.yaml --report "$(beside report)"
refuses angio-calibrate camera "$views" --report @/report --out "$(beside camera.yaml)"
stops angio-calibrate camera "$views" --report @/report
picture=("$phantom/frames/im5.png" --phantom "$tree" --any-reading)
refuses angio-calibrate camera "${picture[@]}" --out-pose @/pose.yaml --out "$(beside camera.yaml)"
refuses angio-calibrate camera "${picture[@]}" --mayacam @/camera.txt --out "$(beside camera.yaml)"
views=(made/geometry/views.yaml --camera "$data/hepatic-tace/camera.yaml")
refuses angio-calibrate geometry "${views[@]}" --out @/carm.yaml --report "$(beside report)"
refuses angio-calibrate geometry "${views[@]}" --report @/report --out "$(beside carm.yaml)"
stops angio-calibrate geometry "${views[@]}" --out @/carm.yaml
poses=$data/visp-handeye/poses.yaml
refuses angio-calibrate hand-eye "$poses" --out @/hand-eye.yaml --report "$(beside report)"
refuses angio-calibrate hand-eye "$poses" --report @/report --out "$(beside hand-eye.yaml)"
refuses angio-calibrate hand-eye "$poses" --write-poses @/poses.yaml --out "$(beside hand-eye.yaml)"
refuses angio-calibrate registration "$phantom/cases.yaml" --out @/lab.yaml --report "$(beside report)"
refuses angio-calibrate registration "$phantom/cases.yaml" --report @/report --out "$(beside lab.yaml)"

refuses angio-evaluate cases "$phantom/cases.yaml" --method iterative_pnp --starts 10000 --out @/results.json
for command in simulation paper; do
  refuses angio-evaluate $command --trials 100000 --tree "$tree" --out @/results.json --report "$(beside report.html)"
  refuses angio-evaluate $command --trials 100000 --tree "$tree" --report @/report.html --out "$(beside results.json)"
done
refuses angio-evaluate simulation --trials 100000 --tree "$tree" --shard 1/2 --out @/shard.json
stops angio-evaluate "${evaluated[@]}" --shard 1/2 --out @/shard.json
refuses angio-calibrate "${studied[@]}" --out @/study.json
refuses angio-calibrate "${studied[@]}" --shard 1/2 --out @/shard.json
stops angio-calibrate "${studied[@]}" --shard 1/2 --out @/shard.json
refuses angio-calibrate merge made/studied.json --out @/study.json
stops angio-calibrate merge made/studied.json --out @/study.json
refuses angio-evaluate merge made/evaluated.json --out @/results.json --report "$(beside report.html)"
refuses angio-evaluate merge made/evaluated.json --report @/report.html --out "$(beside results.json)"
stops angio-evaluate merge made/evaluated.json --out @/results.json
refuses angio-simulate-loop merge made/looped.json --out @/runs.json
stops angio-evaluate paper --trials 1 --tree "$tree" --report @/report.html
extraction=(extraction --tree "$tree" --trials 100000)
refuses angio-evaluate "${extraction[@]}" --out @/scores.json --sheet "$(beside sheet.png)"
refuses angio-evaluate "${extraction[@]}" --sheet @/sheet.png --out "$(beside scores.json)"
stops angio-evaluate extraction --image "$phantom/frames/im5.png" --sheet @/sheet.png
refuses angio-evaluate catheter "$data/hepatic-tace/cases.yaml" --out @/tips.json --sheet "$(beside sheet.png)"
refuses angio-evaluate catheter "$data/hepatic-tace/cases.yaml" --sheet @/sheet.png --out "$(beside tips.json)"
refuses angio-evaluate catheter-runs --tree "$data/hepatic-tace/tree.csv" --runs 1 --frames 4 --out @/runs.json

if [ -x "$bin/angio-extract-tree" ]; then  # With ITK.
  refuses angio-extract-tree made/tube.stl --out @/tree.csv --picture "$(beside tree.png)"
  refuses angio-extract-tree made/tube.stl --picture @/tree.png --out "$(beside tree.csv)"
  refuses angio-extract-tree made/tube.stl --result @/tree.json --out "$(beside tree.csv)"
  stops angio-extract-tree made/tube.stl --picture @/tree.png --out "$(beside tree.csv)"
fi
refuses angio-line-evidence "$phantom/frames/im1.png" --out @/evidence.csv
refuses angio-training-pairs --trees 1000000 --out @/pairs.bin
refuses example-03-write-case-set --tree "$tree" --cases 100000 --image --out @/cases

ends crowded angio-evaluate simulation --trials 100000 --tree "$tree" --out @/results.json
ends crowded angio-operator arm --bus 'file://@/run.lcm?mode=w'
ends crowded angio-servo "${simulated[@]}" --out @/loop

# An option that writes and is not tried above. angio-servo starts angio-servo-simulated.
for program in "$bin"/angio-* "$bin"/example-*; do
  name=${program##*/}
  [ -L "$program" ] || [ "$name" = angio-benchmark ] || [ "$name" = angio-servo-simulated ] && continue
  timeout 10 "$program" --help-all 2> /dev/null < /dev/null | awk -v program="$name" '
    /^[a-z][a-z-]*$/ { command = " " $1 }
    $1 ~ /^--(out|out-pose|result|to-.*|dicom-.*|record|film|overlay|picture|preview|report|sheet|json|write-.*)$/ && $2 ~ /^TEXT/ {
      print program command " " $1
    }' > options
  while read -r option; do grep -qxe "$option" tried || failed "not tried: $option"; done < options
done

# A disk that fills while it is written: what is there under its name is whole, or nothing is.
timeout 60 "$bin/angio-servo" --simulate "${carm_and_tree[@]}" --duration-s 2 --out loop --film small/film.mp4 \
  > /dev/null 2> err
code=$?
rm -f small/filling
if [ $code != 1 ] || [ "$(grep -c '^angio-servo: small/film.mp4: cannot be' err)" != 1 ] || [ -n "$(ls small)" ]; then
  failed "a film on a disk that fills: exit code $code, left: $(ls small)"
  tail -n 3 err
fi

# Two programs and one folder: the second ends at once, and the first is whole.
"$bin/angio-servo" --simulate "${carm_and_tree[@]}" --duration-s 4 --out two > /dev/null 2> first &
first=$!
for _ in $(seq 100); do [ -d two ] && break; sleep 0.1; done
timeout 30 "$bin/angio-servo" --simulate "${carm_and_tree[@]}" --duration-s 1 --out two > /dev/null 2> second
code=$?
wait $first || failed "the first of two programs: $(tail -n 1 first)"
if [ $code != 1 ] || ! grep -q '^angio-servo: two: is being written by another program$' second ||
  [ ! -s two/summary.json ]; then
  failed "the second of two programs in one folder: exit code $code, $(tail -n 1 second)"
fi
[ ! -s failures ]
