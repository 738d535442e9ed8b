#include "voice.h"

#include "frames.h" // struct sender
#include "hardware.h" // clock_us

static struct sender sender;

void voice_reset(void)
{
    sender.sending = false;
    sender.sequence = 0;
}

void voice_pump(void) { sender_pump(&sender); }

bool voice_idle(void) { return !sender.sending; }

static void finish_sending(void)
{
    while (sender.sending)
        sender_pump(&sender);
}

static struct payload begin(void)
{
    finish_sending();
    return sender_payload(&sender);
}

static void say(enum message_type type, const struct payload *payload)
{
    sender_send(&sender, type, clock_us(), payload);
    sender_pump(&sender);
}

#define SAY(type, pack)                                                                                                \
    struct payload payload = begin();                                                                                  \
    pack(&payload, message);                                                                                           \
    say(type, &payload)

void say_info(const struct info *message) { SAY(INFO, info_pack); }

void say_accepted(uint16_t command)
{
    const struct accepted *message = &(struct accepted){.command = command};
    SAY(ACCEPTED, accepted_pack);
}

void say_refused(uint16_t command, enum refusal code, const struct words *words)
{
    const struct refused *message = &(struct refused){.command = command, .code = code, .text = words_text(words)};
    SAY(REFUSED, refused_pack);
}

void say_refused_plainly(uint16_t command, enum refusal code, const char *flash_text)
{
    struct words words = {.size = 0};
    words_add(&words, flash_text);
    say_refused(command, code, &words);
}

void say_settings(const struct settings *message) { SAY(SETTINGS, settings_pack); }

void say_started(const struct started *message) { SAY(STARTED, started_pack); }

void say_finished(const struct finished *message) { SAY(FINISHED, finished_pack); }

void say_reading(const struct reading_message *message)
{
    SAY(READING_MESSAGE, reading_message_pack);
    finish_sending();
}

void say_trace_chunk(const struct trace_chunk *message) { SAY(TRACE_CHUNK, trace_chunk_pack); }

void say_heartbeat(const struct heartbeat *message) { SAY(HEARTBEAT, heartbeat_pack); }

void say_capabilities(const struct capabilities *message) { SAY(CAPABILITIES, capabilities_pack); }

void say_turntable_settings(const struct turntable_settings *message)
{
    SAY(TURNTABLE_SETTINGS, turntable_settings_pack);
}

void say_statistics(const struct statistics *message) { SAY(STATISTICS, statistics_pack); }

void say_link_tested(const struct link_tested *message)
{
    SAY(LINK_TESTED, link_tested_pack);
    finish_sending();
}
