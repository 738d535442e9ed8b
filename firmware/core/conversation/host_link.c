#include "host_link.h"

#include "hardware.h" // clock_us
#include "line.h" // line_read
#include "outbox.h" // outbox_idle

#define BYTES_A_PASS 32 // decoded in one pass of the main loop, which must not end only when the host pauses

static struct receiver receiver;
static bool greeted;
static bool watched; // the host has version 1.1 and sends messages regularly
static uint64_t last_frame_us; // time of the last valid frame
static uint64_t heartbeat_us; // when the next one is due

static struct {
    uint32_t now;
    uint32_t next; // to change to; 0: none
    uint32_t former; // to return to if no valid frame arrives at the new baud rate; 0: none
    bool on_trial; // the next baud rate needs a valid frame to become permanent
} baud;

void host_link_reset(void)
{
    receiver_start(&receiver);
    receiver.frames = receiver.rejected = 0;
    greeted = watched = false;
    baud.now = FIRST_BAUD;
    baud.next = baud.former = 0;
}

bool host_link_receive(struct command_frame *frame)
{
    int16_t byte;
    for (uint8_t left = BYTES_A_PASS; left && !baud.next && (byte = line_read()) >= 0; left--) {
        if (!receiver_take(&receiver, (uint8_t)byte, frame))
            continue;
        last_frame_us = clock_us();
        baud.former = 0;
        return true;
    }
    return false;
}

const struct receiver *host_link_receiver(void) { return &receiver; }

/* Greeting. */

void host_link_greet(const struct hello *hello)
{
    greeted = true;
    watched = hello->major > 1 || (hello->major == 1 && hello->minor >= 1);
    heartbeat_us = clock_us() + HEARTBEAT_US;
}

bool host_link_greeted(void) { return greeted; }

bool host_link_heartbeat_due(uint64_t now_us)
{
    if (!greeted || now_us < heartbeat_us)
        return false;
    heartbeat_us += HEARTBEAT_US;
    if (heartbeat_us <= now_us)
        heartbeat_us = now_us + HEARTBEAT_US;
    return true;
}

/* Baud rate. */

void host_link_change_baud(uint32_t wanted)
{
    baud.next = wanted;
    baud.on_trial = true;
}

static void use_baud(uint32_t wanted)
{
    baud.now = wanted;
    line_set_baud(wanted);
}

void host_link_work(uint64_t now_us)
{
    if (!baud.next || !outbox_idle() || !line_quiet())
        return;
    baud.former = baud.on_trial ? baud.now : 0;
    use_baud(baud.next);
    baud.next = 0;
    last_frame_us = now_us;
}

/* Silence. */

bool host_link_lost(uint64_t now_us)
{
    uint64_t silence_us = now_us - last_frame_us;
    if (baud.former && silence_us >= BAUD_TIMEOUT_US) {
        use_baud(baud.former);
        baud.former = 0;
        last_frame_us = now_us;
        return false;
    }
    return greeted && watched && silence_us >= HOST_SILENCE_US;
}

void host_link_drop(void)
{
    greeted = false;
    baud.next = FIRST_BAUD;
    baud.on_trial = false;
}
