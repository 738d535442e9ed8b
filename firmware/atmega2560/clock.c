#include "clock.h"

#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers
#include <util/atomic.h> // ATOMIC_BLOCK

#include "hardware.h" // clock_us

static volatile uint32_t overflows;

void clock_start(void)
{
    TCCR4B = _BV(ICNC4) | _BV(ICES4) | _BV(CS41); // rising edge, noise canceller, clock / 8
    TIMSK4 = _BV(TOIE4);
}

// Every 32.8 ms. Budget 100; takes 48 with entry and exit.
ISR(TIMER4_OVF_vect) { overflows++; }

// An overflow that waits to be counted belongs to counts that have just begun again.
static uint32_t overflows_at(uint16_t count)
{
    return overflows + ((TIFR4 & _BV(TOV4)) && count < 0x8000 ? 1 : 0);
}

uint32_t clock_ticks_at(uint16_t count) { return overflows_at(count) << 16 | count; }

uint64_t clock_ticks(void)
{
    uint16_t count;
    uint32_t high;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        count = TCNT4;
        high = overflows_at(count);
    }
    return (uint64_t)high << 16 | count;
}

uint64_t clock_us(void) { return clock_ticks() >> 1; }
