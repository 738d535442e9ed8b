#include "clock.h"

#include <avr/interrupt.h> // ISR
#include <util/atomic.h> // ATOMIC_BLOCK

#include "hardware.h" // clock_us
#include "pins.h" // TIMER_COUNT

#define OVERFLOW_US 32768 // 65 536 half microseconds

static volatile uint16_t overflows;
static volatile uint64_t overflowed_us;

void clock_start(void)
{
    TIMER_OUTPUTS = 0; // the Arduino bootloader leaves nothing there; a bootloader of other make may
    TIMER_CONTROL = _BV(ICNC1) | _BV(ICES1) | _BV(CS11); // rising edge, noise canceller, clock / 8
    TIMER_INTERRUPTS = _BV(TOIE1);
}

// Every 32.8 ms. Budget 120 cycles.
ISR(TIMER_OVF_vect)
{
    overflows++;
    overflowed_us += OVERFLOW_US;
}

// Whether an overflow before `count` was read has not been counted yet.
static bool overflow_waits(uint16_t count) { return (TIMER_FLAGS & _BV(TOV1)) && count < 0x8000; }

uint32_t clock_ticks_at(uint16_t count)
{
    uint16_t high = overflows;
    if (overflow_waits(count))
        high++;
    return (uint32_t)high << 16 | count;
}

uint32_t clock_ticks(void)
{
    uint32_t ticks;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ticks = clock_ticks_at(TIMER_COUNT);
    }
    return ticks;
}

uint64_t clock_us(void)
{
    uint16_t count;
    uint64_t us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = TIMER_COUNT;
        us = overflowed_us;
        if (overflow_waits(count))
            us += OVERFLOW_US;
    }
    return us + count / 2;
}
