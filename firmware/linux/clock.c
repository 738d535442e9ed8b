#include "clock.h"

#include <time.h> // clock_gettime

#include "hardware.h" // clock_us

static uint64_t started_ns;

static uint64_t monotonic_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000 + (uint64_t)now.tv_nsec;
}

void clock_start(void) { started_ns = monotonic_ns(); }

uint64_t clock_since_start(uint64_t monotonic_ns) { return monotonic_ns - started_ns; }

uint64_t clock_ns(void) { return clock_since_start(monotonic_ns()); }

uint64_t clock_us(void) { return clock_ns() / 1000; }
