#!/bin/sh
# controller.sh BUILD FOLDER: both programs of examples/controller stop before the daemon runs, drive while it does, and
# stop again when it ends. BUILD is a build folder, FOLDER is ours. Exit status 77 where no multicast is to be had.
set -eu
if ! ip route get 239.255.76.67 >/dev/null 2>&1; then # a network of our own, where we may
    [ -z "${GROUNDLINE_OWN_NETWORK:-}" ] || exit 77
    unshare -n true 2>/dev/null || { echo "no multicast route, and no network of one's own"; exit 77; }
    GROUNDLINE_OWN_NETWORK=yes exec unshare -n sh -c \
        'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"' sh "$0" "$@"
fi
command -v python3 >/dev/null || { echo "no python3"; exit 77; }
root=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "$1" && pwd)
rm -rf "$2" && mkdir -p "$2" && cd "$2"
cmake --install "$build" --component dev --prefix "$PWD/usr" >/dev/null
cp -r "$root/examples/controller" controller
cmake -S controller -B built -DCMAKE_PREFIX_PATH="$PWD/usr" -DCMAKE_CXX_FLAGS="-Wall -Wextra -Werror" >/dev/null
cmake --build built >/dev/null
lcm-gen -p --ppath . usr/share/groundline/lcmtypes/*.lcm

port=$((20000 + $$ % 20000)) # of this test alone
url="udpm://239.255.76.67:$port?ttl=0"
built/controller "$url" >cpp &
listeners=$!
PYTHONPATH=. python3 controller/controller.py "$port" >python &
listeners="$listeners $!"
trap 'kill $listeners $daemon 2>/dev/null || true' EXIT
daemon=
: >groundline.yaml
# until WHAT: both have said, as their last word, what begins like that.
until_both() {
    for _ in $(seq 300); do
        tail -n 1 cpp | grep -q "^$1" && tail -n 1 python | grep -q "^$1" && return 0
        sleep 0.1
    done
    tail -n 3 cpp python
    echo "not both came to say: $1"
    return 1
}
until_both "stop: nothing new"
"$build/src/daemon/groundlined" --config groundline.yaml --set capture.driver=synthetic \
    --set 'capture.source=plane?width=320&height=240&focal=250&rate_hz=20' --set realtime.scheduling=off \
    --set publish.url="$url" 2>daemon.log &
daemon=$!
until_both "\(go\|slow\)" || { cat daemon.log && exit 1; }
kill "$daemon"
until_both "stop: nothing new"
sort cpp | uniq -c
sort python | uniq -c
