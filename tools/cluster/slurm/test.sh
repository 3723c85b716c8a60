#!/bin/bash
# Runs convert.sh by a real Slurm of one machine, with one task taken away in the middle of its shard and queued again: the
# file must have the bytes of one conversion. Needs munge, slurmctld, slurmd and slurm-client of Debian, root, and wavesplat
# on the path.
#
#   tools/cluster/slurm/test.sh
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
real=$(command -v wavesplat)
folder=$(mktemp -d)
host=$(hostname -s)
pids=()

stop() {
    kill "${pids[@]}" 2>/dev/null || true
    wait 2>/dev/null || true
    [ -z "${KEEP:-}" ] && rm -rf "$folder"
}
trap stop EXIT

# A Slurm of its own: other ports, sockets and folders than a real one. A task that is queued again waits until its old
# credential has expired: by default for two minutes, here for five seconds.
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
AuthInfo=socket=$folder/munge/socket,cred_expire=5
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
KillWait=1
ReturnToService=2
MpiDefault=none
JobCompType=jobcomp/none
AccountingStorageType=accounting_storage/none
SchedulerParameters=bf_interval=1,sched_interval=1,sched_min_interval=1,batch_sched_delay=0
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
    fail "Slurm does not start on this machine"
}

fail() {
    echo "slurm: $*" >&2
    exit 1
}

# The archive: 64 frames as raw files, of noise, so that a shard takes for long enough to be met at work.
make_frames() {
    mkdir "$folder/frames"
    local n
    for n in $(seq -w 0 63); do head -c $((96 * 96 * 96)) /dev/urandom >"$folder/frames/$n.raw"; done
}

# A program for the tasks: the first conversion of shard 2 stands still in its second window, until it is taken away.
make_program() {
    mkdir "$folder/bin"
    cat >"$folder/bin/wavesplat" <<PROGRAM
#!/bin/bash
case "\$*" in
convert*" --shard 2/4 "*) [ -e "$folder/at-work" ] || first=1 ;;
esac
[ "\${first:-}" ] || exec "$real" "\$@"
"$real" "\$@" &
part=$folder/run.wspl.shards/part-2.wspl.part
until [ "\$(stat --format=%s "\$part" 2>/dev/null || echo 0)" -gt 4000000 ]; do sleep 0.01; done
kill -STOP \$!
[ -e "\$part" ] && touch "$folder/at-work"
wait
PROGRAM
    chmod +x "$folder/bin/wavesplat"
}

# Waits for up to a minute until a command succeeds.
await() {
    local what=$1 n
    shift
    for n in $(seq 600); do
        "$@" && return
        sleep 0.1
    done
    squeue --states=all >&2 || true
    tail -n 3 "$folder"/run.wspl.shards/*.log >&2 || true
    fail "not within a minute: $what"
}

has_state() {
    squeue --noheader --states=all --job "$1" --format=%T 2>/dev/null | grep -q "$2"
}

start_slurm
make_frames
make_program
cd "$folder"
frames="frames/ --dims 96x96x96 --dtype u8"
options="--tolerance 0 --window 4 --chain 2"
sed -e "s|^FRAMES=.*|FRAMES=($frames)|" -e "s|^OPTIONS=.*|OPTIONS=($options)|" -e "s|^SHARDS=.*|SHARDS=4|" \
    "$here/convert.sh" >convert.sh
chmod +x convert.sh
PATH="$folder/bin:$PATH" CPUS=1 ./convert.sh | tee jobs
parts=$(sed 's/.*shards \([0-9]*\),.*/\1/' jobs)
merge=$(sed 's/.*merge \([0-9]*\);.*/\1/' jobs)

await "a task at work" test -e at-work
scontrol requeue "${parts}_2"
await "the task queued again" has_state "${parts}_2" PENDING
await "the merge" has_state "$merge" 'COMPLETED\|FAILED\|CANCELLED'
tail -n 3 run.wspl.shards/*.log
grep -q ', [1-9][0-9]* of them from before' run.wspl.shards/convert-*_2.log || fail "shard 2 did not go on with its windows"
# shellcheck disable=SC2086
"$real" convert $frames $options --scan run.wspl.shards/scan.json -o one.wspl --quiet
cmp run.wspl one.wspl
echo "4 shards by Slurm, one of them taken away and queued again, have the bytes of one conversion"
