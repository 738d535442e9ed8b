/* Main loop of the device: receives commands, carries them out and sends messages. */
#ifndef CONVERSATION_H
#define CONVERSATION_H

#include <stdbool.h>

void conversation_reset(void);
void conversation_run(void); // one round of the main loop; call it continuously
// Whether the next round may come up to 1 ms later. A received byte or a step must end the wait at once.
bool conversation_can_wait(void);

#endif
