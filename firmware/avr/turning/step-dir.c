/* A stepper driver on STEP, DIRECTION and ENABLE, and the two home switches. */
#include <avr/interrupt.h> // ISR

#include "hardware.h" // motor_start
#include "messages.h" // enum input
#include "parts.h" // turning_start
#include "pins.h"
#include "steps.h"
#include "turntable.h" // turntable_step

void turning_start(void)
{
    PIN_HIGH(ENABLE); // no current before the first move
    PIN_OUTPUT(ENABLE);
    PIN_OUTPUT(STEP);
    PIN_OUTPUT(DIRECTION);
    PIN_HIGH(HOME_MARK); // pull-ups
    PIN_HIGH(HOME_SIDE);
}

// A step, at most every 1 777 cycles. STEP is high for about 10 us. Budget 350 cycles: the USART buffers three bytes,
// which is 480 cycles at 1 000 000 baud.
ISR(TIMER_COMPA_vect)
{
    PIN_HIGH(STEP);
    steps_next(turntable_step());
    PIN_LOW(STEP);
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    if (counter_clockwise)
        PIN_HIGH(DIRECTION);
    else
        PIN_LOW(DIRECTION);
    PIN_LOW(ENABLE);
    steps_start(first_ticks);
}

bool motor_turning(void) { return steps_left(); }

void motor_release(void) { PIN_HIGH(ENABLE); }

bool home_mark(void) { return PIN_READ(HOME_MARK); }

bool home_side(void) { return PIN_READ(HOME_SIDE); }

uint8_t turntable_inputs(void) { return (home_mark() ? INPUT_MARK : 0) | (home_side() ? INPUT_CAM : 0); }
