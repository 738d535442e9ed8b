#!/bin/sh
# Print the size of an image, and fail beyond its limits.
# Arguments: name, file, bytes of flash memory, bytes of memory for variables and stack, least bytes for the stack
set -eu
avr-size -A "$2" | awk -v name="$1" -v flash="$3" -v memory="$4" -v least="$5" '
    $1 == ".text" || $1 == ".data" { code += $2 }
    $1 == ".data" || $1 == ".bss" || $1 == ".noinit" { variables += $2 }
    END {
        stack = memory - variables
        printf "%-24s flash %6d of %6d bytes   variables %5d of %5d, stack %5d, at least %5d\n",
            name, code, flash, variables, memory, stack, least
        exit code > flash || stack < least
    }'
