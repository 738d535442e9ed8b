/* How far the table may turn. */
#ifndef LIMITS_H
#define LIMITS_H

#include <stdbool.h>
#include <stdint.h>

int16_t turntable_reach(void); // in both directions from zero, degrees
bool turntable_reaches(int64_t microdegrees);

// Steps in both directions from the last known zero, or from where the board started.
int32_t homing_limit(void);
bool within_homing_limit(int32_t steps);
// Steps of one Home towards the switch. With wiring that has never worked, only what a table needs that was left near zero.
int32_t homing_most(void);
int32_t creep_most(void); // steps from the edge of the switch to the mark

#endif
