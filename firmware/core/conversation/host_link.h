/* Connection to the host: frames, greeting, silence and baud rate. */
#ifndef HOST_LINK_H
#define HOST_LINK_H

#include "frames.h" // struct command_frame

void host_link_reset(void);

// The next valid frame. False if no more bytes have arrived, or the baud rate is about to change.
bool host_link_receive(struct command_frame *frame);
const struct receiver *host_link_receiver(void); // for its counters

void host_link_greet(const struct hello *hello);
bool host_link_greeted(void);
bool host_link_heartbeat_due(uint64_t now_us); // true once every HEARTBEAT_US after the greeting

void host_link_change_baud(uint32_t wanted); // after all queued bytes have been sent
void host_link_work(uint64_t now_us); // changes the baud rate when it is due
// Whether the host is gone: a host of version 1.1 has been silent for HOST_SILENCE_US.
bool host_link_lost(uint64_t now_us);
void host_link_drop(void); // wait for a new host at FIRST_BAUD

#endif
