#!/usr/bin/env bash
# deploy.sh HOST [--libcamera]: puts the newest packages for HOST's architecture there over ssh, restarts the service (where
# it is disabled, those of the rigs that run) and says how it is. HOST is as for ssh; root there, or a user who may use sudo. GROUNDLINE_SSH: another ssh command, with
# options; GROUNDLINE_PACKAGES: where to look for packages, if not below build/. The configuration there stays as it is.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

host=${1:-}
driver=${2:-}
if [[ -z $host || $host == -* || ($driver && $driver != --libcamera) ]]; then
    echo "usage: ./dev deploy [USER@]HOST [--libcamera]" >&2
    exit 2
fi
read -ra ssh <<<"${GROUNDLINE_SSH:-ssh}"
die() {
    printf '%s\n' "$*" >&2
    exit 1
}

# shellcheck disable=SC2016 # the format is dpkg-query's
about=$("${ssh[@]}" "$host" 'dpkg --print-architecture && { dpkg-query -W -f "\${db:Status-Status}" groundline-libcamera 2>/dev/null || true; }') ||
    die "$host does not let us in, or is no Debian: try ${ssh[*]} $host"
arch=${about%%$'\n'*}
[[ $about == *$'\n'installed ]] && driver=--libcamera # the two must be of one build

# The newest for that architecture, wherever it was built.
newest() {
    find "${GROUNDLINE_PACKAGES:-build}" -name "$1_*_$arch.deb" -not -path 'build/vm/*' -not -path '*/_CPack_Packages/*' -printf '%T@ %p\n' | sort -rn | sed -n '1s/^[^ ]* //p'
}
debs=("$(newest groundline)")
[[ -n ${debs[0]} ]] || die "There is no package for $arch yet: ./dev package makes it here for this machine's architecture," \
    "./dev cross $arch for another."
if [[ $driver ]]; then
    name=${debs[0]##*/}
    debs+=("${debs[0]%/*}/${name/groundline_/groundline-libcamera_}")
    [[ -e ${debs[1]} ]] || die "${debs[1]} was not built: libcamera-dev was missing when ${debs[0]} was."
fi
printf 'To %s (%s):\n' "$host" "$arch"
printf '  %s\n' "${debs[@]}"

folder=$("${ssh[@]}" "$host" 'mktemp -d /tmp/groundline-deploy.XXXXXX')
leave() { "${ssh[@]}" "$host" "rm -r '$folder'"; }
trap leave EXIT
tar -C "${debs[0]%/*}" -c "${debs[@]##*/}" | "${ssh[@]}" "$host" "tar -C '$folder' -x"

# Runs there; apt fetches what the packages depend on. The version may be the one that is there, of another build.
# shellcheck disable=SC2016 # its variables are those of the other side
there='
[ "$(id -u)" = 0 ] || exec sudo sh "$0" "$@"
cd "$(dirname "$0")"
export DEBIAN_FRONTEND=noninteractive
units=$(systemctl list-units --plain --no-legend --state=active,activating,reloading \
    groundlined.service "groundlined@*.service" | cut -d " " -f 1)
apt-get -q -y --no-install-recommends --reinstall --allow-downgrades -o Dpkg::Use-Pty=0 \
    -o Dpkg::Options::=--force-confdef -o Dpkg::Options::=--force-confold install ./*.deb || {
    echo "The packages are not installed; the lines above say why. Without a network over there, install first what they"
    echo "depend on: dpkg-deb -f PACKAGE.deb Depends"
    exit 1
}
if systemctl -q is-enabled groundlined.service; then
    units=$(printf "%s\n" groundlined.service "$units" | sort -u)
fi
if [ -z "$units" ]; then
    echo "Installed. groundlined is disabled there and no rig of its own runs, so nothing was started."
    exit 0
fi
status=0
for unit in $units; do
    if systemctl restart "$unit"; then
        systemctl --no-pager --lines=8 status "$unit"
        continue
    fi
    status=1
    name=${unit%.service}
    case $name in
        *@*) file=/etc/groundline/${name#*@}.yaml ;;
        *) file=/etc/groundline/groundline.yaml ;;
    esac
    journalctl --no-pager -o cat -n 12 -u "$unit"
    case $(systemctl show -P ExecMainStatus "$unit") in
        78) echo "$name is installed, but refuses its configuration: put right what is named above in
$file, try it with groundlined --config $file --check-config, then systemctl start $name." ;;
        66) echo "$name is installed, but what it is to read is not there: see the file named above." ;;
        *) echo "$name is installed, but does not come up: journalctl -u $name shows all it said, and
groundlined --config $file --check-config tries its configuration." ;;
    esac
done
exit "$status"
'
"${ssh[@]}" "$host" "cat >'$folder/install'" <<<"$there"
terminal=()
[[ ! -t 0 ]] || terminal=(-t) # for the password that sudo asks for
"${ssh[@]}" "${terminal[@]}" "$host" "sh '$folder/install'"
