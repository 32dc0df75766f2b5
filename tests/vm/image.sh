#!/usr/bin/env bash
# Makes the virtual robot's disk: a Debian with systemd, udev, V4L2, libcamera and LCM tools and three camera drivers
# that need no camera (vivid, v4l2loopback, vimc), an ssh server, and the kernel to boot it.
#   tests/vm/image.sh FOLDER [PACKAGE...]     packages: what the programs under test need besides
# FOLDER gets vmlinux, initrd.cpio and root.ext4, and last of all `made`, with the versions inside. Packages are kept
# in FOLDER/../debs for the next time. They come from the archives that this machine's apt uses, their versions are
# those apt knows. Needs root; nothing is installed, mounted or loaded on this machine.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$1" "$1/../debs"
folder=$(cd "$1" && pwd)
debs=$(cd "$1/../debs" && pwd)
shift

inside=(systemd systemd-sysv udev kmod iproute2 procps v4l-utils libcamera-tools libcamera-ipa liblcm-bin
    python3-minimal libpython3-stdlib openssh-server "$@")
drivers=(virtio_net virtio_console 9p 9pnet_virtio vivid v4l2-tpg videobuf2-vmalloc videobuf2-dma-contig)
boot_drivers=(virtio_pci virtio_blk ext4 crc32c_generic)

