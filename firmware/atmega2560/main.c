/* Start of the firmware on an ATmega2560, and its main loop. */
#include <avr/interrupt.h> // sei
#include <avr/io.h> // registers
#include <avr/wdt.h> // watchdog

#include "clock.h"
#include "conversation.h"
#include "converter.h"
#include "identity.h"
#include "pins.h"
#include "usart.h"

static void set_pins(void)
{
    PIN_HIGH(ENABLE); // no current before the first move
    PIN_OUTPUT(ENABLE);
    PIN_OUTPUT(STEP);
    PIN_OUTPUT(DIRECTION);
    PIN_OUTPUT(INIT);
    PIN_OUTPUT(BLNK);
    PIN_OUTPUT(BINH);
    PIN_HIGH(HOME_MARK); // pull-ups
    PIN_HIGH(HOME_SIDE);
}

int main(void)
{
    set_pins();
    clock_start();
    usart_start();
    converter_start();
    sei();
    identity_start();
    conversation_reset();
    wdt_enable(WDTO_500MS);
    for (;;) {
        wdt_reset();
        conversation_run();
        converter_work();
    }
}
