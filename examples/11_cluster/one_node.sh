#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# A Slurm cluster of one node for as long as a command runs: its configuration, its key, its daemons and its state are in
# a temporary folder, and go when the command has ended. No daemon of the system is used or touched. To try slurm.sh.
# Usage: one_node.sh COMMAND...
#   one_node.sh examples/11_cluster/slurm.sh 4 runs build/bin/angio-evaluate simulation --tree tree.csv --trials 100
# Needs Debian's slurm-wlm. CPUS: how many tasks at a time, one a processor when not given.
set -euo pipefail
PATH=$PATH:/usr/sbin
for program in munged slurmctld slurmd sbatch; do
  command -v $program > /dev/null || { echo "one_node.sh: $program is missing: install slurm-wlm" >&2; exit 1; }
done
state=$(mktemp -d) ids=()
chmod 755 "$state"

# Ends what was started here, by its number, the newest first, and takes the folder away.
take_down() {
  if [ ${#ids[@]} -eq 3 ]; then  # Jobs first, so that slurmd ends no later than what it runs.
    timeout 10 scancel --user="$(id -un)" 2> /dev/null || true
    for _ in $(seq 50); do [ -z "$(timeout 5 squeue --noheader 2> /dev/null)" ] && break; sleep 0.2; done
  fi
  for ((i = ${#ids[@]} - 1; i >= 0; --i)); do
    kill "${ids[i]}" 2> /dev/null || continue
    for _ in $(seq 100); do kill -0 "${ids[i]}" 2> /dev/null || break; sleep 0.1; done
    kill -KILL "${ids[i]}" 2> /dev/null || true
    wait "${ids[i]}" 2> /dev/null || true
  done
  rm -rf "$state"
}
trap take_down EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

free_port() {
  /usr/bin/python3 -c 'import socket
s = socket.socket()
s.bind(("127.0.0.1", 0))
print(s.getsockname()[1])'
}

cpus=${CPUS:-$(nproc)} host=$(hostname -s)
mkdir "$state/save" "$state/spool"
(umask 077 && head -c 1024 /dev/urandom > "$state/munge.key")
cat > "$state/slurm.conf" << CONFIGURATION
ClusterName=one-node
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
SlurmdPort=$(free_port)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
AuthType=auth/munge
AuthInfo=socket=$state/munge.socket
CredType=cred/munge
StateSaveLocation=$state/save
SlurmdSpoolDir=$state/spool
SlurmctldPidFile=$state/slurmctld.pid
SlurmdPidFile=$state/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
KillWait=5
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE OverSubscribe=NO State=UP
CONFIGURATION
export SLURM_CONF=$state/slurm.conf

munged --foreground --force --num-threads=1 --key-file="$state/munge.key" --socket="$state/munge.socket" \
  --pid-file="$state/munged.pid" --seed-file="$state/munged.seed" --log-file="$state/munged.log" 2> "$state/munged.err" &
ids+=($!)
for _ in $(seq 50); do [ -S "$state/munge.socket" ] && break; sleep 0.1; done
slurmctld -D -c -L "$state/slurmctld.log" > /dev/null 2>&1 &
ids+=($!)
slurmd -D -N "$host" -L "$state/slurmd.log" > /dev/null 2>&1 &
ids+=($!)
ready() { [ "$(sinfo --noheader --format=%T 2> /dev/null)" = idle ]; }
for _ in $(seq 150); do ready && break; sleep 0.2; done
if ! ready; then
  echo "one_node.sh: Slurm does not start: $(grep -hE 'error|fatal' "$state"/*.log "$state"/*.err | tail -n 2 | tr '\n' ' ')" >&2
  exit 1
fi
"$@"
