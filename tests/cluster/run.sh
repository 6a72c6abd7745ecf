#!/usr/bin/env bash
# A Slurm cluster of virtual nodes on this machine, the tests of this folder on it, and its end: no daemon is left.
# Installs slurm-wlm and munge where they are missing: as root, on Debian. NODES: number of nodes, of one CPU each,
# beside one of eight CPUs in a partition of its own.
# Whatever follows is for pytest, such as -k scancel.
set -euo pipefail
cd "$(dirname "$0")/../.."

skip() {
    echo "The tests on a cluster are skipped: $1."
    exit 0
}

# The place where every command of Slurm finds it, also in a job.
configuration=/etc/slurm/slurm.conf

[ "$(id -u)" -eq 0 ] || skip "Slurm is started as root"
[ ! -e "$configuration" ] || skip "this machine belongs to a cluster ($configuration is there)"
if ! command -v slurmctld slurmd munged > /dev/null; then
    command -v apt-get > /dev/null || skip "there is neither Slurm nor Debian's apt-get to install it"
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq --no-install-recommends slurm-wlm munge; } \
        > /dev/null || skip "Debian's packages slurm-wlm and munge could not be installed"
    # The packages' own services, of a cluster that has not been set up.
    if [ -d /run/systemd/system ]; then systemctl disable --quiet --now munge slurmctld slurmd || true; fi
fi

folder=$(mktemp -d)
chmod 755 "$folder"
mkdir "$folder"/{run,log,state,spool}
export CLUSTER=$folder
nodes=${NODES:-3}
host=$(hostname -s)

stop() {
    scancel --user root --quiet 2> /dev/null && sleep 3 || true
    for name in slurmd-n* slurmctld munged; do
        for file in "$folder"/run/$name.pid; do
            process=$(cat "$file" 2> /dev/null) || continue
            kill "$process" 2> /dev/null || continue
            for _ in $(seq 100); do [ -e "/proc/$process/exe" ] || continue 2; sleep 0.1; done
            kill -KILL "$process"
        done
    done
    rm -rf "$folder" "$configuration"
}
trap stop EXIT

cat > "$configuration" << END
ClusterName=hopperopt
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=7117
SlurmUser=root
SlurmdUser=root
AuthInfo=socket=$folder/run/munge.socket
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool/%n
SlurmctldPidFile=$folder/run/slurmctld.pid
SlurmdPidFile=$folder/run/slurmd-%n.pid
SlurmctldLogFile=$folder/log/slurmctld
SlurmdLogFile=$folder/log/slurmd-%n
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
ReturnToService=1
MinJobAge=3600
KillWait=5
SchedulerParameters=batch_sched_delay=1,sched_interval=5
PartitionName=all Nodes=n[1-$nodes] Default=YES
PartitionName=wide Nodes=n0
END
for n in $(seq 0 "$nodes"); do
    echo "NodeName=n$n NodeHostname=$host NodeAddr=127.0.0.1 Port=$((7120 + n)) CPUs=$((n ? 1 : 8)) RealMemory=8000" >> "$configuration"
done

dd if=/dev/urandom of="$folder/munge.key" bs=128 count=1 status=none
chmod 400 "$folder/munge.key"
munged --key-file="$folder/munge.key" --socket="$folder/run/munge.socket" --pid-file="$folder/run/munged.pid" \
    --log-file="$folder/log/munged" --seed-file="$folder/state/munge.seed"
slurmctld
for n in $(seq 0 "$nodes"); do slurmd -N "n$n"; done
for _ in $(seq 60); do
    [ "$(sinfo --noheader --states=idle --format=%D 2> /dev/null)" = $((nodes + 1)) ] && break
    sleep 1
done
sinfo
.venv/bin/python -m pytest tests/cluster -v "$@"
