/* Start of the firmware on an AVR, and its main loop. */
#include <avr/interrupt.h> // sei
#include <avr/io.h> // registers
#include <avr/sleep.h> // sleep_cpu
#include <avr/wdt.h> // watchdog

#include "clock.h"
#include "conversation.h"
#include "hardware.h" // interrupts_off
#include "identity.h"
#include "parts.h"
#include "thermometer.h"
#include "usart.h"

void interrupts_off(void) { cli(); }

void interrupts_on(void) { sei(); }

// Every 1.024 ms, only to end a sleep.
EMPTY_INTERRUPT(TIMER0_OVF_vect)

static void tick_start(void)
{
    TCCR0A = 0;
    TCCR0B = _BV(CS01) | _BV(CS00); // clock / 64
}

// Sleep until the next interrupt. None comes between the check of the line and the sleep: `sei` permits them only after
// the next instruction. During a ping interrupts stay on, because a delayed sample is lost.
static void sleep(void)
{
    if (!conversation_can_wait())
        return;
    cli();
    if (usart_idle()) {
        TIMSK0 = _BV(TOIE0);
        sleep_enable();
        sei();
        sleep_cpu();
        sleep_disable();
        TIMSK0 = 0;
    }
    sei();
}

int main(void)
{
    turning_start();
    ranging_start();
    clock_start();
    tick_start();
    usart_start();
    thermometer_start();
    sei();
    identity_start();
    conversation_reset();
    wdt_enable(WDTO_500MS);
    for (;;) {
        wdt_reset();
        conversation_run();
        thermometer_work();
        sleep();
    }
}
