#!/usr/bin/env bash
# instructions.sh BENCH_MATCHERS [--size WxHxD] [--matchers NAME,...] [--units | --emulated QEMU PLUG-IN [--functions]]:
# instructions of each matcher, a frame and a voxel, which repeat to the last digit on any load. Two runs that differ by
# one frame are taken from each other, so start-up and the first frame's memory do not count. Counted by callgrind, or
# for another processor by QEMU (its words) with tests/bench/count_instructions.cpp; --functions adds what each of our
# functions takes, from 1 % on.
set -euo pipefail

bench=$1
shift
size=320x240x32
matchers=()
units=0
emulator=()
plugin=
functions=0
while (($#)); do
    case $1 in
        --size) size=${2:?} && shift 2 ;;
        --matchers) matchers=(--matchers "${2:?}") && shift 2 ;;
        --units) units=1 && shift ;;
        --emulated) read -ra emulator <<<"${2:?}" && plugin=${3:?} && shift 3 ;;
        --functions) functions=1 && shift ;;
        *)
            echo "instructions.sh does not know '$1'; it takes --size WxHxD, --matchers NAME,... and --units," \
                "emulated --functions instead of --units." >&2
            exit 2
            ;;
    esac
done
IFS=x read -r width height disparities <<<"$size"

# count NAME FRAMES [UNIT]: "instructions: N" of the whole run; lines "function N NAME" where asked for.
count() {
    local words=("$bench" --match "$1" --sizes "$size" --frames "$2") said
    if [[ -n ${3:-} ]]; then words+=(--unit "$3"); fi
    if ((${#emulator[@]})); then
        words=("${emulator[@]}" -plugin "$(realpath "$plugin"),functions=$( ((functions)) && echo on || echo off)"
            -d plugin "${words[@]}")
    else
        words=(valgrind --tool=callgrind --callgrind-out-file=/dev/null "${words[@]}")
    fi
    said=$("${words[@]}" 2>&1) || {
        printf '%s\n' "$said" >&2
        return 1
    }
    awk '/Collected :/ { print "instructions:", $4 } /^(instructions:|function) /' <<<"$said"
}

# row NAME [UNIT]
row() {
    local one two
    one=$(count "$1" 1 "${2:-}")
    two=$(count "$1" 2 "${2:-}")
    awk -v name="$1${2:+ $2}" -v voxels=$((width * height * disparities)) '
        $1 == "instructions:" { all[++runs] = $2 }
        $1 == "function" { count = $2; $1 = $2 = ""; by[$0] += runs == 1 ? -count : count }
        END {
            frame = all[2] - all[1]
            printf "%-34s  %9.1f  %11.2f\n", name, frame / 1e6, frame / voxels
            sort = "sort -k1,1nr"
            for (each in by) if (by[each] > 0.01 * frame) printf "    %9.1f %s\n", by[each] / 1e6, each | sort
        }' <<<"$one"$'\n'"$two" | c++filt
}

# Under valgrind the processor has fewer vector units than bare.
bare=("${emulator[@]}")
((${#bare[@]})) || bare=(valgrind -q --tool=none)
list=$("${bare[@]}" "$bench" --list "${matchers[@]}")
best=$(awk '$1 == "unit" { print $2; exit }' <<<"$list")
printf '%-34s  %9s  %11s\n' "$size, ours on $best" "M a frame" "a voxel"
while read -r kind name; do
    if [[ $kind == ours ]] && ((units)); then
        while read -r unit; do row "$name" "$unit"; done < <(awk '$1 == "unit" { print $2 }' <<<"$list")
    elif [[ $kind != unit ]]; then
        row "$name"
    fi
done <<<"$list"
