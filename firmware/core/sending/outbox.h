/* Sends one message at a time.
 *
 * A message waits until the previous one has been queued: 3 ms at 1 000 000 baud, 12 ms at 250 000.
 */
#ifndef OUTBOX_H
#define OUTBOX_H

#include "messages.h" // enum message_type

void outbox_reset(void);
struct payload outbox_payload(void); // for the next message; waits for the previous one
void outbox_send(enum message_type type, const struct payload *payload);
void outbox_pump(void); // passes bytes to the line; call it continuously
void outbox_finish(void); // waits until everything is passed to the line
bool outbox_idle(void); // whether everything is passed to the line

#endif
