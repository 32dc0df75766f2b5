#!/usr/bin/env bash
# Makes a sysroot to cross-build groundline with: headers and libraries of another architecture, unpacked into a folder.
#   toolchains/make-sysroot.sh arm64|armhf FOLDER [--suite NAME] [--mirror URL|LINE]... [--keyring FILE]
# Suite and archives are those this machine's apt uses; with --mirror those named (a URL, or a line as in sources.list),
# which is how another distribution's sysroot is made, verified by --keyring. Nothing foreign is run and this machine's
# dpkg stays as it is. Needs root and mmdebstrap. FOLDER is made anew; FOLDER/made names what is inside.
set -euo pipefail

die() {
    echo "$*" >&2
    exit 1
}

usage="make-sysroot.sh arm64|armhf FOLDER [--suite NAME] [--mirror URL|LINE]... [--keyring FILE]"
case ${1:-} in
    arm64) triple=aarch64-linux-gnu ;;
    armhf) triple=arm-linux-gnueabihf ;;
    *) die "$usage" ;;
esac
[[ -n ${2:-} ]] || die "$usage"
if ((EUID != 0)); then exec sudo --preserve-env=http_proxy,https_proxy "$0" "$@"; fi
command -v mmdebstrap >/dev/null || die "Please install mmdebstrap, then start again."
architecture=$1
folder=$(realpath -m "$2")
shift 2
# shellcheck source=/dev/null
suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
mirrors=()
options=()
while (($#)); do
    [[ -n ${2:-} ]] || die "$usage"
    case $1 in
        --suite) suite=$2 ;;
        --mirror) mirrors+=("$2") ;;
        --keyring) options+=(--keyring="$2") ;;
        *) die "$usage" ;;
    esac
    shift 2
done
# Only what this script made is replaced, and only by a whole one.
if [[ -e $folder && ! -e $folder/made-by && -n $(ls -A "$folder") ]]; then die "$folder is not empty and no sysroot of ours."; fi

# What the programs, the tests and the benchmarks are built with; OpenCV by modules, because libopencv-dev brings all.
packages=(libc6-dev libopencv-core-dev libopencv-imgproc-dev libopencv-calib3d-dev libopencv-imgcodecs-dev
    libopencv-videoio-dev liblcm-dev libyaml-cpp-dev libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev
    libboost-dev libhwy-dev libjpeg-dev libcamera-dev libgtest-dev libbenchmark-dev)

sources=()
if ((${#mirrors[@]})); then
    for mirror in "${mirrors[@]}"; do
        if [[ $mirror == deb\ * ]]; then sources+=("$mirror"); else sources+=("deb $mirror $suite main"); fi
    done
else
    # shellcheck disable=SC2016 # the format is apt's, not the shell's
    mapfile -t sources < <(apt-get indextargets --format '$(ORIGIN)|deb $(REPO_URI) $(RELEASE) $(COMPONENT)' \
        'Created-By: Packages' | sed -n 's/^Debian|//p' | sort -u)
    ((${#sources[@]})) || die "apt knows no Debian archive here; run apt-get update, or name one by --mirror."
fi

# dpkg-shlibdeps learns from these which package, in which version, a library means; it finds them in a folder DEBIAN
# above the library, which takes the place of dpkg's own records that an unpacked tree does not have.
work=$(mktemp -d "${TMPDIR:-/var/tmp}/groundline-sysroot.XXXXXX")
mkdir -p "$(dirname "$folder")"
root=$(mktemp -d "$folder.XXXXXX")
trap 'rm -rf --one-file-system "$work" "$root"' EXIT
cat >"$work/records" <<'SHELL'
#!/bin/sh
mkdir "$1/DEBIAN"
for deb in "$1"/var/cache/apt/archives/*.deb; do
    for record in symbols shlibs; do dpkg-deb --info "$deb" "$record" 2>/dev/null >>"$1/DEBIAN/$record"; done
    dpkg-deb --show --showformat='${Package} ${Version} ${Architecture}\n' "$deb" >>"$1/packages"
done
sed -i '/^udeb:/d' "$1/DEBIAN/shlibs"
SHELL
chmod 755 "$work" "$work/records"

# unpack LINE...: a tree from these archives.
unpack() {
    rm -rf --one-file-system "$root"
    mkdir "$root"
    mmdebstrap --quiet --mode=root --variant=extract --format=directory --architectures="$architecture" \
        --hook-dir=/usr/share/mmdebstrap/hooks/merged-usr --extract-hook="$work/records \"\$1\"" \
        --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
        --dpkgopt='path-exclude=/usr/share/locale/*' --include="$(IFS=, && echo "${packages[*]}")" \
        "${options[@]}" "$suite" "$root" "$@" >"$work/log" 2>&1
}
if ! unpack "${sources[@]}"; then
    # Mirrors exist whose updates for the less common architectures lag behind their index. To build with, the release will do.
    tail -3 "$work/log" >&2
    release=()
    for line in "${sources[@]}"; do
        if [[ $line == *" $suite "* ]]; then release+=("$line"); fi
    done
    ((${#release[@]} && ${#release[@]} < ${#sources[@]})) || die "mmdebstrap failed; its last lines are above."
    echo "Trying again with $suite alone, without its updates." >&2
    unpack "${release[@]}" || die "mmdebstrap failed: $(tail -3 "$work/log")"
fi

# A link to /lib/... would lead out of the sysroot.
find "$root" -xdev -type l -lname '/*' -printf '%h\t%f\t%l\n' | while IFS=$'\t' read -r folder name target; do
    ln -sfn "$(realpath -m --no-symlinks --relative-to="$folder" "$root$target")" "$folder/$name"
done
# Links that update-alternatives would have made at installation; OpenCV's libraries need what they name.
libraries=$root/usr/lib/$triple
for library in blas lapack; do
    if [[ -e $libraries/$library/lib$library.so.3 ]]; then ln -sfn "$library/lib$library.so.3" "$libraries"; fi
done
rm -rf "$root"/var/{cache,lib}/apt

mv "$root/packages" "$root/made"
cp "$0" "$root/made-by" # by which ./dev sees whether this script has changed
chown -R --reference="$root/.." "$root"
rm -rf --one-file-system "$folder"
mv "$root" "$folder"
echo "Sysroot of $architecture: $(wc -l <"$folder/made") packages, $(du -sh "$folder" | cut -f1), made in $SECONDS s."
