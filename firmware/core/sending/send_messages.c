/* Written by generate.py; change that, not this. */

#include "send_messages.h"

#include "outbox.h" // outbox_send

void send_info(const struct info *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u8(&payload, message->major);
    put_u8(&payload, message->minor);
    put_text(&payload, &message->firmware);
    put_text(&payload, &message->serial);
    put_text(&payload, &message->board);
    put_i16(&payload, message->temperature);
    put_u32(&payload, message->trace_rate);
    put_u32(&payload, message->microsteps);
    put_u32(&payload, message->boot);
    put_u8(&payload, message->homed);
    outbox_send(INFO, &payload);
}

void send_accepted(const struct accepted *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    outbox_send(ACCEPTED, &payload);
}

void send_refused(const struct refused *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u8(&payload, message->code);
    put_text(&payload, &message->text);
    outbox_send(REFUSED, &payload);
}

void send_settings(const struct settings *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u32(&payload, message->listen_us);
    put_u32(&payload, message->blanking_us);
    put_u8(&payload, message->trace);
    put_u32(&payload, message->speed_of_sound);
    put_u8(&payload, message->pulses);
    put_u8(&payload, message->echoes);
    put_u16(&payload, message->rearm_us);
    put_u32(&payload, message->trace_rate);
    put_u8(&payload, message->trace_bits);
    outbox_send(SETTINGS, &payload);
}

void send_started(const struct started *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u32(&payload, message->readings);
    put_u32(&payload, message->first);
    outbox_send(STARTED, &payload);
}

void send_finished(const struct finished *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u8(&payload, message->outcome);
    put_u32(&payload, message->readings);
    put_text(&payload, &message->text);
    outbox_send(FINISHED, &payload);
}

void send_reading_message(const struct reading_message *message)
{
    struct payload payload = outbox_payload();
    put_u32(&payload, message->number);
    put_u16(&payload, message->sweep);
    put_u8(&payload, message->ping);
    put_i32(&payload, message->angle);
    put_u64(&payload, message->fired_us);
    put_i16(&payload, message->temperature);
    put_numbers(&payload, &message->echoes);
    outbox_send(READING_MESSAGE, &payload);
}

void send_trace_chunk(const struct trace_chunk *message)
{
    struct payload payload = outbox_payload();
    put_u32(&payload, message->number);
    put_u16(&payload, message->offset);
    put_u16(&payload, message->total);
    put_u32(&payload, message->period_ns);
    put_u32(&payload, message->start_ns);
    put_samples(&payload, &message->samples);
    put_u8(&payload, message->kind);
    put_u8(&payload, message->bits);
    outbox_send(TRACE_CHUNK, &payload);
}

void send_heartbeat(const struct heartbeat *message)
{
    struct payload payload = outbox_payload();
    put_u8(&payload, message->state);
    put_i32(&payload, message->angle);
    put_u32(&payload, message->readings);
    put_i16(&payload, message->temperature);
    put_u32(&payload, message->boot);
    put_u8(&payload, message->homed);
    outbox_send(HEARTBEAT, &payload);
}

void send_capabilities(const struct capabilities *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u32(&payload, message->features);
    put_i32(&payload, message->lowest_angle);
    put_i32(&payload, message->highest_angle);
    put_u16(&payload, message->steps);
    put_u32(&payload, message->fastest);
    put_u32(&payload, message->hardest);
    put_u32(&payload, message->backlash);
    put_u32(&payload, message->longest_listen_us);
    put_u32(&payload, message->shortest_blanking_us);
    put_u16(&payload, message->shortest_rearm_us);
    put_u8(&payload, message->most_pulses);
    put_u8(&payload, message->most_echoes);
    put_u32(&payload, message->ping_period_us);
    put_u32(&payload, message->fastest_trace);
    put_u16(&payload, message->longest_trace);
    put_u32(&payload, message->fastest_baud);
    put_u16(&payload, message->readings_kept);
    outbox_send(CAPABILITIES, &payload);
}

void send_turntable_settings(const struct turntable_settings *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u32(&payload, message->speed);
    put_u32(&payload, message->acceleration);
    put_u32(&payload, message->settle_us);
    put_u8(&payload, message->approach);
    outbox_send(TURNTABLE_SETTINGS, &payload);
}

void send_statistics(const struct statistics *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_u32(&payload, message->frames);
    put_u32(&payload, message->rejected);
    put_u32(&payload, message->overruns);
    put_u32(&payload, message->pings);
    put_i32(&payload, message->lost_steps);
    put_u8(&payload, message->reset_cause);
    put_u16(&payload, message->stack_free);
    outbox_send(STATISTICS, &payload);
}

void send_link_tested(const struct link_tested *message)
{
    struct payload payload = outbox_payload();
    put_u16(&payload, message->command);
    put_samples(&payload, &message->data);
    outbox_send(LINK_TESTED, &payload);
}
