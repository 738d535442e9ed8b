/* Angles of the turntable in steps. */
#ifndef ANGLES_H
#define ANGLES_H

#include <stdint.h>

#include "board_facts.h" // MICROSTEPS

#define STEPS_OF_DEGREES(degrees) ((int32_t)((int64_t)(degrees) * MICROSTEPS / 360))

int32_t steps_of(int32_t microdegrees); // the nearest step
int32_t microdegrees_of(int32_t steps);
int32_t nearest_step(int32_t microdegrees); // its angle
int32_t steps_beside(int32_t steps, int32_t period); // from the nearest multiple of this period

#endif
