/* What the device says: one function a message, each numbers and stamps its frame and begins to send it.
 *
 * A message waits until the one before has gone to the line: 3 ms at 1 000 000 baud, 12 at 250 000.
 */
#ifndef VOICE_H
#define VOICE_H

#include "messages.h" // the messages
#include "words.h" // struct words

void voice_reset(void);
void voice_pump(void); // to be called all the time
bool voice_idle(void); // whether all that was said has gone to the line

void say_info(const struct info *message);
void say_accepted(uint16_t command);
void say_refused(uint16_t command, enum refusal code, const struct words *words);
void say_refused_plainly(uint16_t command, enum refusal code, const char *flash_text);
void say_settings(const struct settings *message);
void say_started(const struct started *message);
void say_finished(const struct finished *message);
void say_reading(const struct reading_message *message); // its echoes need not stay
void say_trace_chunk(const struct trace_chunk *message); // its samples must stay until voice_idle
void say_heartbeat(const struct heartbeat *message);
void say_capabilities(const struct capabilities *message);
void say_turntable_settings(const struct turntable_settings *message);
void say_statistics(const struct statistics *message);
void say_link_tested(const struct link_tested *message); // its bytes need not stay

#endif
