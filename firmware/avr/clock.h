/* Clock of the device: the timer of `registers.h`. It also times the echoes. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_start(void);
uint32_t clock_ticks(void); // half microseconds since the start; wraps after 36 minutes
// The same at the recent time when the timer was `count`. Call it with interrupts off.
uint32_t clock_ticks_at(uint16_t count);

#endif
