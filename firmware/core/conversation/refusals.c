#include "refusals.h"

#include "action.h" // action_running
#include "answers.h" // answer_refused
#include "limits.h" // turntable_reach
#include "turntable.h" // turntable_homed

bool refused_while_busy(const struct command_frame *frame)
{
    if (!action_running())
        return false;
    answer_refused(frame, REFUSAL_BUSY, FLASH_TEXT("homing, turning or scanning; send Stop first"));
    return true;
}

bool refused_angle(const struct command_frame *frame, int64_t microdegrees)
{
    if (!turntable_homed()) {
        answer_refused(frame, REFUSAL_NOT_HOMED,
                       FLASH_TEXT("the zero of the turntable is unknown; send Home first"));
        return true;
    }
    if (turntable_reaches(microdegrees))
        return false;
    struct words words = {.size = 0};
    words_degrees(&words, microdegrees);
    words_add(&words, FLASH_TEXT(" degrees; the cable winds from "));
    words_number(&words, -turntable_reach());
    words_add(&words, FLASH_TEXT(" to "));
    words_number(&words, turntable_reach());
    words_add(&words, FLASH_TEXT(" degrees"));
    answer_refused_in_words(frame, REFUSAL_OUT_OF_RANGE, &words);
    return true;
}
