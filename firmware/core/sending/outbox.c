#include "outbox.h"

#include "frames.h" // struct sender
#include "hardware.h" // clock_us

static struct sender sender;

void outbox_reset(void)
{
    sender.sending = false;
    sender.sequence = 0;
}

void outbox_pump(void) { sender_pump(&sender); }

bool outbox_idle(void) { return !sender.sending; }

void outbox_finish(void)
{
    while (sender.sending)
        sender_pump(&sender);
}

struct payload outbox_payload(void)
{
    outbox_finish();
    return sender_payload(&sender);
}

void outbox_send(enum message_type type, const struct payload *payload)
{
    sender_send(&sender, type, clock_us(), payload);
    sender_pump(&sender);
}
