#!/usr/bin/env bash
# The whole check on another release of Debian than this machine's: bash scripts/check_chroot.sh [RELEASE [FOLDER [ARGUMENT...]]]
# RELEASE (trixie) is installed by debootstrap below FOLDER (/var/chroots/RELEASE) unless it is there; the last commit is cloned into it
# anew, and `scripts/demo.sh` and `scripts/test.sh ARGUMENT...` run there. For root. Certificates and the settings of pip and apt's proxy
# are taken along, as the machine may reach its packages only with them.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
release=${1:-trixie}
chroot=${2:-/var/chroots/$release}
shift $(($# < 2 ? $# : 2))

fail() {
    printf 'check_chroot: %s\n' "$*" >&2
    exit 1
}

make_chroot() {
    [ -f "$chroot/etc/debian_version" ] && [ ! -d "$chroot/debootstrap" ] && return
    command -v debootstrap >/dev/null || fail "needs debootstrap (apt-get install debootstrap)"
    mkdir -p "$chroot"
    debootstrap --variant=minbase "$release" "$chroot"
}

take_settings() {
    local own=/usr/local/share/ca-certificates # the bundle of all is made of these and of Debian's
    mkdir -p "$chroot/etc/ssl/certs" "$chroot$own"
    [ ! -d $own ] || cp -rL $own/. "$chroot$own/"
    [ ! -f /etc/ssl/certs/ca-certificates.crt ] || cp -L /etc/ssl/certs/ca-certificates.crt "$chroot/etc/ssl/certs/"
    [ ! -f /etc/pip.conf ] || cp /etc/pip.conf "$chroot/etc/"
    cp -L /etc/resolv.conf /etc/hosts "$chroot/etc/"
}

mounted=()
release_mounts() {
    local place
    for place in "${mounted[@]}"; do umount -l "$place" || true; done
}
mount_system() {
    trap release_mounts EXIT
    local place
    for place in proc sys dev dev/shm dev/pts; do
        [ -d "/$place" ] || continue
        mkdir -p "$chroot/$place"
        mount --bind "/$place" "$chroot/$place"
        mounted=("$chroot/$place" "${mounted[@]}")
    done
}

run_inside() {
    chroot "$chroot" /usr/bin/env -i HOME=/ LANG=C.UTF-8 PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 bash -c "$1" bash "${@:2}"
}

[ "$(id -u)" -eq 0 ] || fail "chroot and mount are for root alone"
make_chroot
take_settings
mount_system
rm -rf "$chroot/checkout"
git clone -q --no-hardlinks "$root" "$chroot/checkout"
run_inside 'cat /etc/debian_version && cd /checkout && bash scripts/demo.sh && exec bash scripts/test.sh "$@"' "$@"
