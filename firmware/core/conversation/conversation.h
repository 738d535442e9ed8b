/* The main loop of the device: receives commands, carries them out, sends what is due. */
#ifndef CONVERSATION_H
#define CONVERSATION_H

void conversation_reset(void);
void conversation_run(void); // does what is due; to be called all the time

#endif
