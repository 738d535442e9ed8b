/* Before main: fills the stack with a pattern, to measure its use later, and saves the cause of the reset. */
#include <avr/io.h> // registers
#include <avr/wdt.h> // watchdog

#include "hardware.h" // reset_cause, stack_free
#include "messages.h" // enum reset_cause

#define PAINT 0xC5

extern uint8_t _end; // of all variables; the stack grows down towards it

static uint8_t reset_flags __attribute__((section(".noinit")));

__attribute__((naked, used, section(".init1"))) void paint_stack(void)
{
    __asm__ volatile("ldi r30, lo8(_end)\n"
                     "ldi r31, hi8(_end)\n"
                     "ldi r24, %0\n"
                     "ldi r25, hi8(%1)\n"
                     "0: st Z+, r24\n"
                     "cpi r30, lo8(%1)\n"
                     "cpc r31, r25\n"
                     "brlo 0b\n" ::"M"(PAINT),
                     "i"(RAMEND + 1));
}

// After a watchdog reset the watchdog is still running; stop it.
__attribute__((naked, used, section(".init3"))) void calm_watchdog(void)
{
    reset_flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

uint8_t reset_cause(void)
{
    return reset_flags & _BV(PORF)    ? RESET_CAUSE_POWER
           : reset_flags & _BV(WDRF)  ? RESET_CAUSE_WATCHDOG
           : reset_flags & _BV(BORF)  ? RESET_CAUSE_BROWNOUT
           : reset_flags & _BV(EXTRF) ? RESET_CAUSE_BUTTON
                                      : RESET_CAUSE_UNKNOWN;
}

uint16_t stack_free(void)
{
    const uint8_t *at = &_end;
    while (at <= (const uint8_t *)RAMEND && *at == PAINT)
        at++;
    return (uint16_t)(at - &_end);
}
