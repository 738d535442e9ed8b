/* The two short answers to a command: Accepted, and Refused with a text for the user. */
#ifndef ANSWERS_H
#define ANSWERS_H

#include "frames.h" // struct command_frame
#include "words.h" // struct words

void answer_accepted(const struct command_frame *frame);
void answer_refused(const struct command_frame *frame, enum refusal code, const char *flash_text);
void answer_refused_in_words(const struct command_frame *frame, enum refusal code, const struct words *words);
void answer_out_of_range(const struct command_frame *frame, const char *flash_text);

#endif
