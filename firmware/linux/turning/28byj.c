/* A 28BYJ-48 on four pins, through a ULN2003, in half steps. It has no home switches. */
#include "gpio.h"
#include "hardware.h" // motor_start
#include "parts.h" // turning_start
#include "pins.h"
#include "steps.h"
#include "turntable.h" // turntable_step

#define PHASES 8

static const uint8_t coils_of[PHASES] = {1, 3, 2, 6, 4, 12, 8, 9}; // bit 0 is coil 1

static bool forwards;
static uint8_t phase;

static void set_coils(uint8_t coils)
{
    gpio_write(COIL_1, coils & 1);
    gpio_write(COIL_2, coils & 2);
    gpio_write(COIL_3, coils & 4);
    gpio_write(COIL_4, coils & 8);
}

void turning_start(void)
{
    gpio_output(COIL_1, false);
    gpio_output(COIL_2, false);
    gpio_output(COIL_3, false);
    gpio_output(COIL_4, false);
}

uint16_t make_step(void)
{
    phase = (phase + (forwards ? 1 : PHASES - 1)) % PHASES;
    set_coils(coils_of[phase]);
    return turntable_step();
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    forwards = counter_clockwise;
    set_coils(coils_of[phase]);
    steps_start(first_ticks);
}

bool motor_turning(void) { return steps_left(); }

void motor_release(void) { set_coils(0); }

bool home_mark(void) { return false; }

bool home_side(void) { return false; }

uint8_t turntable_inputs(void) { return 0; }
