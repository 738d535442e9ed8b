/* Timer 4 counts half microseconds, and its overflows are counted. It times the echoes too. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_start(void);
uint32_t clock_ticks(void); // half microseconds since the start; wraps after 36 minutes
// The same at the moment at which the timer stood at `count`, not long ago. With interrupts off.
uint32_t clock_ticks_at(uint16_t count);

#endif
