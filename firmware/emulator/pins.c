/* The pins of the chip, and the wires between them and the models. */
#include <stdlib.h>

#include <simavr/avr_ioport.h>

#include "emulator.h"

struct listener {
    avr_t *avr;
    bool high;
    void (*changed)(avr_t *, bool);
};

static void pin_changed(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    struct listener *listener = parameter;
    if (listener->high == (value != 0))
        return;
    listener->high = value != 0;
    listener->changed(listener->avr, listener->high);
}

void listen_to_pin(avr_t *avr, struct pin pin, void (*changed)(avr_t *, bool))
{
    struct listener *listener = calloc(1, sizeof *listener);
    if (!listener)
        die("out of memory");
    *listener = (struct listener){avr, false, changed};
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(pin.port), pin.bit), pin_changed, listener);
}

// by port; otherwise simavr returns a pin to its pull-up whenever the firmware writes to the port
static avr_ioport_external_t driven['L' + 1];

void set_pin(avr_t *avr, struct pin pin, bool high)
{
    avr_ioport_external_t *external = &driven[(int)pin.port];
    uint8_t bit = (uint8_t)(1u << pin.bit);
    if (external->mask & bit && !!(external->value & bit) == high)
        return; // to find the pin in simavr takes long
    external->name = (unsigned)pin.port;
    external->mask |= bit;
    external->value = (external->value & ~bit) | (high ? bit : 0);
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(pin.port), external);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(pin.port), pin.bit), high);
}

void restore_pins(avr_t *avr)
{
    for (int port = 'A'; port <= 'L'; port++)
        for (int bit = 0; bit < 8; bit++)
            if (driven[port].mask & 1u << bit) {
                bool high = driven[port].value & 1u << bit;
                struct pin pin = {(char)port, bit};
                set_pin(avr, pin, !high);
                set_pin(avr, pin, high);
            }
}

void miswire(avr_t *avr, uint32_t faults)
{
    options.wiring = faults;
    turntable_show(avr);
    ranging_show(avr);
}

bool miswired(enum wiring_fault fault) { return options.wiring & fault; }
