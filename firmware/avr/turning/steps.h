/* Compare channel A of the timer triggers an interrupt for each step. The turntable in use defines the handler. */
#ifndef STEPS_H
#define STEPS_H

#include <stdbool.h>
#include <util/atomic.h> // ATOMIC_BLOCK

#include "pins.h" // TIMER_COUNT

// A match with 0 is one tick late, because the emulated timer has none.
static inline uint16_t nonzero(uint16_t count) { return count ? count : 1; }

static inline void steps_start(uint16_t first_ticks)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIMER_A = nonzero(TIMER_COUNT + first_ticks);
        TIMER_FLAGS = _BV(OCF1A);
        TIMER_INTERRUPTS |= _BV(OCIE1A);
    }
}

// The next step after this many ticks; none if 0. Called by the handler of a step.
static inline void steps_next(uint16_t ticks)
{
    if (ticks)
        TIMER_A = nonzero(TIMER_A + ticks);
    else
        TIMER_INTERRUPTS &= ~_BV(OCIE1A);
}

static inline bool steps_left(void) { return TIMER_INTERRUPTS & _BV(OCIE1A); }

#endif
