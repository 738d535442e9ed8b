/* A 28BYJ-48 on four pins, through a ULN2003, in half steps. It has no home switches. */
#include <avr/interrupt.h> // ISR

#include "flash.h" // FLASH
#include "hardware.h" // motor_start
#include "parts.h" // turning_start
#include "pins.h"
#include "steps.h"
#include "turntable.h" // turntable_step

#define PHASES 8

FLASH static const uint8_t coils_of[PHASES] = {1, 3, 2, 6, 4, 12, 8, 9}; // bit 0 is coil 1

static bool forwards;
static uint8_t phase;

static void set_coils(uint8_t coils)
{
    coils & 1 ? PIN_HIGH(COIL_1) : PIN_LOW(COIL_1);
    coils & 2 ? PIN_HIGH(COIL_2) : PIN_LOW(COIL_2);
    coils & 4 ? PIN_HIGH(COIL_3) : PIN_LOW(COIL_3);
    coils & 8 ? PIN_HIGH(COIL_4) : PIN_LOW(COIL_4);
}

void turning_start(void)
{
    PIN_OUTPUT(COIL_1);
    PIN_OUTPUT(COIL_2);
    PIN_OUTPUT(COIL_3);
    PIN_OUTPUT(COIL_4);
}

// A half step, at most every 26 666 cycles. Budget 350 cycles: the USART buffers three bytes.
ISR(TIMER_COMPA_vect)
{
    phase = (phase + (forwards ? 1 : PHASES - 1)) % PHASES;
    set_coils(flash_u8(&coils_of[phase]));
    steps_next(turntable_step());
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    forwards = counter_clockwise;
    set_coils(flash_u8(&coils_of[phase]));
    steps_start(first_ticks);
}

bool motor_turning(void) { return steps_left(); }

void motor_release(void) { set_coils(0); }

bool home_mark(void) { return false; }

bool home_side(void) { return false; }

uint8_t turntable_inputs(void) { return 0; }
