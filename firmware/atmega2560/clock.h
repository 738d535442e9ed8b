/* Timer 4 counts half microseconds; its overflows make 48 bits of them. It times the echoes too. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

void clock_start(void);
uint64_t clock_ticks(void); // half microseconds since the start
// The low 32 bits of the moment at which the timer stood at `count`, a moment ago. With interrupts off.
uint32_t clock_ticks_at(uint16_t count);

#endif
