#!/bin/sh
# Install the Debian packages of the named sets. If this needs a password, print the packages instead.
# Sets: demo, firmware, test, soak. Does nothing on systems without dpkg.
set -eu

# the window; Qt loads these libraries even without a display
DEMO="python3-venv fonts-dejavu-core libegl1 libgl1 libglib2.0-0 libxkbcommon-x11-0 libdbus-1-3 libfontconfig1
libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0 libxcb-render-util0 libxcb-shape0 libxcb-xinerama0"
# the firmware, its test library and the emulated board
FIRMWARE="make gcc libc6-dev pkg-config gcc-avr avr-libc libsimavr-dev libelf-dev"
# X server for window tests, simulated keys, serial port server, programmer of boards
TEST="xvfb xauth xdotool ser2net avrdude"
# libFuzzer
SOAK="clang libclang-rt-dev"

packages=""
for set in "$@"; do
    case "$set" in
    demo) packages="$packages $DEMO" ;;
    firmware) packages="$packages $FIRMWARE" ;;
    test) packages="$packages $TEST" ;;
    soak) packages="$packages $SOAK" ;;
    *)
        echo "$0: unknown set $set; expected demo, firmware, test or soak" >&2
        exit 2
        ;;
    esac
done

command -v dpkg-query >/dev/null || exit 0

missing=""
for package in $packages; do
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
echo "Installing Debian packages: about a minute"
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086  # word splitting is intended
log=$($as_root apt-get install -y -qq --no-install-recommends $missing 2>&1) || {
    printf '%s\n' "$log" >&2
    exit 1
}
case "$missing" in
*" ser2net"*)
    # the tests start their own ser2net; its service would expose the serial ports of this machine to the network
    ! command -v systemctl >/dev/null || $as_root systemctl disable --quiet --now ser2net 2>/dev/null || true
    ;;
esac
