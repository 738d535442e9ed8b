/* Checks that several commands share. Each refuses the command and returns true, or returns false. */
#ifndef REFUSALS_H
#define REFUSALS_H

#include "frames.h" // struct command_frame

// If a Home, Turn or StartScan is running.
bool refused_while_busy(const struct command_frame *frame);
// If the zero is unknown or the angle is beyond the limits of the cable.
bool refused_angle(const struct command_frame *frame, int64_t microdegrees);

#endif
