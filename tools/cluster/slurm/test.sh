#!/bin/bash
# Runs convert.sh by a real Slurm of one machine, with one task killed and queued again: the file must have the bytes of one
# conversion. Needs munge, slurmctld, slurmd and slurm-client of Debian, root, and the programs of wavesplat on the path.
#
#   tools/cluster/slurm/test.sh
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
host=$(hostname -s)
pids=()

stop() {
    kill "${pids[@]}" 2>/dev/null || true
    wait 2>/dev/null || true
    [ -z "${KEEP:-}" ] && rm -rf "$folder"
}
trap stop EXIT

# A Slurm of its own: other ports, sockets and folders than a real one.
start_slurm() {
    mkdir -p "$folder"/{state,spool,munge}
    chmod 711 "$folder" "$folder/munge"
    dd if=/dev/urandom of="$folder/munge/key" bs=1024 count=1 status=none
    chmod 400 "$folder/munge/key"
    munged --foreground --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
        --pid-file="$folder/munge/pid" --log-file="$folder/munge/log" --seed-file="$folder/munge/seed" &
    pids+=($!)
    cat >"$folder/slurm.conf" <<CONF
ClusterName=wavesplat
SlurmctldHost=$host(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
SlurmUser=root
SlurmctldPort=26817
SlurmdPort=26818
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/ctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/ctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MpiDefault=none
JobCompType=jobcomp/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=bf_interval=1,sched_interval=1,batch_sched_delay=0,requeue_delay=0
MinJobAge=600
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=p Nodes=$host Default=YES MaxTime=10 State=UP
CONF
    export SLURM_CONF="$folder/slurm.conf"
    slurmctld -D &
    pids+=($!)
    slurmd -D &
    pids+=($!)
    local n
    for n in $(seq 120); do
        sinfo --noheader --format=%T 2>/dev/null | grep -q idle && return
        sleep 0.5
    done
    tail -n 5 "$folder"/*.log
    echo "!! NOT RUN: Slurm does not start on this machine"
    exit 0
}

# The archive: 64 frames as raw files.
make_frames() {
    mkdir "$folder/frames"
    local n
    for n in $(seq -w 0 63); do
        head -c $((40 * 32 * 24)) /dev/zero | tr '\0' "\\$((8#60 + 10#$n % 8))" >"$folder/frames/$n.raw"
    done
}

state() {
    squeue --noheader --states=all --job "$1" --format=%T 2>/dev/null | sort -u | tr '\n' ' '
}

start_slurm
make_frames
cd "$folder"
frames="frames/ --dims 40x32x24 --dtype u8"
sed -e "s|^FRAMES=.*|FRAMES=($frames)|" -e "s|^OPTIONS=.*|OPTIONS=(--tolerance 0 --window 4 --chain 2)|" \
    -e "s|^SHARDS=.*|SHARDS=4|" "$here/convert.sh" >convert.sh
chmod +x convert.sh
CPUS=1 ./convert.sh | tee jobs
parts=$(sed 's/.*shards \([0-9]*\),.*/\1/' jobs)
merge=$(sed 's/.*merge \([0-9]*\);.*/\1/' jobs)

# One task of the conversions is taken away, as by preemption, and queued again.
until squeue --noheader --job "$parts" --states=running,completed --format=%T | grep -q .; do sleep 0.1; done
# Slurm lets such a task wait for two minutes; this one need not.
task=${parts}_1
scontrol requeue "$task" || true
for _ in $(seq 20); do
    scontrol update JobId="$task" StartTime=now 2>/dev/null && break
    sleep 0.5
done

for _ in $(seq 400); do
    case $(state "$merge") in
    *COMPLETED*) break ;;
    *FAILED* | *CANCELLED*) break ;;
    esac
    sleep 0.5
done
tail -n 3 run.wspl.shards/*.log
# shellcheck disable=SC2086
wavesplat convert $frames --tolerance 0 --window 4 --chain 2 --scan run.wspl.shards/scan.json -o one.wspl --quiet
cmp run.wspl one.wspl
echo "4 shards by Slurm have the bytes of one conversion"
