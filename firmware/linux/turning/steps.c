#include "steps.h"

#include "clock.h"
#include "parts.h" // turning_work

static uint64_t due = NEVER; // ns

void steps_start(uint16_t first_ticks) { due = clock_ns() + first_ticks * (uint64_t)NS_A_TICK; }

bool steps_left(void) { return due != NEVER; }

uint64_t turning_due(void) { return due; }

// A step that is late by more than half an interval delays all steps that follow: no interval is shorter than half of
// what the ramp demands, so the motor need not catch up.
void turning_work(void)
{
    uint64_t now = clock_ns();
    if (now < due)
        return;
    uint64_t interval = make_step() * (uint64_t)NS_A_TICK;
    due = due + interval > now + interval / 2 ? due + interval : now + interval / 2;
    if (!interval)
        due = NEVER;
}
