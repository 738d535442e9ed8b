/* Main loop of the device: receives commands, carries them out and sends messages. */
#ifndef CONVERSATION_H
#define CONVERSATION_H

void conversation_reset(void);
void conversation_run(void); // one round of the main loop; call it continuously

#endif
