#!/usr/bin/env bash
# Run make targets inside ROOT, a system made by fresh_machine.sh: in_fresh_machine.sh ROOT CHECKOUT TARGET...
# Runs in its own mount and process namespaces. All mounts end with them.
set -euo pipefail
root=$1 checkout=$2
shift 2

# Mount a file or folder of this machine read-only at TO inside ROOT. Does nothing if it does not exist.
mount_host() {
    local from=$1 to=$root${2:-$1}
    [ -e "$from" ] && [ ! -e "$to" ] || return 0
    mkdir -p "$(dirname "$to")"
    if [ -d "$from" ]; then mkdir "$to"; else touch "$to"; fi
    mount --bind -o ro "$from" "$to"
}

mount -t proc proc "$root/proc"
mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts"
mkdir -p "$root/dev/shm"
mount -t tmpfs shm "$root/dev/shm"

# settings of apt and pip, certificates, and local package folders that pip's settings name
apt-config dump 2>/dev/null | grep -E '^Acquire::(http|https|Check|Retries)' >"$root/etc/apt/apt.conf.d/99host" || true
for item in /etc/pip.conf /etc/xdg/pip; do mount_host "$item"; done
mount_host "$HOME/.config/pip" /root/.config/pip
mount_host "$HOME/.pip" /root/.pip
settings=()
while read -r name; do
    settings+=("$name=${!name}")
done < <(compgen -e | grep -E '^PIP_|_(proxy|PROXY)$' || true)
certificates=/etc/ssl/certs/ca-certificates.crt
if [ -e "$certificates" ]; then
    # a separate path, because the package ca-certificates may be installed and write to the usual one
    mount_host "$certificates" /host-certificates.crt
    settings+=(PIP_CERT=/host-certificates.crt SSL_CERT_FILE=/host-certificates.crt)
fi
while read -r item; do
    [ ! -d "$item" ] || mount_host "${item%/simple}" # the files of a local index are beside simple/
done < <({ python3 -m pip config list 2>/dev/null || true; } | sed 's/\\n/ /g; s|file://||g' | tr "'\" =," '\n' | grep '^/.' | sort -u)
mount_host "$checkout/../shared/real_scans" /src/shared/real_scans

for target in "$@"; do
    # background jobs ignore SIGINT, and the tests of Ctrl-C would inherit this
    if ! env -i --default-signal=INT,QUIT,HUP HOME=/root LANG=C.UTF-8 "${settings[@]}" \
        PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        chroot "$root" make -C /src/sonarhw "$target" </dev/null; then
        echo "$target" >"$root/failed"
        exit 1
    fi
    if [ "$target" = demo ] && [ "$1" = demo ] && [ -e "$root/usr/bin/gcc" -o -e "$root/src/sonarhw/.venv/bin/pytest" ]; then
        echo "demo (it installed a compiler or test tools)" >"$root/failed"
        exit 1
    fi
done