work=$(mktemp -d "${TMPDIR:-/var/tmp}/groundline-vm.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
rm -f "$folder"/{made,state*}
stage() { printf '  %-52s %3d s\n' "$1" "$SECONDS"; }
die() {
    echo "$*" >&2
    exit 1
}

# --- which kernel: the newest whose image, headers and source are to be had in one and the same version

apt-get -q update >"$folder/apt.log" 2>&1 || die "apt-get update failed; see $folder/apt.log."
# Versions of a package, newest first.
versions() { apt-cache madison "$1" | awk -F' *[|] *' '$3 ~ /Packages/ { print $2 }' | uniq; }
has_version() { versions "$1" | grep -qxF "$2"; }
kernel=
for version in $(versions linux-image-amd64); do
    image=$(apt-cache show "linux-image-amd64=$version" | sed -n 's/^Depends: \(linux-image-[^ ]*\) .*/\1/p')
    kernel=${image#linux-image-}
    common=linux-headers-${kernel%-amd64}-common
    series=$(cut -d. -f1,2 <<<"$kernel")
    if has_version "$image" "$version" && has_version "linux-headers-$kernel" "$version" &&
        has_version "$common" "$version" && has_version "linux-source-$series" "$version"; then break; fi
    kernel=
done
[[ -n $kernel ]] || die "apt knows no kernel with headers and source of one version; run apt-get update."

# unpacked PACKAGE[=VERSION] PATTERN...: its files that match, below $work/PACKAGE.
unpacked() {
    local name=${1%%=*} file
    file=$(cd "$work" && apt-get -q --print-uris download "$1" 2>/dev/null | awk '{ print $2 }')
    [[ -e $debs/$file ]] || (cd "$debs" && apt-get -q -o APT::Sandbox::User=root download "$1" >>"$folder/apt.log" 2>&1)
    mkdir -p "$work/$name"
    dpkg-deb --fsys-tarfile "$debs/$file" | tar -x -C "$work/$name" --wildcards "${@:2}"
}
unpacked "$image=$version" './boot/vmlinuz-*' './lib/modules/*'
for package in "linux-headers-$kernel=$version" "$common=$version"; do unpacked "$package" './usr/src/*'; done
unpacked "linux-kbuild-$series" './usr/lib/*'
unpacked "linux-source-$series=$version" './usr/src/*.tar.xz'
unpacked v4l2loopback-dkms './usr/src/*'
unpacked busybox-static './bin/busybox'
stage "kernel $version unpacked"

# The kernel inside its self-extracting file: an emulated processor unpacks xz for seconds, qemu starts this one as is.
python3 - "$work/$image/boot/vmlinuz-$kernel" "$folder/vmlinux" <<'PYTHON'
import lzma, sys
packed = open(sys.argv[1], "rb").read()
start = packed.index(b"\xfd7zXZ\x00")
open(sys.argv[2], "wb").write(lzma.LZMADecompressor().decompress(packed[start:]))
PYTHON

# --- drivers that Debian's kernel package leaves out

headers=$work/headers
mkdir -p "$headers"
cp -a "$work/linux-headers-$kernel/." "$work/$common/." "$work/linux-kbuild-$series/." "$headers"
grep -rlIF /usr/src/ "$headers/usr/src/linux-headers-$kernel" --include=Makefile --include='.kernelvariables' |
    xargs -r sed -i "s|/usr/src/|$headers/usr/src/|g"
mkdir -p "$work/vimc"
tar -x -f "$work/linux-source-$series"/usr/src/linux-source-*.tar.xz -C "$work/vimc" --strip-components=5 \
    --wildcards '*/drivers/media/test-drivers/vimc/*'
mkdir -p "$work/twin"
cp "$here/vimc_twin.c" "$work/twin"
echo 'obj-m := vimc_twin.o' >"$work/twin/Makefile"
loopback=$(echo "$work"/v4l2loopback-dkms/usr/src/v4l2loopback-*)
for module in "$work/vimc" "$work/twin" "$loopback"; do
    make -s -C "$headers/usr/src/linux-headers-$kernel" M="$module" CONFIG_VIDEO_VIMC=m modules \
        >>"$folder/modules.log" 2>&1 || die "The driver in $module does not build; see $folder/modules.log."
done
stage "vimc and v4l2loopback built"

# --- the root file system

root=$work/root
# Names the archives as sources.list lines, as this machine has them.
# shellcheck disable=SC2016 # the format is apt's, not the shell's
mapfile -t sources < <(apt-get indextargets --format '$(ORIGIN)|deb $(REPO_URI) $(RELEASE) $(COMPONENT)' \
    'Created-By: Packages' | sed -n 's/^Debian|//p' | sort -u)
# shellcheck source=/dev/null
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
mkdir -p "$debs/archives"
printf '%s\n' "${sources[@]}" |
    mmdebstrap --quiet --mode=root --variant=minbase --include="$(IFS=, && echo "${inside[*]}")" \
        --aptopt='APT::Install-Recommends "false"' --dpkgopt=force-unsafe-io \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' --skip=download/empty,essential/unlink,cleanup/apt/cache \
        --setup-hook="mkdir -p \"\$1/var/cache/apt/archives\" && cp -t \"\$1/var/cache/apt/archives\" $debs/archives/*.deb 2>/dev/null || true" \
        --customize-hook="mv -n \"\$1\"/var/cache/apt/archives/*.deb $debs/archives || true" \
        "$suite" "$root" - >"$folder/mmdebstrap.log" 2>&1 ||
    die "mmdebstrap failed: $(tail -3 "$folder/mmdebstrap.log")"
rm -rf "$root"/var/cache/apt/archives/*.deb "$root"/var/lib/apt/lists/*
stage "$(find "$root/var/lib/dpkg/info" -name '*.list' | wc -l) packages installed into it"

# files_of MODULE...: of these and what they need, in the order to load them.
depmod -b "$work/$image" "$kernel"
files_of() {
    local module
    for module in "$@"; do
        modprobe -d "$work/$image" -S "$kernel" --show-depends --ignore-install "$module"
    done | awk '$1 == "insmod" && !seen[$2]++ { print $2 }'
}
modules=$root/lib/modules/$kernel
mkdir -p "$modules/extra"
cp "$work/$image/lib/modules/$kernel"/modules.{builtin,builtin.modinfo,order} "$modules"
files_of "${drivers[@]}" "${boot_drivers[@]}" | xargs cp -t "$modules/extra"
cp "$work/vimc/vimc.ko" "$work/twin/vimc_twin.ko" "$loopback/v4l2loopback.ko" "$modules/extra"
strip --strip-debug "$modules"/extra/*.ko
depmod -b "$root" "$kernel"

cp -r --preserve=mode "$here/guest/." "$root/"
mkdir -p "$root/w" "$root/out"
echo robot >"$root/etc/hostname"
: >"$root/etc/fstab"
# Without one systemd takes every boot for the first and sets all units up anew, for 17 s.
sha256sum <<<"groundline" | cut -c 1-32 >"$root/etc/machine-id"
chroot "$root" systemctl --quiet enable robot.service
# What a robot without a network, terminals and disks to look after does not wait for.
chroot "$root" systemctl --quiet mask getty.target systemd-networkd.service systemd-logind.service \
    ssh.service systemd-timesyncd.service systemd-pstore.service systemd-random-seed.service systemd-update-utmp.service systemd-update-utmp-runlevel.service \
    apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer fstrim.timer e2scrub_all.timer \
    e2scrub_reap.service systemd-tmpfiles-clean.timer

used=$(du -sm "$root" | cut -f1)
rm -f "$folder/root.ext4"
mke2fs -q -t ext4 -O ^has_journal -m 0 -d "$root" "$folder/root.ext4" "$((used * 11 / 10 + 200))M" >/dev/null
stage "disk of $used MB written"

# --- the first steps of its start: drivers of the disk, the disk, over to systemd

first=$work/first
mkdir -p "$first"/{bin,dev,proc,modules,root}
cp "$work/busybox-static/bin/busybox" "$first/bin"
ln -s busybox "$first/bin/sh"
number=100
for file in $(files_of "${boot_drivers[@]}"); do
    cp "$file" "$first/modules/$((number++)).ko"
done
strip --strip-debug "$first"/modules/*.ko
cat >"$first/init" <<'SHELL'
#!/bin/sh
alias b=/bin/busybox
b mount -t devtmpfs dev /dev
for module in /modules/*.ko; do b insmod "$module"; done
until [ -b /dev/vda ]; do b usleep 20000; done
b mount -t ext4 /dev/vda /root
b mount -o move /dev /root/dev
exec /bin/busybox switch_root /root /sbin/init
SHELL
chmod 755 "$first/init"
(cd "$first" && find . | cpio --quiet -o -H newc -R 0:0) >"$folder/initrd.cpio"
{
    echo "linux $version"
    chroot "$root" dpkg-query -W
} >"$folder/made"
chown -R --reference="$folder/.." "$folder" "$debs" # the machine is then run without root
stage "image made"
