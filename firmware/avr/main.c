/* Start of the firmware on an AVR, and its main loop. */
#include <avr/interrupt.h> // sei
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

int main(void)
{
    turning_start();
    ranging_start();
    clock_start();
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
    }
}
