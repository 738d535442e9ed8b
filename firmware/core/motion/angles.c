#include "angles.h"

#define TURN_MICRODEGREES 360000000

int32_t steps_of(int32_t microdegrees)
{
    int64_t twice = 2 * (int64_t)microdegrees * MICROSTEPS;
    return (int32_t)((twice + (twice < 0 ? -TURN_MICRODEGREES : TURN_MICRODEGREES)) / (2 * (int64_t)TURN_MICRODEGREES));
}

int32_t microdegrees_of(int32_t steps) { return (int32_t)((int64_t)steps * TURN_MICRODEGREES / MICROSTEPS); }

int32_t nearest_step(int32_t microdegrees) { return microdegrees_of(steps_of(microdegrees)); }

int32_t steps_beside(int32_t steps, int32_t period)
{
    steps %= period;
    return steps > period / 2 ? steps - period : steps < -period / 2 ? steps + period : steps;
}
