/* The 6500 ranging board: outputs INIT, BLNK and BINH, ECHO on the input capture of the timer, trace on the converter. */
#include <avr/interrupt.h> // ISR
#include <util/atomic.h> // ATOMIC_BLOCK

#include "board_facts.h" // ECHOES_BESIDE_TRACE
#include "clock.h" // ticks
#include "hardware.h" // ping_start
#include "messages.h" // enum input
#include "parts.h" // ranging_start
#include "pins.h"
#include "trace.h"

static uint32_t fired_low; // ticks
static uint64_t fired_us;
static uint32_t listen_ticks;
static bool traced;
static uint8_t echoes_wanted;
static volatile uint8_t echo_count;
static uint32_t few_echoes[ECHOES_BESIDE_TRACE];
static uint32_t *echoes;
static uint32_t rearm_ticks;
static volatile uint32_t wait_left; // ticks left after the present wait
static volatile bool unblanks; // the wait is the blanking, not the re-arming

void ranging_start(void)
{
    PIN_OUTPUT(INIT);
    PIN_OUTPUT(BLNK);
    PIN_OUTPUT(BINH);
}

// Trigger TIMER_COMPB once, `ticks` after the timer was `count`. Call it with interrupts off.
static void wake_in(uint16_t count, uint32_t ticks)
{
    uint16_t now = ticks > 0xFFFF ? 0x8000 : (uint16_t)ticks;
    wait_left = ticks - now;
    count += now;
    TIMER_B = count ? count : 1; // the emulated timer has no match with 0
    TIMER_FLAGS = _BV(OCF1B);
    TIMER_INTERRUPTS |= _BV(OCIE1B);
}

// End of blanking or of re-arming. Budget 170 cycles.
ISR(TIMER_COMPB_vect)
{
    if (wait_left) {
        wake_in(TIMER_B, wait_left);
        return;
    }
    TIMER_INTERRUPTS &= ~_BV(OCIE1B);
    if (unblanks)
        PIN_HIGH(BINH);
    unblanks = false;
    PIN_LOW(BLNK);
}

// An echo. Its time is captured by the timer, so that other interrupts cause no error. Budget 260 cycles.
ISR(TIMER_CAPT_vect)
{
    uint32_t ticks = clock_ticks_at(TIMER_CAPTURED) - fired_low;
    uint8_t count = echo_count;
    // earlier edges are noise of the transmitter
    if (ticks < 2 * BLANKING_LEAST_US || count == echoes_wanted)
        return;
    echoes[count] = ticks;
    echo_count = ++count;
    if (count < echoes_wanted) {
        PIN_HIGH(BLNK);
        wake_in(TIMER_COUNT, rearm_ticks);
    }
}

void ping_start(const struct ping_order *order)
{
    listen_ticks = order->listen_us * 2;
    rearm_ticks = order->rearm_us * 2UL;
    echoes_wanted = order->echoes;
    echo_count = 0;
    traced = order->trace && TRACE_SAMPLES;
    echoes = traced ? few_echoes : trace_spare();
    // compute everything first: INIT and the first sample must be only a few instructions apart
    if (traced)
        trace_prepare(order->listen_us);
    bool longer = order->blanking_us > BLANKING_US;
    uint32_t unblanked_ticks = order->blanking_us * 2;
    unblanks = order->blanking_us != BLANKING_US;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIMER_FLAGS = _BV(ICF1);
        TIMER_INTERRUPTS |= _BV(ICIE1);
        if (longer)
            PIN_HIGH(BLNK);
        fired_us = clock_us();
        uint16_t before = TIMER_COUNT;
        PIN_HIGH(INIT);
        if (traced)
            trace_go();
        // INIT rises 5 cycles after the timer was read, which is half a tick after its last count
        fired_low = clock_ticks_at(before) + 1;
        if (unblanks)
            wake_in(before, unblanked_ticks);
    }
}

bool ping_over(void)
{
    if (clock_ticks() - fired_low < listen_ticks)
        return false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIMER_INTERRUPTS &= ~(_BV(ICIE1) | _BV(OCIE1B));
    }
    trace_stop();
    PIN_LOW(INIT);
    PIN_LOW(BLNK);
    PIN_LOW(BINH);
    return true;
}

struct ping_result ping_result(void)
{
    struct ping_result result = {.fired_us = fired_us, .echoes = echoes, .echo_count = echo_count};
    if (traced)
        trace_result(&result);
    return result;
}

uint8_t ranging_inputs(void) { return PIN_READ(ECHO) ? INPUT_ECHO : 0; }
