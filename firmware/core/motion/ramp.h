/* A trapezoidal ramp: how long each step of a move lasts, so that speed grows and falls at constant acceleration.
 *
 * Step n from rest lasts sqrt(2 / a) (sqrt(n + 1) - sqrt(n)); the roots stand in a table, so a step costs one
 * multiplication. Slowing down runs through the same steps backwards.
 */
#ifndef RAMP_H
#define RAMP_H

#include <stdint.h>

#define TICKS_PER_SECOND 2000000

struct ramp {
    uint16_t left; // steps to make
    uint16_t index; // of the next one, counted from rest
    uint16_t top; // index at full speed
    uint16_t first; // duration of step 0, ticks
};

#define SLOWEST_RAMP 31 // steps/s
#define GENTLEST_RAMP 2000 // steps/s²

// A move of some steps; acceleration in steps/s², speed in steps/s, both no less than what stands above.
struct ramp ramp_of(uint16_t steps, uint32_t acceleration, uint16_t speed);
// How long the next step lasts, in ticks; 0: there is none. It is called by an interrupt.
uint16_t ramp_next(struct ramp *ramp);
// Come to rest as soon as acceleration allows.
void ramp_halt(struct ramp *ramp);

#endif
