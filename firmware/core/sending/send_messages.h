/* Written by generate.py; change that, not this. */

#ifndef SEND_MESSAGES_H
#define SEND_MESSAGES_H

#include "messages.h" // the messages

// Each waits for the message before it. Echoes and samples must stay where they are until outbox_idle.
void send_info(const struct info *message);
void send_accepted(const struct accepted *message);
void send_refused(const struct refused *message);
void send_settings(const struct settings *message);
void send_started(const struct started *message);
void send_finished(const struct finished *message);
void send_reading_message(const struct reading_message *message);
void send_trace_chunk(const struct trace_chunk *message);
void send_heartbeat(const struct heartbeat *message);
void send_capabilities(const struct capabilities *message);
void send_turntable_settings(const struct turntable_settings *message);
void send_statistics(const struct statistics *message);
void send_link_tested(const struct link_tested *message);

#endif
