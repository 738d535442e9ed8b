/* The 6500 ranging board: outputs INIT, BLNK and BINH, ECHO on the input capture of timer 4, trace on the converter. */
#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers
#include <util/atomic.h> // ATOMIC_BLOCK

#include "board_facts.h" // TRACE_SAMPLES
#include "clock.h" // ticks
#include "converter.h" // the trace
#include "hardware.h" // ping_start
#include "pins.h"

static uint32_t fired_low; // ticks
static uint64_t fired_us;
static uint32_t listen_ticks;
static bool traced;
static uint8_t echoes_wanted;
static volatile uint8_t echo_count;
static uint32_t few_echoes[ECHOES_BESIDE_TRACE];
static uint32_t *echoes;
static uint32_t rearm_ticks;
static volatile uint32_t wait_left; // ticks left after the present run of timer 3
static volatile bool unblanks; // timer 3 counts the blanking, not the re-arming

// Trigger TIMER3_COMPA once after `ticks`. Call it with interrupts off.
static void wake_in(uint32_t ticks)
{
    uint16_t now = ticks > 0x8000 ? 0x8000 : (uint16_t)ticks;
    wait_left = ticks - now;
    OCR3A = now - 1;
    TCNT3 = 0;
    TIFR3 = _BV(OCF3A);
    TIMSK3 = _BV(OCIE3A);
    TCCR3B = _BV(WGM32) | _BV(CS31);
}

// End of blanking or of re-arming. Budget 150 cycles.
ISR(TIMER3_COMPA_vect)
{
    if (wait_left) {
        wake_in(wait_left);
        return;
    }
    TCCR3B = 0;
    TIMSK3 = 0;
    if (unblanks)
        PIN_HIGH(BINH);
    unblanks = false;
    PIN_LOW(BLNK);
}

// An echo. Its time is captured by the timer, so that other interrupts cause no error. Budget 260 cycles.
ISR(TIMER4_CAPT_vect)
{
    uint32_t ticks = clock_ticks_at(ICR4) - fired_low;
    uint8_t count = echo_count;
    // earlier edges are noise of the transmitter
    if (ticks < 2 * BLANKING_LEAST_US || count == echoes_wanted)
        return;
    echoes[count] = ticks;
    echo_count = ++count;
    if (count < echoes_wanted) {
        PIN_HIGH(BLNK);
        wake_in(rearm_ticks);
    }
}

void ping_start(const struct ping_order *order)
{
    listen_ticks = order->listen_us * 2;
    rearm_ticks = order->rearm_us * 2UL;
    echoes_wanted = order->echoes;
    echo_count = 0;
    traced = order->trace;
    echoes = traced ? few_echoes : (uint32_t *)converter_samples();
    // compute everything first: INIT and the first sample must be only a few instructions apart
    if (traced)
        converter_prepare((uint16_t)(order->listen_us / 13));
    bool longer = order->blanking_us > BLANKING_US;
    uint32_t unblanked_ticks = order->blanking_us * 2;
    unblanks = order->blanking_us != BLANKING_US;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIFR4 = _BV(ICF4);
        TIMSK4 = _BV(TOIE4) | _BV(ICIE4);
        if (longer)
            PIN_HIGH(BLNK);
        fired_us = clock_us();
        uint16_t before = TCNT4;
        PIN_HIGH(INIT);
        if (traced)
            converter_go();
        // INIT rises 5 cycles after the timer was read, which is half a tick after its last count
        fired_low = clock_ticks_at(before) + 1;
        if (unblanks)
            wake_in(unblanked_ticks);
    }
}

bool ping_over(void)
{
    if (clock_ticks() - fired_low < listen_ticks)
        return false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        TIMSK4 = _BV(TOIE4);
        TIMSK3 = 0;
        TCCR3B = 0;
    }
    converter_stop();
    PIN_LOW(INIT);
    PIN_LOW(BLNK);
    PIN_LOW(BINH);
    return true;
}

struct ping_result ping_result(void)
{
    return (struct ping_result){
        .fired_us = fired_us,
        .echoes = echoes,
        .echo_count = echo_count,
        .trace = converter_samples(),
        .trace_size = traced ? converter_count() : 0,
        .lost = converter_lost(),
        .lost_count = traced ? converter_lost_count() : 0,
    };
}
