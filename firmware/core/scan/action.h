/* Carries out Home, Turn and StartScan, one at a time, with the turntable and the ranging board.
 *
 * Sends readings, traces and the result. Remembers the last of these commands: a repeated command gets the same answers
 * and is not carried out again.
 */
#ifndef ACTION_H
#define ACTION_H

#include "frames.h" // struct command_frame
#include "messages.h" // struct configure
#include "scan.h" // struct place

extern struct configure ping_settings; // in force
extern struct place ping_place; // of the current ping; the emulated board reads it

void action_reset(void);

bool action_running(void);
enum state action_state(void);
bool action_listening(void); // during a ping: nothing may be sent
bool action_needs_silence(uint64_t now_us); // a ping is overdue: no answer may start before it
uint32_t action_pings(void); // number since the start

bool action_is(const struct command_frame *order); // whether this is the remembered command
void action_repeat(void); // answer the remembered command again
void action_forget(void);

void action_home(const struct command_frame *order);
void action_turn(const struct command_frame *order, int32_t microdegrees);
void action_jog(const struct command_frame *order, int32_t microdegrees); // by this angle, also without a zero
void action_scan(const struct command_frame *order, const struct start_scan *scan);
void action_stop(void); // no effect if nothing is running

void action_send_again(uint32_t first, uint8_t count); // readings, as soon as the outbox is free

void action_work(uint64_t now_us);
bool action_send(void); // sends the next waiting reading or chunk; false if there is none

#endif
