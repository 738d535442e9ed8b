/* The trace of a ping: A0, sampled by the converter into memory. */
#include "trace.h"

#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers

#include "board_facts.h" // TRACE_SAMPLES
#include "pins.h" // TIMER_COUNT
#include "thermometer.h" // the other user of the converter

#define SUPPLY_REFERENCE _BV(REFS0) // the trace is relative to the supply
#define TRACE_CHANNEL 0
#define FAST (_BV(ADEN) | _BV(ADPS2)) // clock / 16
#define TICKS_A_SAMPLE (TRACE_PERIOD_NS / 500)
#define MARGIN_TICKS 4 // phase of the converter's clock

_Static_assert(TRACE_SAMPLES >= 4 * ECHOES_MOST, "while no trace is taken, echoes use its memory");

static uint8_t samples[TRACE_SAMPLES];
static uint8_t *volatile sample_end;
static uint16_t sample_due; // count of the timer at the end of the conversion of the next sample, less a margin
static uint8_t *sample_stop;
static uint8_t *lost[LOST_MOST]; // samples that were not measured
static uint8_t **lost_end;
static bool tracing;

// A sample, every 208 cycles. Budget 185 cycles. An interrupt that lasts longer than a conversion costs samples. The next
// sample fills their places, so that every later one is at its time. If no more can be marked as lost, the trace ends.
ISR(ADC_vect)
{
    uint8_t sample = ADCH;
    uint8_t *end = sample_end;
    int16_t late = (int16_t)(TIMER_COUNT - sample_due);
    for (; late >= 0 && end < sample_stop; late -= TICKS_A_SAMPLE) {
        if (late >= TICKS_A_SAMPLE) {
            if (lost_end == lost + LOST_MOST) {
                sample_stop = end;
                break;
            }
            *lost_end++ = end;
        }
        *end++ = sample;
        sample_due += TICKS_A_SAMPLE;
    }
    sample_end = end;
}

void trace_prepare(uint32_t listen_us)
{
    uint16_t count = (uint16_t)(listen_us / (TRACE_PERIOD_NS / 1000));
    thermometer_pause();
    tracing = true;
    ADMUX = SUPPLY_REFERENCE | _BV(ADLAR) | TRACE_CHANNEL;
    ADCSRB = 0;
    lost_end = lost;
    sample_end = samples;
    sample_stop = samples + (count < TRACE_SAMPLES ? count : TRACE_SAMPLES);
}

void trace_go(void)
{
    ADCSRA = FAST | _BV(ADIF) | _BV(ADIE) | _BV(ADATE) | _BV(ADSC);
    sample_due = TIMER_COUNT + TICKS_A_SAMPLE - MARGIN_TICKS;
}

void trace_stop(void)
{
    if (!tracing)
        return;
    thermometer_resume();
    tracing = false;
}

uint32_t *trace_spare(void) { return (uint32_t *)samples; }

void trace_result(struct ping_result *result)
{
    result->trace = samples;
    result->trace_size = (uint16_t)(sample_end - samples);
    result->lost = lost;
    result->lost_count = (uint8_t)(lost_end - lost);
}
