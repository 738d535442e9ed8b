/* Reasons to refuse that several commands share. Each function refuses and returns true, or returns false. */
#ifndef REFUSALS_H
#define REFUSALS_H

#include "frames.h" // struct command_frame

bool refused_while_busy(const struct command_frame *frame); // a home, turn or scan is under way
bool refused_angle(const struct command_frame *frame, int64_t microdegrees); // not homed, or beyond the cable

#endif
