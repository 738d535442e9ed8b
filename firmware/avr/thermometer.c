#include "thermometer.h"

#include <avr/io.h> // registers

#include "flash.h" // flash_u16
#include "hardware.h" // thermometer
#include "messages.h" // NO_TEMPERATURE
#include "thermistor_table.h" // thermistor_table

#define SUPPLY_REFERENCE _BV(REFS0) // the thermistor is relative to the supply
#define THERMISTOR_CHANNEL 1
#define SLOW (_BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0)) // clock / 128
#define AVERAGED 32 // conversions per temperature
#define OPEN_COUNT 1015 // from this value on, no thermistor is connected

static bool paused;
static uint16_t sum;
static uint8_t summed;
static int16_t temperature = NO_TEMPERATURE;

static void finish_conversion(void)
{
    while (ADCSRA & _BV(ADSC))
        ;
}

void thermometer_start(void)
{
    DIDR0 = _BV(ADC0D) | _BV(ADC1D);
    ADMUX = SUPPLY_REFERENCE | THERMISTOR_CHANNEL;
    ADCSRA = SLOW | _BV(ADSC);
}

void thermometer_pause(void)
{
    finish_conversion();
    paused = true;
    summed = 0;
    sum = 0;
}

void thermometer_resume(void)
{
    ADCSRA = SLOW;
    finish_conversion();
    ADMUX = SUPPLY_REFERENCE | THERMISTOR_CHANNEL;
    paused = false;
}

// Temperature from the sum of 32 conversions, plus half a count each against the converter's rounding down.
static int16_t centidegrees(uint16_t count32)
{
    // 15 bits: the upper five select the interval of the table, the lower ten interpolate in it
    uint8_t at = (uint8_t)(count32 >> 10);
    int16_t from = (int16_t)flash_u16((const uint16_t *)&thermistor_table[at]);
    int16_t to = (int16_t)flash_u16((const uint16_t *)&thermistor_table[at + 1]);
    return from + (int16_t)((int32_t)(to - from) * (count32 & 1023) / 1024);
}

void thermometer_work(void)
{
    if (paused || ADCSRA & _BV(ADSC))
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
