/* Trapezoidal ramp: the duration of each step of a movement, for constant acceleration and deceleration.
 *
 * Step n from rest lasts sqrt(2 / a) (sqrt(n + 1) - sqrt(n)). The roots are in a table, so a step needs one
 * multiplication. Deceleration uses the same steps in reverse order.
 */
#ifndef RAMP_H
#define RAMP_H

#include <stdint.h>

#define TICKS_PER_SECOND 2000000

struct ramp {
    uint16_t left; // steps to make
    uint16_t index; // of the next step, counted from rest
    uint16_t top; // index at full speed
    uint16_t first; // duration of step 0, ticks
};

#define SLOWEST_RAMP 31 // steps/s
#define GENTLEST_RAMP 2000 // steps/s²

// A movement of `steps`. Acceleration in steps/s², speed in steps/s; both at least the limits above.
struct ramp ramp_of(uint16_t steps, uint32_t acceleration, uint16_t speed);
// Duration of the next step in ticks, or 0 if there is none. Called by an interrupt.
uint16_t ramp_next(struct ramp *ramp);
// Stop as soon as the acceleration allows.
void ramp_halt(struct ramp *ramp);

#endif
