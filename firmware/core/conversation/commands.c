/* Written by generate.py; change that, not this. */

#include "commands.h"

static bool read_hello(struct hello *to, struct payload *from)
{
    to->major = get_u8(from);
    to->minor = get_u8(from);
    return from->whole;
}

static bool read_configure(struct configure *to, struct payload *from)
{
    to->listen_us = get_u32(from);
    to->blanking_us = get_u32(from);
    to->trace = get_u8(from);
    to->speed_of_sound = get_u32(from);
    to->pulses = more(from) ? get_u8(from) : 0;
    to->echoes = more(from) ? get_u8(from) : 122;
    to->rearm_us = more(from) ? get_u16(from) : 0;
    to->trace_rate = more(from) ? get_u32(from) : 0;
    to->trace_bits = more(from) ? get_u8(from) : 0;
    return from->whole;
}

static bool read_turn(struct turn *to, struct payload *from)
{
    to->angle = get_i32(from);
    return from->whole;
}

static bool read_start_scan(struct start_scan *to, struct payload *from)
{
    to->start = get_i32(from);
    to->step = get_i32(from);
    to->headings = get_u16(from);
    to->sweeps = get_u16(from);
    to->pings = get_u8(from);
    to->first = more(from) ? get_u32(from) : 0;
    to->count = more(from) ? get_u32(from) : 0;
    return from->whole;
}

static bool read_resend(struct resend *to, struct payload *from)
{
    to->first = get_u32(from);
    to->count = get_u8(from);
    return from->whole;
}

static bool read_configure_turntable(struct configure_turntable *to, struct payload *from)
{
    to->speed = get_u32(from);
    to->acceleration = get_u32(from);
    to->settle_us = get_u32(from);
    to->approach = get_u8(from);
    return from->whole;
}

static bool read_set_baud(struct set_baud *to, struct payload *from)
{
    to->baud = get_u32(from);
    return from->whole;
}

static bool read_test_link(struct test_link *to, struct payload *from)
{
    to->size = get_u16(from);
    to->data = get_samples(from);
    return from->whole;
}

enum command_reading command_read(const struct command_frame *frame, union command *to)
{
    struct payload from = payload_of((uint8_t *)frame->payload, frame->size);
    bool whole = true;
    switch (frame->type) {
    case HELLO:
        whole = read_hello(&to->hello, &from);
        break;
    case CONFIGURE:
        whole = read_configure(&to->configure, &from);
        break;
    case TURN:
        whole = read_turn(&to->turn, &from);
        break;
    case START_SCAN:
        whole = read_start_scan(&to->start_scan, &from);
        break;
    case RESEND:
        whole = read_resend(&to->resend, &from);
        break;
    case CONFIGURE_TURNTABLE:
        whole = read_configure_turntable(&to->configure_turntable, &from);
        break;
    case SET_BAUD:
        whole = read_set_baud(&to->set_baud, &from);
        break;
    case TEST_LINK:
        whole = read_test_link(&to->test_link, &from);
        break;
    case HOME:
    case STOP:
    case ASK_CAPABILITIES:
    case ASK_STATISTICS:
        break;
    default:
        return COMMAND_UNKNOWN;
    }
    return whole ? COMMAND_READ : COMMAND_CUT_OFF;
}

void command_handle(const struct command_frame *frame, const union command *command)
{
    switch (frame->type) {
    case HELLO:
        on_hello(frame, &command->hello);
        break;
    case CONFIGURE:
        on_configure(frame, &command->configure);
        break;
    case HOME:
        on_home(frame);
        break;
    case TURN:
        on_turn(frame, &command->turn);
        break;
    case START_SCAN:
        on_start_scan(frame, &command->start_scan);
        break;
    case STOP:
        on_stop(frame);
        break;
    case RESEND:
        on_resend(frame, &command->resend);
        break;
    case ASK_CAPABILITIES:
        on_ask_capabilities(frame);
        break;
    case CONFIGURE_TURNTABLE:
        on_configure_turntable(frame, &command->configure_turntable);
        break;
    case ASK_STATISTICS:
        on_ask_statistics(frame);
        break;
    case SET_BAUD:
        on_set_baud(frame, &command->set_baud);
        break;
    case TEST_LINK:
        on_test_link(frame, &command->test_link);
        break;
    }
}
