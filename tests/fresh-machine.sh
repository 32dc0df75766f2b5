#!/usr/bin/env bash
# Proves that a clone on a new minimal Debian needs one command: makes such a system in a folder, clones the
# committed state of this repository into it and runs `./dev demo` and `./dev test` (or the commands given) there.
#   tests/fresh-machine.sh [COMMAND...]     e.g. tests/fresh-machine.sh demo test
# Needs root (mounts, chroot), mmdebstrap and git. Suite, mirrors and proxy are those of this machine. The folder
# (some 4 GB in FRESH_TREE, default build/fresh) is removed at the end unless FRESH_KEEP=1; with FRESH_KEEP=1 an
# existing one is used again, to look at a failure without waiting for the packages.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if ((EUID != 0)); then exec sudo --preserve-env=FRESH_TREE,FRESH_KEEP,http_proxy,https_proxy "$0" "$@"; fi
for tool in mmdebstrap git unshare; do
    command -v "$tool" >/dev/null || {
        echo "Please install $tool, then start again." >&2
        exit 1
    }
done
commands=("$@")
((${#commands[@]})) || commands=(demo test)
tree=${FRESH_TREE:-build/fresh}
keep=${FRESH_KEEP:-0}

cleanup() {
    # All mounts live in a namespace of their own, so the tree holds nothing but its own files.
    if [[ $keep != 1 ]]; then rm -rf --one-file-system "$tree"; fi
}
trap cleanup EXIT
[[ $keep == 1 ]] || rm -rf --one-file-system "$tree"
mkdir -p "$(dirname "$tree")"

started=$SECONDS
if [[ ! -e $tree/usr/bin/apt-get ]]; then
    # The Debian archives that this machine itself uses, as sources.list lines: release, updates, security.
    # shellcheck disable=SC2016 # the format is apt's, not the shell's
    mapfile -t sources < <(apt-get indextargets --format '$(ORIGIN)|deb $(REPO_URI) $(RELEASE) $(COMPONENT)' \
        'Created-By: Packages' | sed -n 's/^Debian|//p' | sort -u)
    ((${#sources[@]})) || {
        echo "apt knows no Debian archive here; run apt-get update, then start again." >&2
        exit 1
    }
    # shellcheck source=/dev/null
    suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
    printf '%s\n' "${sources[@]}" |
        mmdebstrap --quiet --mode=root --variant=minbase "$suite" "$tree" -
fi
echo "Minimal system made in $((SECONDS - started)) s: $(find "$tree/var/lib/dpkg/info" -name '*.list' | wc -l)" \
    "packages."

# Names resolve there as here, whatever way that is done.
for file in /etc/resolv.conf /etc/hosts; do [[ ! -e $file ]] || cp -L "$file" "$tree$file"; done
rm -rf "$tree/root/groundline"
git -c safe.directory='*' clone --quiet --no-hardlinks . "$tree/root/groundline"

# inside COMMAND...: in the clone on the new system, with a bare environment.
inside() {
    # shellcheck disable=SC2016 # the inner shell has its own arguments
    unshare --mount --propagation private -- bash -c '
        set -e
        mount -t proc proc "$1/proc"
        mount -t sysfs -o ro sysfs "$1/sys" 2>/dev/null || true
        mount --rbind /dev "$1/dev"
        tree=$1
        shift
        exec chroot "$tree" /usr/bin/env -i HOME=/root TERM="${TERM:-dumb}" \
            PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
            ${http_proxy:+http_proxy="$http_proxy"} ${https_proxy:+https_proxy="$https_proxy"} \
            bash -c "cd /root/groundline && exec \"\$@\"" - "$@"' - "$tree" "$@"
}

for command in "${commands[@]}"; do
    started=$SECONDS
    echo "== ./dev $command on the new system"
    inside ./dev "$command" </dev/null
    echo "== ./dev $command took $((SECONDS - started)) s there, packages and build included"
done
inside ls demo 2>/dev/null || true
echo "The new system did it all: ${commands[*]}."
