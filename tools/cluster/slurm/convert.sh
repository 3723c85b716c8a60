#!/bin/bash
# Converts one archive by many jobs of Slurm, and merges the shards. Copy it, and set the three lines below.
#
#   ./convert.sh
#
# submits an array of scans, the merge of the scans, an array of conversions, and the merge of the shards; each waits for the
# one before. A job that is preempted or whose node fails is queued again, and goes on after its last finished window. To go
# on by hand, run this again: what is complete is not made anew.
set -euo pipefail

FRAMES=(/archive/run/frames)               # what `wavesplat convert` takes, with options such as --variable
OPTIONS=(--tolerance 0.001 --memory 4GiB)  # of the conversions alone
SHARDS=16                                  # 256 frames or more each; more with a smaller --chain

OUTPUT=${OUTPUT:-run.wspl}
WORK=${WORK:-$OUTPUT.shards}
COMMON=(--parsable --requeue --open-mode=append --output="$WORK/%x-%A_%a.log")

# Runs in a job: `convert.sh step NAME`.
step() {
    local i=${SLURM_ARRAY_TASK_ID:-0} threads=${SLURM_CPUS_PER_TASK:-1}
    case $1 in
    scan)
        [ -e "$WORK/scan-$i.json" ] ||
            wavesplat scan "${FRAMES[@]}" --shard "$i/$SHARDS" --threads "$threads" -o "$WORK/scan-$i.json"
        ;;
    merge-scans)
        [ -e "$WORK/scan.json" ] || wavesplat scan --merge "$WORK"/scan-*.json -o "$WORK/scan.json"
        ;;
    convert)
        wavesplat convert "${FRAMES[@]}" "${OPTIONS[@]}" --scan "$WORK/scan.json" --shard "$i/$SHARDS" \
            --threads "$threads" --resume -o "$WORK/part-$i.wspl"
        ;;
    merge)
        wavesplat merge "$WORK"/part-*.wspl --resume -o "$OUTPUT"
        ;;
    esac
}

submit() {
    local name=$1 after=$2
    shift 2
    sbatch "${COMMON[@]}" ${after:+--dependency="afterok:$after"} --job-name="$name" "$@" "$0" step "$name"
}

if [ "${1:-}" = step ]; then
    step "$2"
    exit
fi
export OUTPUT WORK
mkdir -p "$WORK"
scans=$(submit scan "" --array="1-$SHARDS")
scan=$(submit merge-scans "$scans")
parts=$(submit convert "$scan" --array="1-$SHARDS" --cpus-per-task="${CPUS:-4}")
merge=$(submit merge "$parts")
echo "jobs: scans $scans, their merge $scan, shards $parts, merge $merge; $OUTPUT is complete when $merge is"
