#!/usr/bin/env bash
# instructions.sh BENCH_MATCHERS [--size WxHxD] [--matchers NAME,...] [--units]: instructions a voxel of each matcher,
# counted by callgrind, which repeats to the last digit on any load. Two runs that differ by one frame are taken from
# each other, so start-up and the first frame's memory do not count.
set -euo pipefail

bench=$1
shift
size=320x240x32
matchers=()
units=0
while (($#)); do
    case $1 in
        --size) size=${2:?} && shift 2 ;;
        --matchers) matchers=(--matchers "${2:?}") && shift 2 ;;
        --units) units=1 && shift ;;
        *)
            echo "instructions.sh does not know '$1'; it takes --size WxHxD, --matchers NAME,... and --units." >&2
            exit 2
            ;;
    esac
done
IFS=x read -r width height disparities <<<"$size"

# count NAME FRAMES [UNIT]: instructions of the whole run.
count() {
    local words=(--match "$1" --sizes "$size" --frames "$2") said
    if [[ -n ${3:-} ]]; then words+=(--unit "$3"); fi
    said=$(valgrind --tool=callgrind --callgrind-out-file=/dev/null "$bench" "${words[@]}" 2>&1) || {
        printf '%s\n' "$said" >&2
        return 1
    }
    awk '/Collected :/ { print $4 }' <<<"$said"
}

# row NAME [UNIT]
row() {
    local one two
    one=$(count "$1" 1 "${2:-}")
    two=$(count "$1" 2 "${2:-}")
    awk -v name="$1${2:+ $2}" -v frame=$((two - one)) -v voxels=$((width * height * disparities)) \
        'BEGIN { printf "%-34s  %9.1f  %11.2f\n", name, frame / 1e6, frame / voxels }'
}

# Under valgrind the processor has fewer vector units than bare.
list=$(valgrind -q --tool=none "$bench" --list "${matchers[@]}")
best=$(awk '$1 == "unit" { print $2; exit }' <<<"$list")
printf '%-34s  %9s  %11s\n' "$size, ours on $best" "M a frame" "a voxel"
while read -r kind name; do
    if [[ $kind == ours ]] && ((units)); then
        while read -r unit; do row "$name" "$unit"; done < <(awk '$1 == "unit" { print $2 }' <<<"$list")
    elif [[ $kind != unit ]]; then
        row "$name"
    fi
done <<<"$list"
