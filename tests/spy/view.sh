#!/bin/sh
# view.sh BUILD FOLDER: the view decodes and draws what a replay published; then, where there is an X server to be had
# (Xvfb), lcm-spy itself finds our types and the plug-in, and both windows open. BUILD is a build folder, FOLDER is ours.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)
rm -rf "$2" && mkdir -p "$2" && cd "$2"
"$build/src/cli/groundline" replay 'synthetic:drive?seed=7' --frames 3 --quiet --set publish.preview=on \
    --set publish.v_disparity=on --lcm-url "file://$PWD/log?mode=w"
jars=$build/src/spy/groundline-spy.jar:/usr/share/java/lcm.jar
javac -d . -cp "$jars" "$here/ViewTest.java"
java -Djava.awt.headless=true -cp ".:$jars" groundline.spy.ViewTest log view.png

command -v Xvfb >/dev/null && command -v xwininfo >/dev/null || { echo "no Xvfb or xwininfo: windows not tried"; exit 0; }
display=:$((1000 + $$ % 30000))
Xvfb "$display" -screen 0 1400x900x24 -nolisten tcp >xvfb.log 2>&1 &
started=$!
trap 'kill $started 2>/dev/null || true' EXIT
export DISPLAY="$display"
url="udpm://239.255.76.67:$((20000 + $$ % 20000))?ttl=0"
"$build/src/spy/groundline-spy" --lcm-url "$url" >spy.log 2>&1 &
started="$started $!"
"$build/src/spy/groundline-spy" --view --lcm-url "$url" >alone.log 2>&1 &
started="$started $!"
# eventually WHAT COMMAND...: the command succeeds within 30 s.
eventually() {
    what=$1 && shift
    for _ in $(seq 150); do
        "$@" >/dev/null 2>&1 && return 0
        sleep 0.2
    done
    cat spy.log alone.log
    echo "not so: $what"
    return 1
}
shown() { xwininfo -root -tree | grep -q "\"$1\""; }
eventually "lcm-spy opens" shown "LCM Spy"
eventually "the view opens alone" shown "groundline: GROUNDLINE"
eventually "our types are found" grep -q "Found 1[0-9] LCM types" spy.log
eventually "the plug-in is found" grep -q "Found 1 plugins" spy.log
