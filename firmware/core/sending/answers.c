#include "answers.h"

#include "send_messages.h" // send_accepted, send_refused

void answer_accepted(const struct command_frame *frame) { send_accepted(&(struct accepted){frame->sequence}); }

void answer_refused_in_words(const struct command_frame *frame, enum refusal code, const struct words *words)
{
    send_refused(&(struct refused){.command = frame->sequence, .code = code, .text = words_text(words)});
}

void answer_refused(const struct command_frame *frame, enum refusal code, const char *flash_text)
{
    struct words words = {.size = 0};
    words_add(&words, flash_text);
    answer_refused_in_words(frame, code, &words);
}

void answer_out_of_range(const struct command_frame *frame, const char *flash_text)
{
    answer_refused(frame, REFUSAL_OUT_OF_RANGE, flash_text);
}
