#include "clock.h"

#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers
#include <util/atomic.h> // ATOMIC_BLOCK

#include "hardware.h" // clock_us

#define OVERFLOW_US 32768 // 65 536 half microseconds

static volatile uint16_t overflows;
static volatile uint64_t overflowed_us;

void clock_start(void)
{
    TCCR4B = _BV(ICNC4) | _BV(ICES4) | _BV(CS41); // rising edge, noise canceller, clock / 8
    TIMSK4 = _BV(TOIE4);
}

// Every 32.8 ms. Budget 120 cycles.
ISR(TIMER4_OVF_vect)
{
    overflows++;
    overflowed_us += OVERFLOW_US;
}

// Whether an overflow before `count` was read has not been counted yet.
static bool overflow_waits(uint16_t count) { return (TIFR4 & _BV(TOV4)) && count < 0x8000; }

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
        ticks = clock_ticks_at(TCNT4);
    }
    return ticks;
}

uint64_t clock_us(void)
{
    uint16_t count;
    uint64_t us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = TCNT4;
        us = overflowed_us;
        if (overflow_waits(count))
            us += OVERFLOW_US;
    }
    return us + count / 2;
}
