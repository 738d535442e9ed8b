#include "manner.h"

#include "board_facts.h" // SPEED, ACCELERATION
#include "ramp.h" // SLOWEST_RAMP

static struct turntable_manner manner;

void turntable_set_manner(struct turntable_manner request)
{
    if (!request.speed || request.speed > SPEED)
        request.speed = SPEED;
    if (request.speed < SLOWEST_RAMP)
        request.speed = SLOWEST_RAMP;
    if (!request.acceleration || request.acceleration > ACCELERATION)
        request.acceleration = ACCELERATION;
    if (request.acceleration < GENTLEST_RAMP)
        request.acceleration = GENTLEST_RAMP;
    manner = request;
}

struct turntable_manner turntable_manner(void) { return manner; }
