/* The connection to the host: its frames, its greeting, its silence, the speed of the line. */
#ifndef HOST_LINK_H
#define HOST_LINK_H

#include "frames.h" // struct command_frame

void host_link_reset(void);

// The next sound frame; false if no more bytes have come, or the speed of the line is about to change.
bool host_link_receive(struct command_frame *frame);
const struct receiver *host_link_receiver(void); // its counts

void host_link_greet(const struct hello *hello);
bool host_link_greeted(void);
bool host_link_heartbeat_due(uint64_t now_us); // true once every HEARTBEAT_US after the greeting

void host_link_change_baud(uint32_t wanted); // as soon as everything that was sent has left
void host_link_work(uint64_t now_us); // changes the speed when it is due
// Whether the host is gone: a host that watches the device has been silent for HOST_SILENCE_US.
bool host_link_lost(uint64_t now_us);
void host_link_drop(void); // wait for a new host at the first speed

#endif
