#!/usr/bin/env bash
# Runs the steps of %files, %post and %test of pbem.def in a Debian below a folder, for root:
#     bash scripts/packaging/try_post.sh [FOLDER]
# FOLDER (/var/chroots/trixie) is one that scripts/check_chroot.sh has made. The last commit is what is installed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd -P)
definition=$root/scripts/packaging/pbem.def
chroot=${1:-/var/chroots/trixie}

# The lines of a section, up to the next one.
section() { awk -v name="%$1" '/^%/ { on = ($1 == name); next } on' "$definition"; }

[ "$(id -u)" -eq 0 ] && [ -f "$chroot/etc/debian_version" ] || { echo "try_post: for root, with a Debian in $chroot" >&2; exit 1; }
rm -rf "$chroot/opt/pbem"
mkdir -p "$chroot/opt/pbem"
section files | while read -r source target; do
    [ -n "$source" ] || continue
    git -C "$root" archive HEAD "$source" | tar -x -C "$chroot/opt/pbem"
    [ -e "$chroot$target" ] || { echo "try_post: $source is not where %files puts it" >&2; exit 1; }
done

trap 'for place in dev/shm dev sys proc; do umount -l "$chroot/$place" 2>/dev/null || true; done' EXIT
for place in proc sys dev dev/shm; do mount --bind "/$place" "$chroot/$place"; done
for part in post test; do
    echo "try_post: %$part"
    section $part | chroot "$chroot" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin /bin/sh -s
done
echo "try_post: done"
