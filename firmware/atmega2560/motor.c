/* The stepper driver on STEP, DIRECTION and ENABLE; timer 1 times the steps. */
#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers

#include "hardware.h" // motor_start
#include "pins.h"
#include "turntable.h" // turntable_step

// A step, at most every 1 777 cycles. STEP is high for about 10 us. Budget 280 cycles: the USART buffers three bytes,
// which is 480 cycles at 1 000 000 baud.
ISR(TIMER1_COMPA_vect)
{
    PIN_HIGH(STEP);
    uint16_t ticks = turntable_step();
    if (ticks)
        OCR1A = ticks - 1;
    else
        TCCR1B = 0;
    PIN_LOW(STEP);
}

void motor_start(bool counter_clockwise, uint16_t first_ticks)
{
    if (counter_clockwise)
        PIN_HIGH(DIRECTION);
    else
        PIN_LOW(DIRECTION);
    PIN_LOW(ENABLE);
    OCR1A = first_ticks - 1;
    TCNT1 = 0;
    TIFR1 = _BV(OCF1A);
    TIMSK1 = _BV(OCIE1A);
    TCCR1B = _BV(WGM12) | _BV(CS11);
}

bool motor_turning(void) { return TCCR1B != 0; }

void motor_release(void) { PIN_HIGH(ENABLE); }

bool home_mark(void) { return PIN_READ(HOME_MARK); }

bool home_side(void) { return PIN_READ(HOME_SIDE); }

uint8_t input_levels(void)
{
    return (home_mark() ? INPUT_MARK : 0) | (home_side() ? INPUT_CAM : 0) | (PIN_READ(ECHO) ? INPUT_ECHO : 0);
}

void interrupts_off(void) { cli(); }

void interrupts_on(void) { sei(); }
