#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# An experiment in four shards by the scripts of examples/11_cluster, under Slurm on one node or by GNU parallel: one
# task is killed, its shard is named and made again alone, and the merged result is that of one run, byte for byte but
# for the times. Nothing that was started is left.
# Usage: cluster.sh slurm|parallel BIN_FOLDER EXAMPLES. Exit code 77: skipped, and why.
set -u
PATH=$PATH:/usr/sbin
how=$1 bin=$(realpath "$2") examples=$(realpath "$3")
needed=(parallel)
[ "$how" = slurm ] && needed=(munged slurmctld slurmd sbatch)
for program in "${needed[@]}"; do
  command -v "$program" > /dev/null || { echo "skipped: $program is missing"; exit 77; }
done
folder=$(mktemp -d) && cd "$folder" || exit 1
export TMPDIR=$folder  # What the one-node cluster leaves would be seen.
finish() { cd / && rm -rf "$folder"; }
trap finish EXIT
failed() { echo "FAILED: $*"; cat out-* runs/*.log 2> /dev/null | tail -n 20; exit 1; }

# Shard 3 is killed the first time.
cat > program << SCRIPT
#!/bin/bash
case "\$*" in *"--shard 3/4"*) [ -e killed ] || { touch killed; kill -KILL \$\$; } ;; esac
exec "$bin/angio-evaluate" "\$@"
SCRIPT
chmod +x program
work=(simulation --tree "$examples/data/hepatic-tace/tree.csv" --trials 12 --filled 0.5 --noise-px 1
  --method iterative_pnp,oriented_kernel)
run() {
  if [ "$how" = slurm ]; then
    CPUS=2 timeout 120 "$examples/11_cluster/one_node.sh" "$examples/11_cluster/slurm.sh" 4 runs ./program "${work[@]}"
  else
    PARALLEL="--jobs 2" timeout 120 "$examples/11_cluster/gnu_parallel.sh" 4 runs ./program "${work[@]}"
  fi
}

run > out-first 2>&1 && failed "a killed shard is not missed"
grep -q '^angio-evaluate: shard 3 of 4 is missing; to make it: angio-evaluate simulation .* --shard 3/4 --out runs/shard-3.json$' \
  out-first || failed "the killed shard is not named"
[ -e runs/result.json ] && failed "a result without one of its shards"
before=$(cksum runs/shard-[124].json)
run > out-second 2>&1 || failed "the killed shard is not made again"
grep -q '^making shards 3 of 4$' out-second || failed "not only the killed shard was made again"
[ "$(cksum runs/shard-[124].json)" = "$before" ] || failed "the other shards were made again"
[ -s runs/result.json ] || failed "no result"

"$bin/angio-evaluate" "${work[@]}" --no-times --out one.json > one.txt || failed "one run"
"$bin/angio-evaluate" merge runs/shard-*.json --no-times --out merged.json > merged.txt || failed "merging"
cmp one.json merged.json && cmp one.txt merged.txt || failed "merged shards are not one run"
left=$(find "$folder" -mindepth 1 -maxdepth 1 -name 'tmp.*')
[ -z "$left" ] || failed "left: $left"
[ -z "$(pgrep -f "$folder")" ] || failed "still running: $(pgrep -af "$folder")"
