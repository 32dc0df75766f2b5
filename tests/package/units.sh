#!/bin/sh
# units.sh PROGRAMS FOLDER: systemd finds no fault in the units, and each of them is confined.
# PROGRAMS is where groundlined is, FOLDER is ours.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
programs=$(cd "$1" && pwd)
if ! command -v systemd-analyze >/dev/null; then
    echo "skipped: there is no systemd-analyze here to judge the units"
    exit 77
fi
rm -rf "$2" && mkdir -p "$2" && cd "$2"
cmake -DCMAKE_INSTALL_PREFIX="$PWD" -DWRITTEN="$PWD/written" -DSBIN="$programs" -P "$root/systemd/install.cmake" >/dev/null
export SYSTEMD_UNIT_PATH="$PWD/lib/systemd/system:" # then systemd's own
units="groundlined.service groundlined@front.service groundline-replay@srv-drive.service groundline-lcm-route.service"
status=0
# shellcheck disable=SC2086 # words
if ! faults=$(systemd-analyze verify --man=no $units 2>&1) || [ -n "$faults" ]; then
    echo "systemd-analyze verify: $faults"
    status=1
fi
for unit in $units; do
    # In tenths: 2.0 for what runs for long, 2.2 for the route, which cannot be set without a capability.
    case $unit in *route*) most=22 ;; *) most=20 ;; esac
    if ! said=$(systemd-analyze security --offline=true --threshold=$most "$unit" 2>&1); then
        echo "$said" | grep -E '✗' || true
        status=1
    fi
    echo "$said" | tail -1
done
exit $status
