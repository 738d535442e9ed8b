#include "conversation.h"

#include "action.h" // action_work
#include "answers.h" // answer_refused
#include "commands.h" // command_handle
#include "hardware.h" // clock_us
#include "host_link.h" // host_link_receive
#include "kept.h" // kept_end
#include "outbox.h" // outbox_pump
#include "send_messages.h" // send_heartbeat
#include "turntable.h" // turntable_release

/* Carry out at most one command a pass, and let the device's own messages take turns with answers: a host that sends
 * without pause must not delay heartbeats, pings or the watchdog. */
static struct command_frame received;
static bool waiting; // `received` is not carried out yet
static bool hosts_turn;

void conversation_reset(void)
{
    waiting = false;
    hosts_turn = true;
    host_link_reset();
    outbox_reset();
    turntable_reset();
    action_reset();
}

static void refuse_unknown(const struct command_frame *frame)
{
    struct words words = {.size = 0};
    words_add(&words, FLASH_TEXT("message type 0x"));
    words_hex(&words, frame->type);
    words_add(&words, FLASH_TEXT(" is unknown to this firmware"));
    answer_refused_in_words(frame, REFUSAL_UNKNOWN, &words);
}

static void handle(const struct command_frame *frame)
{
    if (host_link_greeted() && action_is(frame)) {
        action_repeat();
        return;
    }
    union command command;
    enum command_reading reading = command_read(frame, &command);
    if (reading == COMMAND_UNKNOWN)
        refuse_unknown(frame);
    else if (reading == COMMAND_CUT_OFF)
        answer_refused(frame, REFUSAL_MALFORMED, FLASH_TEXT("the payload is too short"));
    else if (!host_link_greeted() && frame->type != HELLO)
        answer_refused(frame, REFUSAL_NO_HELLO, FLASH_TEXT("send Hello first"));
    else
        command_handle(frame, &command);
}

static void receive(uint64_t now_us)
{
    if (action_listening() || action_needs_silence(now_us))
        return;
    if (!waiting)
        waiting = host_link_receive(&received);
    if (!waiting || !hosts_turn || !outbox_idle())
        return;
    waiting = hosts_turn = false;
    handle(&received);
}

static void watch_host(uint64_t now_us)
{
    if (action_listening() || !host_link_lost(now_us))
        return;
    action_stop();
    action_forget();
    action_send_again(0, 0);
    turntable_release();
    host_link_drop();
}

// Send one message, the most urgent first. Answers are sent between these messages.
static void send_next(uint64_t now_us)
{
    if (!outbox_idle() || action_listening())
        return;
    hosts_turn = true;
    if (!host_link_heartbeat_due(now_us)) {
        action_send();
        return;
    }
    send_heartbeat(&(struct heartbeat){
        .state = action_state(),
        .angle = turntable_microdegrees(),
        .readings = kept_end(),
        .temperature = thermometer(),
        .boot = boot_count(),
        .homed = turntable_zero(),
        .inputs = turntable_inputs() | ranging_inputs(),
    });
}

void conversation_run(void)
{
    outbox_pump();
    receive(clock_us());
    uint64_t now_us = clock_us();
    host_link_work(now_us);
    watch_host(now_us);
    action_work(now_us);
    send_next(now_us);
}
