/* Clock of the device. The kernel uses the same clock for the times of edges. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

#define NS_A_TICK 500

void clock_start(void);
uint64_t clock_ns(void); // since the start
uint64_t clock_since_start(uint64_t monotonic_ns); // the same, of a time of the kernel

#endif
