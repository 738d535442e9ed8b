/* A hobby servo: a pulse every 20 ms, 0.5 to 2.5 ms for 180 degrees. Its angle follows the position of the turntable.
 *
 * Compare channel B of the timer sets and clears the pin, so that other interrupts do not change the pulse.
 */
#include <avr/interrupt.h> // ISR

#include "board_facts.h" // MICROSTEPS
#include "hardware.h" // motor_start
#include "parts.h" // turning_start
#include "pins.h"
#include "steps.h"
#include "turntable.h" // turntable_step
#include "wiring.h" // motor_inverted

#define PERIOD_TICKS 40000
#define MIDDLE_TICKS 3000
#define TICKS_A_TURN 8000 // 1 ms for 90 degrees
#define SET_AT_MATCH (_BV(COM1B1) | _BV(COM1B0))
#define CLEAR_AT_MATCH _BV(COM1B1)

_Static_assert(MICROSTEPS == TICKS_A_TURN, "a step changes the pulse by one tick");

static bool reversed; // the servo turns clockwise for longer pulses
static volatile bool released; // no pulse after the present one
static uint16_t pulse_ticks;

void turning_start(void) { PIN_OUTPUT(SERVO); }

// A step, at most every 4 000 cycles. Budget 350 cycles.
ISR(TIMER_COMPA_vect) { steps_next(turntable_step()); }

// Begin or end of a pulse: the pin has just changed. Budget 200 cycles.
ISR(TIMER_COMPB_vect)
{
    if (TIMER_OUTPUTS == SET_AT_MATCH) {
        int16_t steps = turntable_steps();
        pulse_ticks = MIDDLE_TICKS + (uint16_t)(reversed ? -steps : steps);
        TIMER_OUTPUTS = CLEAR_AT_MATCH;
        TIMER_B = nonzero(TIMER_B + pulse_ticks);
    } else if (released) {
        TIMER_INTERRUPTS &= ~_BV(OCIE1B);
    } else {
        TIMER_OUTPUTS = SET_AT_MATCH;
        TIMER_B = nonzero(TIMER_B + PERIOD_TICKS - pulse_ticks);
    }
}

static void start_pulses(void)
{
    TIMER_B = nonzero(TIMER_COUNT + PERIOD_TICKS);
    TIMER_OUTPUTS = SET_AT_MATCH;
    TIMER_FLAGS = _BV(OCF1B);
    TIMER_INTERRUPTS |= _BV(OCIE1B);
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    (void)counter_clockwise; // the pulse follows the position
    reversed = motor_inverted();
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        released = false;
        if (!(TIMER_INTERRUPTS & _BV(OCIE1B)))
            start_pulses();
    }
    steps_start(first_ticks);
}

bool motor_turning(void) { return steps_left(); }

void motor_release(void) { released = true; }

bool home_mark(void) { return false; }

bool home_side(void) { return false; }

uint8_t turntable_inputs(void) { return 0; }
