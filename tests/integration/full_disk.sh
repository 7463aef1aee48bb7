#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Programs that write a file onto a full disk, into a read-only folder, onto a disk that fills, and two into one folder:
# each that cannot ends with an error and one line that names the file, and leaves no file. The disks are mounted in a
# namespace that ends with the test.
# Usage: full_disk.sh BIN_FOLDER EXAMPLES_DATA. Exit code 77: skipped, and why.
set -u
if [ "${3:-}" != inside ]; then
  unshare -rm true 2>/dev/null || { echo "skipped: user and mount namespaces are not permitted"; exit 77; }
  folder=$(mktemp -d) && trap 'rm -rf "$folder"' EXIT
  unshare -rm "$0" "$(realpath "$1")" "$(realpath "$2")" inside "$folder"
  exit
fi
bin=$1 data=$2 failures=0
cd "$4" && mkdir full read-only || exit 1
mount -t tmpfs -o size=64k none full || { echo "skipped: a tmpfs cannot be mounted"; exit 77; }
mount --bind read-only read-only && mount -o remount,ro,bind read-only ||
  { echo "skipped: a read-only folder cannot be mounted"; exit 77; }
head -c 1M /dev/zero > full/filling 2>/dev/null

# refuses PROGRAM ARGUMENT...: with @ in place of the folder.
refuses() {
  local program=$1 folder code left
  shift
  for folder in full read-only; do
    timeout 30 "$bin/$program" "${@//@/$folder}" > /dev/null 2> err
    code=$?
    left=$(find "$folder" -type f ! -name filling)
    if [ $code != 1 ] || [ "$(grep -c "^$program: $folder/.*: cannot be " err)" != 1 ] || [ -n "$left" ]; then
      echo "FAILED: $program $* ($folder): exit code $code, left: $left"
      tail -n 3 err
      failures=$((failures + 1))
    fi
    find "$folder" -mindepth 1 ! -name filling -delete 2> /dev/null
  done
}

phantom=$data/static-phantom
run=(--tree "$phantom/tree.csv" --image "$phantom/dicom/im5.dcm" --frame 2 --t-dsa-cb "$phantom/dicom/t_dsa_cb.yaml")
refuses angio-inspect "$data/hepatic-tace/tree.csv" --picture @/tree.png
refuses angio-inspect "$phantom/dicom/im5.dcm" --frame 2 --out @/frame.png
refuses angio-register "${run[@]}" --out @/result.json
refuses angio-register "${run[@]}" --overlay @/overlay.png
refuses angio-register "${run[@]}" --out-pose @/pose.yaml
refuses angio-best-view --branch 13 --out @/best.json
refuses angio-simulate --out @/run --frames 2
refuses angio-calibrate simulate --out @/data
refuses angio-evaluate cases "$phantom/cases.yaml" --method iterative_pnp --out @/results.json
refuses angio-servo --simulate --duration-s 1 --out @/loop
refuses angio-servo --simulate --duration-s 1 --out loop --film @/film.mp4
refuses angio-simulate-loop view --runs 1 --out @/runs.json
refuses angio-calibrate hand-eye "$data/visp-handeye/poses.yaml" --out @/hand-eye.yaml

# A disk that fills while it is written: what is there under its name is whole, or nothing is.
mkdir small && mount -t tmpfs -o size=96k small small || exit 1
timeout 60 "$bin/angio-servo" --simulate --duration-s 2 --out loop --film small/film.mp4 > /dev/null 2> err
code=$?
if [ $code != 1 ] || [ "$(grep -c '^angio-servo: small/film.mp4: cannot be' err)" != 1 ] || [ -n "$(ls small)" ]; then
  echo "FAILED: a film on a disk that fills: exit code $code, left: $(ls small)"
  tail -n 3 err
  failures=$((failures + 1))
fi

# Two programs and one folder: the second ends at once, and the first is whole.
"$bin/angio-servo" --simulate --duration-s 4 --out two > /dev/null 2> first &
first=$!
for _ in $(seq 100); do [ -d two ] && break; sleep 0.1; done
timeout 30 "$bin/angio-servo" --simulate --duration-s 1 --out two > /dev/null 2> second
code=$?
wait $first || { echo "FAILED: the first of two programs: $(tail -n 1 first)"; failures=$((failures + 1)); }
if [ $code != 1 ] || ! grep -q '^angio-servo: two: is being written by another program$' second || [ ! -s two/summary.json ]; then
  echo "FAILED: the second of two programs in one folder: exit code $code, $(tail -n 1 second)"
  failures=$((failures + 1))
fi
[ $failures = 0 ]
