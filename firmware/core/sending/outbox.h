/* One message at a time, on its way to the line.
 *
 * A message waits until the one before has left: 3 ms at 1 000 000 baud, 12 at 250 000.
 */
#ifndef OUTBOX_H
#define OUTBOX_H

#include "messages.h" // enum message_type

void outbox_reset(void);
struct payload outbox_payload(void); // of the next message; waits for the one before
void outbox_send(enum message_type type, const struct payload *payload);
void outbox_pump(void); // hands bytes to the line; to be called all the time
void outbox_finish(void); // waits until everything is handed to the line
bool outbox_idle(void); // everything is handed to the line

#endif
