#!/usr/bin/env bash
# board-root.sh arm64|armhf PACKAGES GROUNDLINE FOLDER: the packages install on a minimal Debian of that architecture with
# all they depend on; what they install sees there what GROUNDLINE, this machine's program, sees, byte for byte; and the
# daemon's masks are heard there. Runs under qemu-user in namespaces of its own: nothing is registered, mounted or
# installed on this machine. Needs root, Linux 6.7, mmdebstrap, arch-test, qemu-user-static. FOLDER (1 GB) is ours.
set -euo pipefail
die() {
    echo "$*" >&2
    exit 1
}
case ${1:-} in
    # The head of an executable of that machine; which of its bits count is below.
    arm64) emulator=qemu-aarch64-static magic='\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00' ;;
    armhf) emulator=qemu-arm-static magic='\x7fELF\x01\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\x28\x00' ;;
    *) die "board-root.sh takes arm64 or armhf." ;;
esac

# Starts itself again where the kernel hands executables of that machine to the emulator: since Linux 6.7 a user namespace
# has its own table for that. All ids stay what they are, so that dpkg may give files to others than root.
case ${BOARD_ROOT:-outside} in
    outside)
        ((EUID == 0)) || die "board-root.sh needs root."
        trap 'rm -rf --one-file-system "$4/root"' EXIT # out here nothing is mounted in it
        BOARD_ROOT=unmapped unshare --user --mount -- "$0" "$@" &
        until [[ $(readlink /proc/$!/ns/user) != "$(readlink /proc/self/ns/user)" ]]; do sleep 0.05; done
        for map in uid_map gid_map; do echo '0 0 4294967295' >"/proc/$!/$map"; done
        wait $!
        exit
        ;;
    unmapped)
        until read -r _ </proc/self/uid_map; do sleep 0.05; done
        BOARD_ROOT=inside exec unshare --pid --fork --kill-child --mount-proc -- "$0" "$@"
        ;;
esac
emulator=$(command -v "$emulator") || die "Please install qemu-user-static."
mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
printf %s ":board:M::$magic:\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff:$emulator:OCF" \
    >/proc/sys/fs/binfmt_misc/register

architecture=$1
packages=$(cd "$2" && pwd)
groundline=$(realpath "$3")
mkdir -p "$4"
root=$(realpath "$4")/root
here=$(realpath "$4")/here
rm -rf --one-file-system "$root" "$here"
# shellcheck disable=SC2016 # the format is apt's, not the shell's
mapfile -t sources < <(apt-get indextargets --format '$(ORIGIN)|deb $(REPO_URI) $(RELEASE) $(COMPONENT)' \
    'Created-By: Packages' | sed -n 's/^Debian|//p' | sort -u)
# shellcheck source=/dev/null
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
started=$SECONDS
# No package gets its documentation, and nothing waits for the disk.
printf '%s\n' "${sources[@]}" | mmdebstrap --quiet --mode=root --variant=apt --format=directory \
    --architectures="$architecture" --skip=check/chroot,chroot/mount --dpkgopt='path-exclude=/usr/share/doc/*' \
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt=force-unsafe-io "$suite" "$root" -
for device in null zero full random urandom; do
    : >"$root/dev/$device"
    mount --bind "/dev/$device" "$root/dev/$device"
done
mount -t proc proc "$root/proc"
for file in /etc/resolv.conf /etc/hosts; do [[ ! -e $file ]] || cp -L "$file" "$root$file"; done
cp "$packages"/groundline_*.deb "$packages"/groundline-libcamera_*.deb "$root/root/"
there() {
    chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive \
        ${http_proxy:+http_proxy="$http_proxy"} ${https_proxy:+https_proxy="$https_proxy"} sh -ec "$1"
}
there 'apt-get -q update && apt-get -q -y --no-install-recommends install liblcm-bin /root/*.deb' >"$(dirname "$root")/apt.log" 2>&1 ||
    die "The packages do not install: $(tail -5 "$(dirname "$root")/apt.log")"
echo "Minimal $architecture system with the packages made in $((SECONDS - started)) s."

scene='synthetic:drive?width=160&height=120&focal=125&boxes=2'
"$groundline" replay "$scene" --frames 3 --quiet --out "$here" >/dev/null
there "groundline replay '$scene' --frames 3 --quiet --out /root/there" >/dev/null
for result in disparity mask frames.jsonl; do
    diff -r "$here/$result" "$root/root/there/$result" || die "$result is another one on $architecture."
done
echo "Disparities, masks and frames.jsonl of 3 frames are the same bytes."

# A network of its own: the route to its loopback is what groundline-lcm-route.service sets.
unshare --net --mount -- chroot "$root" sh -ec '
    ip link set lo up
    ip route add "$(groundlined --print-loopback-group)/32" dev lo
    lcm-logger --quiet -c "GROUNDLINE_.*" /root/heard &
    sleep 5
    groundlined --set capture.driver=synthetic --set "capture.source=plane?width=160&height=120&focal=125&rate_hz=2" \
        --set realtime.scheduling=off --set realtime.lock_memory=off &
    daemon=$!
    for i in $(seq 60); do
        sleep 1
        ! grep -q -a GROUNDLINE_MASK /root/heard || break
    done
    kill -TERM $daemon && wait $daemon
    grep -q -a GROUNDLINE_MASK /root/heard' || die "No mask was heard on $architecture."
echo "The daemon's masks are heard there, and it ends with status 0."
