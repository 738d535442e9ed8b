/* Written by generate.py; change that, not this. */

#ifndef COMMANDS_H
#define COMMANDS_H

#include "frames.h" // struct command_frame
#include "messages.h" // the commands

union command {
    struct hello hello;
    struct configure configure;
    struct turn turn;
    struct start_scan start_scan;
    struct resend resend;
    struct configure_turntable configure_turntable;
    struct set_baud set_baud;
    struct test_link test_link;
};

enum command_reading { COMMAND_READ, COMMAND_CUT_OFF, COMMAND_UNKNOWN };

// Read the payload of a frame.
enum command_reading command_read(const struct command_frame *frame, union command *to);
// Call the handler of a command that was read.
void command_handle(const struct command_frame *frame, const union command *command);

// The handlers: each answers its command, or refuses it.
void on_hello(const struct command_frame *frame, const struct hello *command);
void on_configure(const struct command_frame *frame, const struct configure *command);
void on_home(const struct command_frame *frame);
void on_turn(const struct command_frame *frame, const struct turn *command);
void on_start_scan(const struct command_frame *frame, const struct start_scan *command);
void on_stop(const struct command_frame *frame);
void on_resend(const struct command_frame *frame, const struct resend *command);
void on_ask_capabilities(const struct command_frame *frame);
void on_configure_turntable(const struct command_frame *frame, const struct configure_turntable *command);
void on_ask_statistics(const struct command_frame *frame);
void on_set_baud(const struct command_frame *frame, const struct set_baud *command);
void on_test_link(const struct command_frame *frame, const struct test_link *command);

#endif
