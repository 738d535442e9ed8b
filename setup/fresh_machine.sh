#!/usr/bin/env bash
# Run make targets (default: demo and test) in a new Debian 12 that has only python3, make and git.
# Tests the last commit of this checkout. Uses the apt mirror and pip settings of this machine.
# Needs root and debootstrap.
set -euo pipefail

targets=("$@")
[ $# -gt 0 ] || targets=(demo test)
checkout=$(cd "$(dirname "$0")/.." && pwd)

exec 3>&2
fail() {
    echo "make fresh: $*" >&3
    exit 1
}
[ "$(id -u)" = 0 ] || fail "needs root (for debootstrap, mount and chroot); try: sudo make fresh"
command -v debootstrap >/dev/null || fail "debootstrap is missing; try: apt-get install debootstrap"
command -v unshare >/dev/null || fail "unshare is missing; it is part of util-linux"

folder=$(mktemp -d "${TMPDIR:-/tmp}/sonarhw-fresh.XXXXXX")
root=$folder/root
job=""
clean_up() {
    # the mounts and processes of the job end with its namespaces
    if [ -n "$job" ]; then
        kill -KILL "$job" 2>/dev/null || true
        wait "$job" 2>/dev/null || true
    fi
    rm -rf --one-file-system "$folder"
}
trap clean_up EXIT
trap 'fail interrupted' INT TERM HUP

# Run in the background, so that Ctrl-C is handled immediately.
run() {
    unshare --mount --pid --fork --kill-child "$@" &
    job=$!
    local status=0
    wait "$job" || status=$?
    job=""
    return "$status"
}

commit=$(git -C "$checkout" rev-parse --short HEAD)
[ -z "$(git -C "$checkout" status --porcelain)" ] || echo "make fresh: uncommitted changes are ignored"
mirror=$(apt-get indextargets --format '$(REPO_URI) $(CODENAME)' 2>/dev/null | awk '$2 == "bookworm" {print $1; exit}' || true)
mirror=${mirror:-http://deb.debian.org/debian}
echo "make fresh: installing Debian 12; takes some minutes"
if ! run debootstrap --variant=minbase --include=python3,make,git bookworm "$root" "$mirror" >"$folder/log" 2>&1; then
    tail -5 "$folder/log" >&2
    fail "debootstrap failed"
fi
cp --dereference /etc/resolv.conf "$root/etc/resolv.conf"
git clone --quiet --no-hardlinks "$checkout" "$root/src/sonarhw"

echo "make fresh: ${targets[*]}, commit $commit, Debian $(<"$root/etc/debian_version"), $(chroot "$root" python3 --version)"
run "$checkout/setup/in_fresh_machine.sh" "$root" "$checkout" "${targets[@]}" ||
    fail "FAILED: make $(cat "$root/failed" 2>/dev/null || echo "${targets[*]}"), commit $commit"
echo "make fresh: passed: ${targets[*]}, commit $commit"
