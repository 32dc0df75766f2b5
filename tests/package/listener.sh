#!/bin/sh
# listener.sh BUILD FOLDER: examples/listener builds with what the package groundline-dev installs, and hears the masks
# of a replay. BUILD is a build folder, FOLDER is ours.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "$1" && pwd)
rm -rf "$2" && mkdir -p "$2" && cd "$2"
cmake --install "$build" --component dev --prefix "$PWD/usr" >/dev/null
# Without the repository in sight: a header that was not installed must be missed.
cp -r "$root/examples/listener" listener
cmake -S listener -B built -DCMAKE_PREFIX_PATH="$PWD/usr" -DCMAKE_CXX_FLAGS="-Wall -Wextra -Werror" >/dev/null
cmake --build built >/dev/null
"$build/src/cli/groundline" replay 'synthetic:drive?width=160&height=120&focal=125' --frames 3 --quiet \
    --lcm-url "file://$PWD/masks.lcm?mode=w"
built/listener "file://$PWD/masks.lcm?speed=0" >heard
cat heard
[ "$(grep -c '^frame [0-2], verdict [12]: .*traversable [1-9]' heard)" = 3 ] || {
    echo "that is not what three frames of a drive over a plain should give"
    exit 1
}
