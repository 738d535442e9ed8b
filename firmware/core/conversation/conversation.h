/* The device's part of the conversation of firmware_protocol.md: hears the host, and notices when it has gone.
 *
 * `commands` obeys it, `action` does what takes long, `voice` speaks.
 */
#ifndef CONVERSATION_H
#define CONVERSATION_H

#include "messages.h" // struct hello
#include "scan.h" // struct place

// Which ping the ranging board is making; where a debugger, or an emulated room, finds it.
extern struct place ping_place;

void conversation_reset(void);
// Do what is due. To be called all the time.
void conversation_run(void);

void conversation_greeted(const struct hello *hello);
void conversation_change_baud(uint32_t baud); // as soon as all that was said has left

#endif
