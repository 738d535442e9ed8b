#include "converter.h"

#include <avr/interrupt.h> // ISR
#include <avr/io.h> // registers

#include "board_facts.h" // TRACE_SAMPLES
#include "hardware.h" // thermometer
#include "messages.h" // NO_TEMPERATURE
#include "thermistor_table.h" // thermistor_table

#define SUPPLY_REFERENCE _BV(REFS0) // both thermistor and trace are relative to the supply
#define TRACE_CHANNEL 0
#define THERMISTOR_CHANNEL 1
#define SLOW (_BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0)) // clock / 128
#define FAST (_BV(ADEN) | _BV(ADPS2)) // clock / 16
#define TICKS_A_SAMPLE (TRACE_PERIOD_NS / 500)
#define MARGIN_TICKS 4 // phase of the converter's clock
#define AVERAGED 32 // conversions per temperature
#define OPEN_COUNT 1015 // from this value on, no thermistor is connected

static uint8_t samples[TRACE_SAMPLES];
static uint8_t *volatile sample_end;
static uint16_t sample_due; // count of timer 4 at the end of the conversion of the next sample, less a margin
static uint8_t *sample_stop;
static uint8_t *lost[LOST_MOST]; // samples that were not measured
static uint8_t **lost_end;
static bool tracing;
static uint16_t sum;
static uint8_t summed;
static int16_t temperature = NO_TEMPERATURE;

void converter_start(void)
{
    DIDR0 = _BV(ADC0D) | _BV(ADC1D);
    ADMUX = SUPPLY_REFERENCE | THERMISTOR_CHANNEL;
    ADCSRA = SLOW | _BV(ADSC);
}

// A sample, every 208 cycles. Budget 185 cycles. An interrupt that lasts longer than a conversion costs samples. The next
// sample fills their places, so that every later one is at its time. If no more can be marked as lost, the trace ends.
ISR(ADC_vect)
{
    uint8_t sample = ADCH;
    uint8_t *end = sample_end;
    int16_t late = (int16_t)(TCNT4 - sample_due);
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

void converter_prepare(uint16_t count)
{
    while (ADCSRA & _BV(ADSC))
        ;
    tracing = true;
    summed = 0;
    sum = 0;
    ADMUX = SUPPLY_REFERENCE | _BV(ADLAR) | TRACE_CHANNEL;
    ADCSRB = 0;
    lost_end = lost;
    sample_end = samples;
    sample_stop = samples + (count < TRACE_SAMPLES ? count : TRACE_SAMPLES);
}

void converter_go(void)
{
    ADCSRA = FAST | _BV(ADIF) | _BV(ADIE) | _BV(ADATE) | _BV(ADSC);
    sample_due = TCNT4 + TICKS_A_SAMPLE - MARGIN_TICKS;
}

void converter_stop(void)
{
    if (!tracing)
        return;
    ADCSRA = SLOW;
    while (ADCSRA & _BV(ADSC))
        ;
    ADMUX = SUPPLY_REFERENCE | THERMISTOR_CHANNEL;
    tracing = false;
}

uint8_t *converter_samples(void) { return samples; }

uint16_t converter_count(void) { return (uint16_t)(sample_end - samples); }

uint8_t *const *converter_lost(void) { return lost; }

uint8_t converter_lost_count(void) { return (uint8_t)(lost_end - lost); }

// Temperature from the sum of 32 conversions, plus half a count each against the converter's rounding down.
static int16_t centidegrees(uint16_t count32)
{
    // 15 bits: the upper five select the interval of the table, the lower ten interpolate in it
    uint8_t at = (uint8_t)(count32 >> 10);
    int16_t from = (int16_t)flash_u16((const uint16_t *)&thermistor_table[at]);
    int16_t to = (int16_t)flash_u16((const uint16_t *)&thermistor_table[at + 1]);
    return from + (int16_t)((int32_t)(to - from) * (count32 & 1023) / 1024);
}

void converter_work(void)
{
    if (tracing || ADCSRA & _BV(ADSC))
        return;
    sum += ADC;
    if (++summed == AVERAGED) {
        temperature = sum < OPEN_COUNT * AVERAGED ? centidegrees(sum + AVERAGED / 2) : NO_TEMPERATURE;
        sum = 0;
        summed = 0;
    }
    ADCSRA = SLOW | _BV(ADSC);
}

int16_t thermometer(void) { return temperature; }
