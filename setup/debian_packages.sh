#!/bin/sh
# The Debian packages that make demo and make test need: installed where we may, otherwise named in one line. The first
# line of them is for the firmware and its emulated board. Named as arguments, others are installed instead.
# Elsewhere than on Debian and its children there is nothing to do here.
set -eu

PACKAGES="make gcc libc6-dev pkg-config gcc-avr avr-libc libsimavr-dev libelf-dev
python3-venv ser2net xvfb xauth xdotool fonts-dejavu-core libegl1 libgl1 libxkbcommon-x11-0 libdbus-1-3 libfontconfig1
libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0 libxcb-render-util0 libxcb-shape0 libxcb-xinerama0"

command -v dpkg-query >/dev/null || exit 0

missing=""
for package in ${*:-$PACKAGES}; do
    dpkg-query --show --showformat='${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed ||
        missing="$missing $package"
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" = 0 ]; then
    as_root=""
elif sudo -n true 2>/dev/null; then
    as_root="sudo"
else
    echo "Debian packages to install first (as root): apt-get install$missing" >&2
    exit 0
fi
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086  # a list of words is meant
$as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
case "$missing" in
*" ser2net"*)
    # the tests start their own; the service that comes with it would offer this machine's serial ports to everyone on it
    ! command -v systemctl >/dev/null || $as_root systemctl disable --quiet --now ser2net 2>/dev/null || true
    ;;
esac
