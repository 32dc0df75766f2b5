#!/usr/bin/env bash
# demo.sh BUILD_FOLDER: what `./dev demo` shows, once groundline is built there. Inputs are kept under
# BUILD_FOLDER/../demo, results go to demo/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

groundline=$(find "$1" -type f -name groundline -perm -u+x -print -quit)
[[ -n $groundline ]] || {
    echo "There is no program groundline under $1; build it first." >&2
    exit 1
}
inputs=build/demo
results=demo
package=python3-skimage # its motorcycle pair: Middlebury 2014, a quarter of the size, with truth
data=../shared/data
frames=10
mkdir -p "$inputs" "$results"
scratch=$(mktemp -d "$inputs/.scratch-XXXXXX")
trap 'rm -rf "$scratch"' EXIT
sets=() # "name truth-folder-or-empty"

# Takes three files out of the Debian package into $inputs/motorcycle; nothing is installed. The folder appears
# whole or not at all.
fetch_motorcycle() {
    [[ -e $inputs/motorcycle/disp.png ]] && return
    echo "Downloading Debian's $package (about 20 MB) for a real stereo pair with truth."
    (cd "$scratch" && apt-get -q download "$package") >"$scratch/log" 2>&1 || {
        grep -E '^E:' "$scratch/log" >&2 || true
        echo "The real pair is skipped: Debian's $package could not be downloaded (no network, or no package" \
            "lists; \"apt-get update\" as root fetches those)." >&2
        return 1
    }
    local pair=$scratch/motorcycle from=$scratch/package/usr/lib/python3/dist-packages/skimage/data
    mkdir "$pair" "$scratch/package"
    dpkg-deb -x "$scratch/$package"_*.deb "$scratch/package"
    if ! mv "$from/motorcycle_left.png" "$pair/left.png" ||
        ! mv "$from/motorcycle_right.png" "$pair/right.png" ||
        ! python3 tests/tools/npz_to_disparity_png.py "$from/motorcycle_disp.npz" "$pair/disp.png"; then
        echo "The real pair is skipped: $package no longer holds what this looks for." >&2
        return 1
    fi
    # Middlebury's form. Figures from scikit-image's documentation of stereo_motorcycle; ndisp is a quarter of
    # the 280 of the full-size set.
    cat >"$pair/calib.txt" <<'CALIBRATION'
cam0=[994.978 0 311.193; 0 994.978 254.877; 0 0 1]
cam1=[994.978 0 342.279; 0 994.978 254.877; 0 0 1]
doffs=31.086
baseline=193.001
width=741
height=500
ndisp=70
CALIBRATION
    rm -rf "$inputs/motorcycle"
    mv "$pair" "$inputs/motorcycle"
}

# replay NAME SOURCE [TRUTH]
replay() {
    echo
    echo "== $1: groundline replay $2 --out $results/$1"
    "$groundline" replay "$2" --out "$results/$1"
    if [[ -n ${3:-} ]]; then
        echo "== $1: groundline evaluate $3 $results/$1"
        "$groundline" evaluate "$3" "$results/$1"
        "$groundline" evaluate "$3" "$results/$1" --json >"$scratch/$1.json"
    fi
    sets+=("$1")
}

if fetch_motorcycle; then replay motorcycle "$inputs/motorcycle" "$inputs/motorcycle"; fi

rm -rf "$inputs/drive"
echo
echo "== drive: groundline synth drive --frames $frames --out $inputs/drive"
"$groundline" synth drive --frames "$frames" --out "$inputs/drive"
replay drive "$inputs/drive" "$inputs/drive"

for name in kitti_seq1 k10_rover devon_rover1; do
    if [[ -d $data/$name ]]; then replay "$name" "$data/$name"; fi
done

python3 tests/tools/demo_table.py "$results" "$scratch" "${sets[@]}" >"$scratch/summary.txt"
mv "$scratch/summary.txt" "$results/summary.txt"
echo
cat "$results/summary.txt"
echo
echo "Pictures: $PWD/$results/*/overlay, vdisparity, mask and disparity. Summary: $PWD/$results/summary.txt, and" \
    "a summary.json beside each set's pictures."
