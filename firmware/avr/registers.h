/* Access to pins, and to the registers of the 16-bit timer that the chip's `pins.h` names.
 *
 * This timer counts half microseconds and never stops. Its input capture times the echoes, compare channel A the steps,
 * compare channel B the re-arming of the 6500 or the pulses of a servo. The bits of all 16-bit timers are alike; they
 * have the names of timer 1 here.
 */
#ifndef REGISTERS_H
#define REGISTERS_H

#include <avr/io.h> // registers

#define PIN_HIGH(pin) PIN_HIGH_(pin)
#define PIN_LOW(pin) PIN_LOW_(pin)
#define PIN_OUTPUT(pin) PIN_OUTPUT_(pin)
#define PIN_READ(pin) PIN_READ_(pin)
#define PIN_HIGH_(port, bit) (PORT##port |= _BV(bit))
#define PIN_LOW_(port, bit) (PORT##port &= (uint8_t)~_BV(bit))
#define PIN_OUTPUT_(port, bit) (DDR##port |= _BV(bit))
#define PIN_READ_(port, bit) ((PIN##port & _BV(bit)) != 0)

#define JOIN(before, number, after) JOIN_(before, number, after)
#define JOIN_(before, number, after) before##number##after

#define TIMER_COUNT JOIN(TCNT, TIMER_NUMBER, )
#define TIMER_CAPTURED JOIN(ICR, TIMER_NUMBER, )
#define TIMER_A JOIN(OCR, TIMER_NUMBER, A)
#define TIMER_B JOIN(OCR, TIMER_NUMBER, B)
#define TIMER_OUTPUTS JOIN(TCCR, TIMER_NUMBER, A)
#define TIMER_CONTROL JOIN(TCCR, TIMER_NUMBER, B)
#define TIMER_FLAGS JOIN(TIFR, TIMER_NUMBER, )
#define TIMER_INTERRUPTS JOIN(TIMSK, TIMER_NUMBER, )
#define TIMER_OVF_vect JOIN(TIMER, TIMER_NUMBER, _OVF_vect)
#define TIMER_CAPT_vect JOIN(TIMER, TIMER_NUMBER, _CAPT_vect)
#define TIMER_COMPA_vect JOIN(TIMER, TIMER_NUMBER, _COMPA_vect)
#define TIMER_COMPB_vect JOIN(TIMER, TIMER_NUMBER, _COMPB_vect)

#endif
