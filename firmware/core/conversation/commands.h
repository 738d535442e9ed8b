/* Commands: what a host may ask, what is refused and why. */
#ifndef COMMANDS_H
#define COMMANDS_H

#include "frames.h" // struct command_frame

// Carry out a command, or refuse it; `greeted`: whether a Hello came before.
void obey(const struct command_frame *frame, const struct receiver *receiver, bool greeted);

#endif
