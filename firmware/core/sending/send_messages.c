/* Written by generate.py; change that, not this. */

#include "messages.h"

bool hello_unpack(struct hello *to, struct payload *from)
{
    to->major = get_u8(from);
    to->minor = get_u8(from);
    return from->whole;
}

bool configure_unpack(struct configure *to, struct payload *from)
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

bool turn_unpack(struct turn *to, struct payload *from)
{
    to->angle = get_i32(from);
    return from->whole;
}

bool start_scan_unpack(struct start_scan *to, struct payload *from)
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

bool resend_unpack(struct resend *to, struct payload *from)
{
    to->first = get_u32(from);
    to->count = get_u8(from);
    return from->whole;
}

bool configure_turntable_unpack(struct configure_turntable *to, struct payload *from)
{
    to->speed = get_u32(from);
    to->acceleration = get_u32(from);
    to->settle_us = get_u32(from);
    to->approach = get_u8(from);
    return from->whole;
}

bool set_baud_unpack(struct set_baud *to, struct payload *from)
{
    to->baud = get_u32(from);
    return from->whole;
}

bool test_link_unpack(struct test_link *to, struct payload *from)
{
    to->size = get_u16(from);
    to->data = get_samples(from);
    return from->whole;
}

void info_pack(struct payload *to, const struct info *from)
{
    put_u16(to, from->command);
    put_u8(to, from->major);
    put_u8(to, from->minor);
    put_text(to, &from->firmware);
    put_text(to, &from->serial);
    put_text(to, &from->board);
    put_i16(to, from->temperature);
    put_u32(to, from->trace_rate);
    put_u32(to, from->microsteps);
    put_u32(to, from->boot);
    put_u8(to, from->homed);
}

void accepted_pack(struct payload *to, const struct accepted *from)
{
    put_u16(to, from->command);
}

void refused_pack(struct payload *to, const struct refused *from)
{
    put_u16(to, from->command);
    put_u8(to, from->code);
    put_text(to, &from->text);
}

void settings_pack(struct payload *to, const struct settings *from)
{
    put_u16(to, from->command);
    put_u32(to, from->listen_us);
    put_u32(to, from->blanking_us);
    put_u8(to, from->trace);
    put_u32(to, from->speed_of_sound);
    put_u8(to, from->pulses);
    put_u8(to, from->echoes);
    put_u16(to, from->rearm_us);
    put_u32(to, from->trace_rate);
    put_u8(to, from->trace_bits);
}

void started_pack(struct payload *to, const struct started *from)
{
    put_u16(to, from->command);
    put_u32(to, from->readings);
    put_u32(to, from->first);
}

void finished_pack(struct payload *to, const struct finished *from)
{
    put_u16(to, from->command);
    put_u8(to, from->outcome);
    put_u32(to, from->readings);
    put_text(to, &from->text);
}

void reading_message_pack(struct payload *to, const struct reading_message *from)
{
    put_u32(to, from->number);
    put_u16(to, from->sweep);
    put_u8(to, from->ping);
    put_i32(to, from->angle);
    put_u64(to, from->fired_us);
    put_i16(to, from->temperature);
    put_numbers(to, &from->echoes);
}

void trace_chunk_pack(struct payload *to, const struct trace_chunk *from)
{
    put_u32(to, from->number);
    put_u16(to, from->offset);
    put_u16(to, from->total);
    put_u32(to, from->period_ns);
    put_u32(to, from->start_ns);
    put_samples(to, &from->samples);
    put_u8(to, from->kind);
    put_u8(to, from->bits);
}

void heartbeat_pack(struct payload *to, const struct heartbeat *from)
{
    put_u8(to, from->state);
    put_i32(to, from->angle);
    put_u32(to, from->readings);
    put_i16(to, from->temperature);
    put_u32(to, from->boot);
    put_u8(to, from->homed);
}

void capabilities_pack(struct payload *to, const struct capabilities *from)
{
    put_u16(to, from->command);
    put_u32(to, from->features);
    put_i32(to, from->lowest_angle);
    put_i32(to, from->highest_angle);
    put_u16(to, from->steps);
    put_u32(to, from->fastest);
    put_u32(to, from->hardest);
    put_u32(to, from->backlash);
    put_u32(to, from->longest_listen_us);
    put_u32(to, from->shortest_blanking_us);
    put_u16(to, from->shortest_rearm_us);
    put_u8(to, from->most_pulses);
    put_u8(to, from->most_echoes);
    put_u32(to, from->ping_period_us);
    put_u32(to, from->fastest_trace);
    put_u16(to, from->longest_trace);
    put_u32(to, from->fastest_baud);
    put_u16(to, from->readings_kept);
}

void turntable_settings_pack(struct payload *to, const struct turntable_settings *from)
{
    put_u16(to, from->command);
    put_u32(to, from->speed);
    put_u32(to, from->acceleration);
    put_u32(to, from->settle_us);
    put_u8(to, from->approach);
}

void statistics_pack(struct payload *to, const struct statistics *from)
{
    put_u16(to, from->command);
    put_u32(to, from->frames);
    put_u32(to, from->rejected);
    put_u32(to, from->overruns);
    put_u32(to, from->pings);
    put_i32(to, from->lost_steps);
    put_u8(to, from->reset_cause);
    put_u16(to, from->stack_free);
}

void link_tested_pack(struct payload *to, const struct link_tested *from)
{
    put_u16(to, from->command);
    put_samples(to, &from->data);
}
