/* The time of each step. The turntable in use defines `make_step`. */
#ifndef STEPS_H
#define STEPS_H

#include <stdbool.h>
#include <stdint.h>

uint16_t make_step(void); // calls `turntable_step`, and returns what it returns

void steps_start(uint16_t first_ticks);
bool steps_left(void);

#endif
