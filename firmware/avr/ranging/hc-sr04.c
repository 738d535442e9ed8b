/* An HC-SR04: a pulse on TRIGGER transmits. ECHO, on the input capture of the timer, is high for the time of flight. */
#include <avr/interrupt.h> // ISR
#include <util/atomic.h> // ATOMIC_BLOCK
#include <util/delay.h> // _delay_us

#include "board_facts.h" // LISTEN_MOST_US
#include "clock.h" // ticks
#include "hardware.h" // ping_start
#include "messages.h" // enum input
#include "parts.h" // ranging_start
#include "pins.h"

#define TRIGGER_US 12 // at least 10
#define RISES_WITHIN_US 5000UL // otherwise no module is connected
#define FALLS_WITHIN_US 60000UL // without an echo, ECHO is high for 38 ms

enum phase { TRIGGERED, MEASURING, MEASURED };

static volatile enum phase phase;
static uint32_t triggered; // ticks
static uint64_t triggered_us;
static volatile uint32_t risen; // ticks
static uint32_t flight; // ticks

void ranging_start(void) { PIN_OUTPUT(TRIGGER); }

// An edge of ECHO. Its time is captured by the timer, so that other interrupts cause no error. Budget 200 cycles.
ISR(TIMER_CAPT_vect)
{
    uint32_t ticks = clock_ticks_at(TIMER_CAPTURED);
    TIMER_CONTROL ^= _BV(ICES1);
    TIMER_FLAGS = _BV(ICF1); // the change of the edge may set it
    if (phase == TRIGGERED) {
        risen = ticks;
        phase = MEASURING;
    } else {
        flight = ticks - risen;
        phase = MEASURED;
        TIMER_INTERRUPTS &= ~_BV(ICIE1);
    }
}

void ping_start(const struct ping_order *order)
{
    (void)order; // the module always listens until the first echo, and the core drops what is not wanted
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        phase = TRIGGERED;
        TIMER_CONTROL |= _BV(ICES1); // rising edge
        TIMER_FLAGS = _BV(ICF1);
        TIMER_INTERRUPTS |= _BV(ICIE1);
        triggered_us = clock_us();
        triggered = clock_ticks_at(TIMER_COUNT);
        PIN_HIGH(TRIGGER);
        _delay_us(TRIGGER_US);
        PIN_LOW(TRIGGER);
    }
    risen = triggered;
}

bool ping_over(void)
{
    uint32_t since = clock_ticks() - triggered;
    if (phase != MEASURED && since < 2 * (phase == TRIGGERED ? RISES_WITHIN_US : FALLS_WITHIN_US))
        return false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIMER_INTERRUPTS &= ~_BV(ICIE1);
    }
    return true;
}

struct ping_result ping_result(void)
{
    // the module transmits shortly before it raises ECHO, and takes this time for the start
    return (struct ping_result){
        .fired_us = triggered_us + (risen - triggered) / 2,
        .echoes = &flight,
        .echo_count = phase == MEASURED && flight < 2 * LISTEN_MOST_US,
    };
}

uint8_t ranging_inputs(void) { return PIN_READ(ECHO) ? INPUT_ECHO : 0; }
