/* A stepper driver on STEP, DIRECTION and ENABLE, and the two home switches. */
#include "clock.h"
#include "gpio.h"
#include "hardware.h" // motor_start
#include "messages.h" // enum input
#include "parts.h" // turning_start
#include "pins.h"
#include "steps.h"
#include "turntable.h" // turntable_step

#define STEP_NS 2500 // at least 1.9 us for a DRV8825

void turning_start(void)
{
    gpio_output(ENABLE, true); // no current before the first move
    gpio_output(STEP, false);
    gpio_output(DIRECTION, false);
    gpio_input(HOME_MARK, GPIO_PULL_UP);
    gpio_input(HOME_SIDE, GPIO_PULL_UP);
}

uint16_t make_step(void)
{
    gpio_write(STEP, true);
    uint64_t risen = clock_ns();
    uint16_t ticks = turntable_step();
    gpio_hold(risen, STEP_NS);
    gpio_write(STEP, false);
    return ticks;
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    gpio_write(DIRECTION, counter_clockwise);
    gpio_write(ENABLE, false);
    steps_start(first_ticks);
}

bool motor_turning(void) { return steps_left(); }

void motor_release(void) { gpio_write(ENABLE, true); }

bool home_mark(void) { return gpio_read(HOME_MARK); }

bool home_side(void) { return gpio_read(HOME_SIDE); }

uint8_t turntable_inputs(void) { return (home_mark() ? INPUT_MARK : 0) | (home_side() ? INPUT_CAM : 0); }
