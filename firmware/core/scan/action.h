/* What the device does at length: home, turn, scan; one at a time.
 *
 * Takes orders and has turntable and ranging board carry them out; says readings, traces and how it ended. It remembers
 * the last order with what it answered, so that the same order is answered again and not carried out again.
 */
#ifndef ACTION_H
#define ACTION_H

#include "frames.h" // struct command_frame
#include "messages.h" // struct configure

extern struct configure ping_settings; // in force

void action_reset(void);

bool action_running(void);
enum state action_state(void);
bool action_listening(void); // a ping is under way: nothing may be said
uint32_t action_pings(void); // made since the start

bool action_is(const struct command_frame *order); // whether this is the one it remembers
void action_repeat(void); // what was said to it
void action_forget(void);

void action_home(const struct command_frame *order);
void action_turn(const struct command_frame *order, int32_t microdegrees);
void action_scan(const struct command_frame *order, const struct start_scan *scan);
void action_stop(void); // does nothing where nothing runs

void action_send_again(uint32_t first, uint8_t count); // readings, as soon as there is nothing else to say

void action_work(uint64_t now_us);
bool action_speak(void); // says the next reading or chunk that waits; false where none does

#endif
